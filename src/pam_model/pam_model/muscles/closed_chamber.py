"""Stiffness of a muscle whose gas is shut in.

Source: the polytropic law, P_abs (V + dead volume)^exponent stays constant, and the chain rule,
dF/dL = (dF/dL at constant P) + dF/dP dP/dL.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any


class ClosedChamber(ABC):
    """Defines `closed_stiffness` for models whose gas volume depends on the length alone."""

    @abstractmethod
    def stiffness(self, pressure: Any, length: Any) -> Any:
        """dF/dL at constant pressure [N/m]."""

    @abstractmethod
    def pressure_slope(self, pressure: Any, length: Any) -> Any:
        """dF/dP at constant length [m^2]."""

    @abstractmethod
    def volume(self, length: Any) -> Any:
        """Gas volume [m^3], without the rig's dead volume."""

    @abstractmethod
    def volume_slope(self, length: Any) -> Any:
        """dV/dL [m^2]."""

    def closed_stiffness(
        self,
        pressure: Any,
        length: Any,
        *,
        dead_volume: float,
        ambient_pressure: float,
        exponent: float,
    ) -> Any:
        """dF/dL [N/m] with the gas shut in, at gauge pressure [Pa] and length [m].

        Parameters
        ----------
        pressure, length : float or array
            Gauge pressure [Pa] and length [m].
        dead_volume : float
            Volume outside the muscle [m^3].
        ambient_pressure : float
            Absolute [Pa].
        exponent : float
            Of the polytropic law [-].
        """
        absolute = pressure + ambient_pressure
        room = self.volume(length) + dead_volume
        gas = -exponent * absolute * self.volume_slope(length) / room  # dP/dL
        return self.stiffness(pressure, length) + self.pressure_slope(pressure, length) * gas
