"""The gas: flow through restrictions, and the pressure of a chamber. Pressures are absolute."""

from pam_model.gas.chamber import (
    first_law_pressure_rate,
    flow_for_pressure_rate,
    pressure_rate,
    temperature_rate,
)
from pam_model.gas.constants import (
    GAS_CONSTANT,
    HEAT_CAPACITY_RATIO,
    LINEAR_RATIO,
    REFERENCE_DENSITY,
    REFERENCE_TEMPERATURE,
)
from pam_model.gas.flow import (
    choking_slope,
    critical_pressure_ratio,
    flow_function,
    flow_share,
    mass_flow,
    opening_for_flow,
    orifice_flow,
    reference_density,
    reference_flow,
    valve_flow,
    valve_opening,
)

__all__ = [
    "GAS_CONSTANT",
    "HEAT_CAPACITY_RATIO",
    "LINEAR_RATIO",
    "REFERENCE_DENSITY",
    "REFERENCE_TEMPERATURE",
    "choking_slope",
    "critical_pressure_ratio",
    "first_law_pressure_rate",
    "flow_for_pressure_rate",
    "flow_function",
    "flow_share",
    "mass_flow",
    "opening_for_flow",
    "orifice_flow",
    "pressure_rate",
    "reference_density",
    "reference_flow",
    "temperature_rate",
    "valve_flow",
    "valve_opening",
]
