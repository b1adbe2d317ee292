"""What the laws share that keep the mean of a joint's two pressures and command their difference.

The mean pressure determines the stiffness. These laws ignore stiffness commands.
"""

from __future__ import annotations

from abc import abstractmethod

from pam_control.control_step import PlanRequest
from pam_control.controller import Controller
from pam_control.feedback.kept_designs import KeptDesigns
from pam_control.feedback.linear_joint import LoopStructure
from pam_control.feedback.margins import LoopCase
from pam_control.feedback.operating_points import POSITION_SHARES, operating_point
from pam_control.joint_channel import JointChannel, Pair
from pam_control.settings import ControlSettings
from pam_model.rig import Rig

LEAST_MEAN_PRESSURE = 1e3  # Pa; below it the ratio is not meaningful
MEAN_PRESSURE_TIME = 0.5  # s, rise from 0 to the mean pressure
RATIO_STEPS = 60


def ratio_at_rest(channel: JointChannel, position: float, mean: float) -> float | None:
    """The ratio that holds the joint at rest, by bisection; None if there is none.

    Parameters
    ----------
    channel : JointChannel
        Models of the joint.
    position : float
        [rad].
    mean : float
        Mean of the two pressures, which are mean (1 + ratio) and mean (1 - ratio) [Pa gauge].
    """
    torque = channel.dynamics.gravity(position)

    def excess(u: float) -> float:
        pressures = (mean * (1.0 + u), mean * (1.0 - u))
        return channel.model.torque(*pressures, position) - torque

    low, high = -1.0, 1.0
    if excess(low) > 0.0 or excess(high) < 0.0:
        return None
    for _ in range(RATIO_STEPS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) < 0.0 else (low, middle)
    return low


class MeanPressureLaw(Controller):
    """Base of the laws that keep the mean pressure; it rises or sinks slowly to its setting."""

    def __init__(
        self, rig: Rig, settings: ControlSettings, designs: KeptDesigns | None = None
    ) -> None:
        self._mean: list[float] = []
        super().__init__(rig, settings, designs)

    @abstractmethod
    def structure(self, channel: JointChannel, settings: ControlSettings) -> LoopStructure:
        """How the law's output is connected to the pressure loops of a joint."""

    def cases(self, channel: JointChannel, settings: ControlSettings) -> list[LoopCase]:
        """The loops over the part of the range in which this mean pressure can hold the joint."""
        mean = settings.mean_pressure
        lower, upper = channel.joint.position_limits
        found = []
        for share in POSITION_SHARES:
            position = lower + share * (upper - lower)
            ratio = ratio_at_rest(channel, position, mean)
            if ratio is None:
                continue
            pressures = (mean * (1.0 + ratio), mean * (1.0 - ratio))
            point = operating_point(channel.joint, channel.model, position, pressures)
            found.append(LoopCase(point, self.structure(channel, settings)))
        return found

    def begin_mean(self, index: int, pressures: Pair) -> float:
        """Start from the mean of the measured pressures [Pa]; return it."""
        mean = max(0.5 * (pressures[0] + pressures[1]), LEAST_MEAN_PRESSURE)
        if len(self._mean) != len(self.channels):
            self._mean = [mean] * len(self.channels)
        self._mean[index] = mean
        return mean

    def next_mean(self, request: PlanRequest) -> float:
        """The mean pressure of this cycle [Pa]."""
        goal = self.settings.mean_pressure
        reach = goal * request.step / MEAN_PRESSURE_TIME
        mean = self._mean[request.index]
        mean += max(-reach, min(reach, goal - mean))
        self._mean[request.index] = mean
        return mean

    @staticmethod
    def tell(channel: JointChannel, pressures: Pair, clipped: bool) -> None:
        """Fill the law's part of the telemetry from the desired pressures [Pa]."""
        telemetry, position = channel.telemetry, channel.inside(channel.position)
        telemetry.torque = telemetry.torque_reached = channel.model.torque(*pressures, position)
        telemetry.stiffness = telemetry.stiffness_reached = channel.model.stiffness(
            *pressures, position
        )
        telemetry.clipped = ("torque",) if clipped else ()


def widest_difference(channel: JointChannel, mean: float) -> float:
    """Largest half difference of the pressures at this mean [Pa]."""
    highest = min(channel.model.agonist.high_pressure, channel.model.antagonist.high_pressure)
    return min(mean, max(highest - mean, 0.0))
