"""The usual law, for comparison: a PID on position sets the ratio of the two pressures.

p_agonist = p0 (1 + u), p_antagonist = p0 (1 - u), u in [-1, 1]; the mean pressure p0 determines the
stiffness. The law has the same pressure loops, delays and gain design as the model-based law. It
uses no model of the joint except in the design of its gains and while the mean pressure changes.
"""

from __future__ import annotations

from pam_control.control_step import PlanRequest, PressurePlan
from pam_control.feedback.linear_joint import LoopStructure
from pam_control.joint_channel import JointChannel, Pair
from pam_control.laws.mean_pressure import MeanPressureLaw, widest_difference
from pam_control.settings import BY_SIZE, ControlSettings

WHOLE_RATIO = 10.0  # beyond any ratio, which is at most 1


class PressureRatioPid(MeanPressureLaw):
    """The pressure-ratio law; see the module's docstring. It ignores stiffness commands."""

    def structure(self, channel: JointChannel, settings: ControlSettings) -> LoopStructure:
        """The output is the ratio; the gas loops use the measured velocity."""
        mean = settings.mean_pressure
        return LoopStructure(settings.pressure_gain or 0.0, (mean, -mean), measured_velocity=True)

    def _begin(self, index: int, channel: JointChannel, position: float, pressures: Pair) -> None:
        mean = self.begin_mean(index, channel, position, pressures)
        ratio = 0.5 * (pressures[0] - pressures[1]) / mean
        channel.pid.reset(max(-1.0, min(1.0, ratio)))

    def _integral_limit(self, channel: JointChannel) -> float:
        given = self.settings.integral_limit
        return WHOLE_RATIO if given == BY_SIZE else given

    def _plan(self, request: PlanRequest) -> PressurePlan:
        channel = request.channel
        before = self.mean(request.index)
        mean, balance = self.next_mean(request)
        held = channel.pid.integral
        channel.pid.integral = (held * before + balance) / mean
        wanted = request.output + channel.pid.integral - held
        widest = widest_difference(channel, mean) / mean
        ratio = max(-widest, min(widest, wanted))
        pressures = (mean * (1.0 + ratio), mean * (1.0 - ratio))
        self.tell(channel, pressures, ratio != wanted)
        still = (0.0, 0.0)
        velocities = (channel.velocity, channel.velocity)
        return PressurePlan(pressures, still, still, velocities, ratio - wanted)
