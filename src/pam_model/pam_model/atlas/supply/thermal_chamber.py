"""The first-law chamber: pressure and temperature of a muscle's gas that exchanges heat.

The rates are those of pam_model.gas.chamber, which derives them from the energy balance of an ideal
gas, with Q = h A (T_wall - T).
"""

from __future__ import annotations

from dataclasses import dataclass

from pam_model.domain import require
from pam_model.gas import first_law_pressure_rate, temperature_rate


@dataclass(frozen=True, slots=True)
class ThermalChamber:
    """The wall of a chamber that exchanges heat with its gas.

    Raises
    ------
    DomainError
        For h or A below 0 or a temperature not above 0; by `rates` for a volume, pressure or
        temperature not above 0 and flows below 0.
    """

    heat_transfer: float  # h [W/(m^2 K)]; 10-60 for a muscle
    wall_area: float  # a [m^2]
    wall_temperature: float  # T_wall [K]

    def __post_init__(self) -> None:
        require("heat_transfer [W/(m^2 K)]", self.heat_transfer, 0.0)
        require("wall_area [m^2]", self.wall_area, 0.0)
        require("wall_temperature [K]", self.wall_temperature, 0.0, open_low=True)

    def rates(
        self,
        pressure: float,
        temperature: float,
        *,
        volume: float,
        volume_rate: float,
        inflow: float,
        inflow_temperature: float,
        outflow: float,
    ) -> tuple[float, float]:
        """Rate of absolute pressure [Pa/s] and of temperature [K/s].

        Parameters
        ----------
        pressure : float
            Absolute pressure [Pa].
        temperature : float
            Temperature of the gas [K].
        volume, volume_rate : float
            Gas volume including the dead volume [m^3] and dV/dt [m^3/s].
        inflow, outflow : float
            Mass flows, neither below 0 [kg/s].
        inflow_temperature : float
            Temperature of the gas that enters [K].
        """
        require("pressure [Pa abs]", pressure, 0.0, open_low=True)
        require("temperature [K]", temperature, 0.0, open_low=True)
        require("volume [m^3]", volume, 0.0, open_low=True)
        require("inflow [kg/s]", inflow, 0.0)
        require("outflow [kg/s]", outflow, 0.0)
        heat = self.heat_transfer * self.wall_area * (self.wall_temperature - temperature)
        rate = first_law_pressure_rate(
            pressure,
            temperature,
            volume,
            volume_rate,
            0.0,
            inflow,
            inflow_temperature,
            outflow,
            heat,
        )
        flow = inflow - outflow
        return rate, temperature_rate(pressure, temperature, volume, rate, volume_rate, flow)
