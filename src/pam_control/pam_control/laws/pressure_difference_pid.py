"""PID on the pressure difference with a static feedforward: the baseline of a well-tuned joint.

p_agonist = p0 + d, p_antagonist = p0 - d with half the pressure difference

d = f(reference) + s PID(error),    f = c0 + c1 q + c2 q^3 + c3 qd + c4 qdd

The PID's output is a torque; s [Pa/(N m)] is the joint's pressure difference per torque in the
middle of its range, so that its gains have the same units as those of the model-based law. The
feedforward is a fixed polynomial of the reference. Its coefficients come from the rig file unless
they are given, for example because somebody has fitted them to the real joint.

Without the feedforward the integral has to hold the muscles' own stiffness as well: then the limit
of the integral must be larger.

The law has the same pressure loops, delays and gain design as the other laws.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pam_control.control_step import PlanRequest, PressurePlan
from pam_control.feedback.kept_designs import KeptDesigns
from pam_control.feedback.linear_joint import LoopStructure
from pam_control.feedback.operating_points import operating_point
from pam_control.joint_channel import JointChannel, Pair
from pam_control.laws.mean_pressure import MeanPressureLaw, ratio_at_rest, widest_difference
from pam_control.references.spline import JointReference
from pam_control.settings import ControlSettings
from pam_model.rig import Rig

FIT_POSITIONS = 21


@dataclass(frozen=True, slots=True)
class DifferenceFeedforward:
    """Half the pressure difference [Pa] as a polynomial of the reference.

    Attributes
    ----------
    offset, position, cubic : float
        c0 [Pa], c1 [Pa/rad], c2 [Pa/rad^3].
    velocity, acceleration : float
        c3 [Pa s/rad], c4 [Pa s^2/rad].
    """

    offset: float
    position: float
    cubic: float
    velocity: float
    acceleration: float

    def at(self, reference: JointReference) -> float:
        """Half the pressure difference [Pa] for a reference."""
        q = reference.position
        return (
            self.offset
            + q * (self.position + self.cubic * q * q)
            + self.velocity * reference.velocity
            + self.acceleration * reference.acceleration
        )

    def rate(self, reference: JointReference) -> float:
        """Its rate of change [Pa/s], without the part of the jerk."""
        q = reference.position
        return (
            self.position + 3.0 * self.cubic * q * q
        ) * reference.velocity + self.velocity * reference.acceleration


NO_FEEDFORWARD = DifferenceFeedforward(0.0, 0.0, 0.0, 0.0, 0.0)


def difference_per_torque(channel: JointChannel, mean: float) -> float:
    """Half the pressure difference per torque in the middle of the range [Pa/(N m)]."""
    middle = 0.5 * sum(channel.joint.position_limits)
    point = operating_point(channel.joint, channel.model, middle, (mean, mean))
    return 1.0 / (point.torque_slopes[0] - point.torque_slopes[1])


def nominal_feedforward(channel: JointChannel, mean: float) -> DifferenceFeedforward:
    """The feedforward of a joint that is as its rig file says, at this mean pressure [Pa]."""
    lower, upper = channel.joint.position_limits
    positions, differences = [], []
    for position in np.linspace(lower, upper, FIT_POSITIONS).tolist():
        ratio = ratio_at_rest(channel, position, mean)
        if ratio is not None:
            positions.append(position)
            differences.append(mean * ratio)
    q = np.array(positions)
    basis = np.stack([np.ones_like(q), q, q**3], axis=1)
    offset, slope, cubic = np.linalg.lstsq(basis, np.array(differences), rcond=None)[0].tolist()
    scale = difference_per_torque(channel, mean)
    dynamics = channel.dynamics
    return DifferenceFeedforward(
        offset, slope, cubic, scale * dynamics.viscous_friction, scale * dynamics.inertia
    )


class PressureDifferencePid(MeanPressureLaw):
    """The law of the module's docstring. It ignores stiffness commands."""

    def __init__(
        self, rig: Rig, settings: ControlSettings, designs: KeptDesigns | None = None
    ) -> None:
        # by joint and mean pressure; filled by the design, because the fit takes milliseconds
        self._scales: dict[tuple[str, float], float] = {}
        self._fitted: dict[tuple[str, float], DifferenceFeedforward] = {}
        super().__init__(rig, settings, designs)

    def structure(self, channel: JointChannel, settings: ControlSettings) -> LoopStructure:
        """The output is a torque, which a fixed scale turns into a pressure difference."""
        mean = settings.mean_pressure
        key = (channel.joint.name, mean)
        if key not in self._scales:
            self._fitted[key] = nominal_feedforward(channel, mean)
            self._scales[key] = difference_per_torque(channel, mean)
        scale = self._scales[key]
        return LoopStructure(
            settings.pressure_gain or 0.0,
            (scale, -scale),
            measured_velocity=not settings.feedforward,
        )

    def feedforward(self, joint: str) -> DifferenceFeedforward:
        """The feedforward of a joint with the present settings."""
        if not self.settings.feedforward:
            return NO_FEEDFORWARD
        given = self.settings.difference_feedforward.get(joint)
        if given is not None:
            return DifferenceFeedforward(*given)
        return self._fitted[joint, self.settings.mean_pressure]

    def _scale(self, channel: JointChannel) -> float:
        return self._scales[channel.joint.name, self.settings.mean_pressure]

    def _begin(self, index: int, channel: JointChannel, position: float, pressures: Pair) -> None:
        self.begin_mean(index, channel, position, pressures)
        held = self.feedforward(channel.joint.name).at(JointReference(position))
        difference = 0.5 * (pressures[0] - pressures[1])
        channel.pid.reset((difference - held) / self._scale(channel))

    def _continue(self, index: int, channel: JointChannel) -> None:
        gains, telemetry = self._gains(channel), channel.telemetry
        self.begin_mean(index, channel, channel.position, channel.desired)
        given = self.feedforward(channel.joint.name).at(telemetry.reference)
        difference = 0.5 * (channel.desired[0] - channel.desired[1])
        output = (difference - given) / self._scale(channel)
        channel.pid.continue_at(output, telemetry.error, gains)

    def _plan(self, request: PlanRequest) -> PressurePlan:
        channel, now, then = request.channel, request.now, request.then
        feedforward, scale = self.feedforward(channel.joint.name), self._scale(channel)
        mean, balance = self.next_mean(request)
        channel.pid.integral += balance / scale
        widest = widest_difference(channel, mean)
        wanted = feedforward.at(now) + scale * request.output + balance
        difference = max(-widest, min(widest, wanted))
        pressures = (mean + difference, mean - difference)
        self.tell(channel, pressures, difference != wanted)
        ahead, rate = feedforward.at(then) - feedforward.at(now), feedforward.rate(then)
        measured = (channel.velocity, channel.velocity)
        velocities = request.side_velocities if self.settings.feedforward else measured
        missed = (difference - wanted) / scale
        return PressurePlan(pressures, (rate, -rate), (ahead, -ahead), velocities, missed)
