"""The valves draw from a reservoir that the supply refills through a restriction."""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Nothing, Portrait, Range, Search
from pam_model.effects.slots import Adjusts


def refill_conductance(ideal: float, conductance: float, volume: float) -> float:
    """Conductance of the refill path [m^3/(s Pa)]; 0 keeps the ideal supply."""
    return conductance


def reservoir_volume(ideal: float, conductance: float, volume: float) -> float:
    """Volume of the reservoir [m^3]."""
    return volume


EFFECT = Effect(
    name="supply_droop",
    order=50,
    stage="valve",
    scope="rig",
    description="the valves draw from a reservoir that supply_pressure refills through a "
    "restriction",
    law="dP_s/dt = k R T (mdot_in - sum of mdot_drawn)/V_s, mdot_in by ISO 6358 with C_s",
    source="ISO 6358-1, flow-rate characteristics of pneumatic components",
    parameters={
        "conductance": EffectParameter(
            "C_s", "m^3/(s Pa)", 0.0, 0.0, 1e-6, "refill path; 0: ideal supply"
        ),
        "volume": EffectParameter("V_s", "m^3", 1e-3, 1e-6, 1.0, "reservoir", True),
    },
    slots=(
        Adjusts("reservoir.conductance", refill_conductance),
        Adjusts("reservoir.volume", reservoir_volume),
    ),
    control=Included(
        "computes the pressure of the reservoir from the flows that it commands itself to all "
        "joints, and opens the valves accordingly"
    ),
    plausibility=Nothing(
        "if the supply pressure is measured, it replaces the stated one; otherwise the observer "
        "corrects itself with the measurement, and `plausibility.pressure_residual` must be larger "
        "than the remaining error"
    ),
    search=Search(
        ranges=lambda rig: {
            "conductance": Range(
                1e-3 * rig.flow, 20.0 * rig.flow, 1.0, (0.1 * rig.flow, 0.5 * rig.flow), True
            ),
            "volume": Range(
                0.05 * rig.volume,
                300.0 * rig.volume,
                1.0,
                (3.0 * rig.volume, 20 * rig.volume),
                True,
            ),
        },
        shown_by=("commands",),
    ),
    portrait=Portrait(
        sizes={"conductance": 3e-10, "volume": 2e-4},
        signature="After air was drawn, filling is slow for some time; venting is not affected.",
        easily_taken_for="exhaust_restriction with a ratio above 1; a measured supply pressure "
        "decides.",
        told_apart_by="Record `supply_pressure`, or fill both muscles at once.",
    ),
)
