"""The pressure from which all valves of a robot draw, where the rig file names a reservoir.

The supply refills the reservoir through an ISO 6358 restriction; what the valves take is known from
the controller's own commands: dP/dt = k R T (m_in - sum of m_drawn)/V
(`pam_model.effects.supply_droop`). The joints share it: if one draws, the others have less. No
feedback is closed by it.
"""

from __future__ import annotations

from pam_model.gas import GAS_CONSTANT, reference_density, reference_flow
from pam_model.robot import Robot


class SupplyReservoir:
    """The supply of all valves of a robot.

    Parameters
    ----------
    robot : Robot
        Gas, supply, and its reservoir; the critical ratio of the first valve counts for the
        restriction.

    Attributes
    ----------
    pressure : float
        Before the valves [Pa absolute].
    """

    def __init__(self, robot: Robot) -> None:
        gas, supply = robot.gas, robot.supply
        self._supply, self._ambient = supply.pressure, gas.ambient_pressure
        self._conductance = supply.refill_conductance
        self._critical = robot.muscles[0].valve.critical_ratio
        self._density = reference_density(gas.temperature)
        per_mass = gas.polytropic_exponent * GAS_CONSTANT * gas.temperature
        self._per_flow = per_mass / supply.reservoir_volume
        self.reset()

    def reset(self) -> None:
        """The reservoir is full."""
        self.pressure, self._drawn = self._supply, 0.0

    def draw(self, flow: float) -> None:
        """Take the flow that a valve lets into its muscle in this cycle [kg/s]."""
        self._drawn += max(flow, 0.0)

    def advance(self, step: float) -> None:
        """Advance by a cycle [s]."""
        drawn, self._drawn = self._drawn, 0.0
        if self._conductance == 0.0:
            return
        entering = self._density * reference_flow(
            self._conductance, self._critical, self._supply, self.pressure
        )
        pressure = self.pressure + step * self._per_flow * (entering - drawn)
        self.pressure = min(max(pressure, self._ambient), self._supply)
