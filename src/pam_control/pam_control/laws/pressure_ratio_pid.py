"""The usual law, for comparison: a PID on position sets the ratio of the two pressures.

p_agonist = p0 (1 + u), p_antagonist = p0 (1 - u), u in [-1, 1]; the mean pressure p0 determines the
stiffness. The law has the same pressure loops, delays and gain design as the model-based law. It
uses no model of the joint except in the design of its gains.
"""

from __future__ import annotations

from pam_control.control_step import PlanRequest, PressurePlan
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


class PressureRatioPid(Controller):
    """The pressure-ratio law; see the module's docstring. It ignores stiffness commands."""

    def __init__(
        self, rig: Rig, settings: ControlSettings, designs: KeptDesigns | None = None
    ) -> None:
        self._mean: list[float] = []
        super().__init__(rig, settings, designs)

    def _ratio_at_rest(self, channel: JointChannel, position: float, mean: float) -> float | None:
        """The ratio that holds the joint at rest, by bisection; None if there is none."""
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

    def cases(self, channel: JointChannel, settings: ControlSettings) -> list[LoopCase]:
        """The loops over the part of the range in which this mean pressure can hold the joint."""
        mean, gain = settings.mean_pressure, settings.pressure_gain or 0.0
        lower, upper = channel.joint.position_limits
        found = []
        for share in POSITION_SHARES:
            position = lower + share * (upper - lower)
            ratio = self._ratio_at_rest(channel, position, mean)
            if ratio is None:
                continue
            pressures = (mean * (1.0 + ratio), mean * (1.0 - ratio))
            point = operating_point(channel.joint, channel.model, position, pressures)
            structure = LoopStructure(gain, (mean, -mean), measured_velocity=True)
            found.append(LoopCase(point, structure))
        return found

    def _begin(self, index: int, channel: JointChannel, position: float, pressures: Pair) -> None:
        mean = max(0.5 * (pressures[0] + pressures[1]), LEAST_MEAN_PRESSURE)
        if len(self._mean) != len(self.channels):
            self._mean = [mean] * len(self.channels)
        self._mean[index] = mean
        ratio = 0.5 * (pressures[0] - pressures[1]) / mean
        channel.pid.reset(max(-1.0, min(1.0, ratio)))

    def _plan(self, request: PlanRequest) -> PressurePlan:
        channel = request.channel
        goal = self.settings.mean_pressure
        reach = goal * request.step / MEAN_PRESSURE_TIME
        mean = self._mean[request.index]
        mean += max(-reach, min(reach, goal - mean))
        self._mean[request.index] = mean
        highest = min(muscle.max_pressure for muscle in channel.muscles)
        widest = min(1.0, max(highest / mean - 1.0, 0.0))
        ratio = max(-widest, min(widest, request.output))
        pressures = (mean * (1.0 + ratio), mean * (1.0 - ratio))
        telemetry, position = channel.telemetry, channel.inside(channel.position)
        telemetry.torque = telemetry.torque_reached = channel.model.torque(*pressures, position)
        telemetry.stiffness = telemetry.stiffness_reached = channel.model.stiffness(
            *pressures, position
        )
        telemetry.clipped = ("torque",) if ratio != request.output else ()
        still = (0.0, 0.0)
        velocities = (channel.velocity, channel.velocity)
        return PressurePlan(pressures, still, still, velocities, ratio - request.output)
