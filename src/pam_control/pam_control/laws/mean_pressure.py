"""What the laws share that keep the mean of a joint's two pressures and command their difference.

The mean pressure determines the stiffness. These laws ignore stiffness commands.

When a law takes over a joint, the mean rises from the measured one to its setting. Two unequal
muscles, or two equal ones away from the middle of the range, would turn the joint if only the mean
changed, and a ratio that was measured at low pressures would turn it far. Therefore the difference
changes with the mean such that the torque stays the same at the position of the take-over. This
slope is the only thing these laws take from the joint's model while they run.
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
from pam_control.limited import limited
from pam_control.settings import ControlSettings
from pam_model.rig import Rig

LEAST_MEAN_PRESSURE = 1e3  # Pa; below it the ratio is not meaningful
MEAN_PRESSURE_TIME = 0.5  # s, rise from 0 to the mean pressure
RATIO_STEPS = 60


def ratio_for_torque(
    channel: JointChannel, position: float, mean: float, torque: float
) -> float | None:
    """The ratio that gives a torque, by bisection; None if there is none.

    Parameters
    ----------
    channel : JointChannel
        Models of the joint.
    position : float
        [rad].
    mean : float
        Mean of the two pressures, which are mean (1 + ratio) and mean (1 - ratio) [Pa gauge].
    torque : float
        [N m].
    """

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


def ratio_at_rest(channel: JointChannel, position: float, mean: float) -> float | None:
    """The ratio that holds the joint at rest at this mean pressure [Pa gauge] or None."""
    return ratio_for_torque(channel, position, mean, channel.dynamics.gravity(position))


class MeanPressureLaw(Controller):
    """Base of the laws that keep the mean pressure; it rises or sinks slowly to its setting."""

    def __init__(
        self, rig: Rig, settings: ControlSettings, designs: KeptDesigns | None = None
    ) -> None:
        self._mean: list[float] = []
        # change of half the difference per change of the mean, by which the torque is kept
        self._balance: list[float] = []
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

    def begin_mean(self, index: int, channel: JointChannel, position: float, now: Pair) -> float:
        """Start from the mean of two pressures at a position.

        Parameters
        ----------
        index : int
            Of the joint.
        channel : JointChannel
            Its models.
        position : float
            [rad].
        now : (float, float)
            Gauge pressures of agonist and antagonist [Pa].

        Returns
        -------
        float
            The mean [Pa gauge].
        """
        mean = max(0.5 * (now[0] + now[1]), LEAST_MEAN_PRESSURE)
        if len(self._mean) != len(self.channels):
            self._mean = [mean] * len(self.channels)
            self._balance = [0.0] * len(self.channels)
        self._mean[index] = mean
        self._balance[index] = difference_per_mean(
            channel, position, now, self.settings.mean_pressure
        )
        return mean

    def mean(self, index: int) -> float:
        """The present mean pressure of a joint [Pa gauge]."""
        return self._mean[index]

    def next_mean(self, request: PlanRequest) -> tuple[float, float]:
        """The mean pressure of this cycle and the difference's share in its change.

        Returns
        -------
        mean : float
            [Pa gauge].
        balance : float
            By how much half the difference has to change in this cycle, so that the change of the
            mean leaves the torque as it is [Pa].
        """
        goal = self.settings.mean_pressure
        reach = goal * request.step / MEAN_PRESSURE_TIME
        change = limited(goal - self._mean[request.index], -reach, reach)
        self._mean[request.index] += change
        return self._mean[request.index], self._balance[request.index] * change

    @staticmethod
    def tell(channel: JointChannel, pressures: Pair, clipped: bool) -> None:
        """Fill the law's part of the telemetry from the desired pressures [Pa]."""
        telemetry, position = channel.telemetry, channel.inside(channel.position)
        telemetry.torque = telemetry.torque_reached = channel.model.torque(*pressures, position)
        telemetry.stiffness = telemetry.stiffness_reached = channel.model.stiffness(
            *pressures, position
        )
        telemetry.clipped = ("torque",) if clipped else ()


def difference_per_mean(
    channel: JointChannel, position: float, pressures: Pair, goal: float
) -> float:
    """Change of half the difference per change of the mean on a way that keeps the torque.

    It is the secant between the present pressures and those that give the same torque at the new
    mean: a derivative would be useless at slack muscles, which have no torque to keep.

    Parameters
    ----------
    channel : JointChannel
        Models of the joint.
    position : float
        [rad].
    pressures : (float, float)
        Gauge pressures of agonist and antagonist [Pa].
    goal : float
        The new mean [Pa gauge].

    Returns
    -------
    float
        From -1 to 1; 0 if no difference gives this torque at the new mean.
    """
    angle = channel.inside(position)
    torque = channel.model.torque(*pressures, angle)
    ratio = ratio_for_torque(channel, angle, goal, torque)
    rise = goal - 0.5 * (pressures[0] + pressures[1])
    if ratio is None or rise == 0.0:
        return 0.0
    return limited((ratio * goal - 0.5 * (pressures[0] - pressures[1])) / rise, -1.0, 1.0)


def widest_difference(channel: JointChannel, mean: float) -> float:
    """Largest half difference of the pressures at this mean [Pa]."""
    highest = min(channel.model.agonist.high_pressure, channel.model.antagonist.high_pressure)
    return min(mean, max(highest - mean, 0.0))
