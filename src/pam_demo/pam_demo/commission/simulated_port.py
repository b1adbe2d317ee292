"""A port to a simulated joint: the suite's own plant, or the robot that a rig file describes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pam_demo.commission.robot_port import JointReading
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import Plant, vented_state
from pam_model.rig import Rig

STEP = 5e-4  # s


class SimulatedPort:
    """One joint, vented at first, faster than real time.

    Parameters
    ----------
    rig : Rig
        With one joint.
    period : float
        Between two readings [s].
    changes : mapping of str to float, optional
        Plant parameters that differ from the rig file.

    Attributes
    ----------
    period, measurement_delay, command_delay : float
        As of every `RobotPort`; a command acts one period after the reading it follows from.
    """

    def __init__(self, rig: Rig, period: float, changes: Mapping[str, float] | None = None) -> None:
        self.period, self.measurement_delay, self.command_delay = period, 0.0, period
        parameters = PlantParameters.from_rig(rig).forced(dict(changes or {}))
        self._plant = Plant(parameters, STEP, vented_state(parameters))
        self._shown: tuple[float, ...] = (self._plant.output["position"], 0.0, 0.0)
        self._count = 0

    def advance(self, commands: Sequence[float]) -> JointReading:
        """As of every `RobotPort`."""
        position, first, second = self._shown
        reading = JointReading(self._count * self.period, position, (first, second))
        self._shown = self._plant.step(commands, self.period)
        self._count += 1
        return reading
