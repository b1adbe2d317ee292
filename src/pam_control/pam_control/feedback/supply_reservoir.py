"""The pressure from which the valves of a joint draw, where the rig file names a reservoir.

The supply refills the reservoir through an ISO 6358 restriction; what the valves take is known from
the controller's own commands: dP/dt = k R T (m_in - m_drawn)/V (`pam_model.effects.supply_droop`).
No feedback is closed by it.
"""

from __future__ import annotations

from pam_model.effects import adjusted
from pam_model.gas import GAS_CONSTANT, reference_density, reference_flow
from pam_model.rig import Muscle, Rig


class SupplyReservoir:
    """The supply of the valves of one joint.

    Parameters
    ----------
    rig : Rig
        Gas, supply, and the reservoir if there is one.
    muscle : Muscle
        One of the joint; the critical ratio of its valve counts for the restriction.

    Attributes
    ----------
    pressure : float
        Before the valves [Pa absolute].
    """

    def __init__(self, rig: Rig, muscle: Muscle) -> None:
        self._supply, self._ambient = rig.supply_pressure, rig.gas.ambient_pressure
        self._conductance = adjusted("reservoir.conductance", None, rig.effects)
        self._critical = muscle.valve.critical_ratio
        self._density = reference_density(rig.gas.temperature)
        per_mass = rig.gas.polytropic_exponent * GAS_CONSTANT * rig.gas.temperature
        self._per_flow = per_mass / adjusted("reservoir.volume", None, rig.effects)
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
