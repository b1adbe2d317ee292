"""Whether a joint is too fast, or would become too fast although the driver stops now.

The air in the muscles is a spring: it drives the joint on when the valves have shut. A joint with
the speed v and the acceleration a, on a spring with the natural frequency w, is fastest where the
acceleration vanishes; its energy there gives the peak speed

    v_peak = sqrt(v^2 + (a/w)^2)

which friction only makes smaller; `pam_model.views.shut_spring` gives a/w. Until a stop acts, a may
grow by the factor `_GROWTH`. The acceleration is measured, so that payloads and friction are
contained in it.

Close to its position limits a joint may meet an end stop, which is no spring: there only the
measured speed counts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from pam_driver.boards.protocol import Condition
from pam_driver.joint_velocity import JointVelocity
from pam_model.errors import PamError
from pam_model.joints.sensor_correction import SensorCorrection
from pam_model.robot import Robot, RobotJoint
from pam_model.views.shut_spring import driven_speed

# The speed must stay above the limit for so long, in one direction: a single outlier of the encoder
# that is too small to be a fault of its own (`position_jump`) leaves the low pass after 8 ms.
LASTS: Final = 0.008  # s
END_STOP: Final = 0.03  # rad; closer to a limit, the end stop may carry torque
# The torque may grow by so much until the valves of a stop act, some 20 ms after it was measured.
_GROWTH: Final = 1.25
_BANDWIDTH: Final = 40.0  # Hz, of the measured acceleration
_LONGEST_GAP: Final = 0.05  # s between samples; after a longer one the acceleration is unknown


class _JointOnAir:
    """One joint: the speed to which its air can drive it."""

    def __init__(self, robot: Robot, joint: RobotJoint) -> None:
        self.robot, self.joint = robot, joint
        self._acceleration = JointVelocity(_BANDWIDTH, _LONGEST_GAP)

    def accelerates(self, velocity: float, time: float) -> float:
        """The acceleration [rad/s^2] after a velocity [rad/s] measured at a time [s]."""
        if not math.isfinite(velocity):
            self._acceleration.reset()
            return 0.0
        return self._acceleration.update(velocity, time)

    def driven_speed(
        self, acceleration: float, pressures: Sequence[float], positions: Sequence[float]
    ) -> float:
        """The speed that the present torque can add [rad/s]; 0 where there is no spring."""
        low, high = self.joint.position_limits
        if not low + END_STOP < positions[self.joint.place] < high - END_STOP:
            return 0.0
        try:
            return _GROWTH * driven_speed(
                self.robot, self.joint, acceleration, pressures, positions
            )
        except PamError:
            return 0.0


class JointSpeedWatch:
    """Compares the speeds of a rig's joints, now and soon, with `max_velocity`.

    Parameters
    ----------
    robot : Robot
        Gives the limits, and the models of muscles and joints.
    """

    def __init__(self, robot: Robot) -> None:
        self._correction = SensorCorrection(robot)
        self._joints = tuple(_JointOnAir(robot, joint) for joint in robot.joints)
        self._since = [math.inf] * len(robot.joints)
        self._signs = [0.0] * len(robot.joints)
        self._texts = [""] * len(robot.joints)

    def update(
        self,
        pressures: Sequence[float],
        positions: Sequence[float],
        velocities: Sequence[float],
        times: Sequence[float],
        now: float,
        slow: bool = False,
    ) -> None:
        """Take the measurements of one cycle; NaN where unknown.

        Parameters
        ----------
        pressures : sequence of float
            By muscle [Pa gauge].
        positions, velocities, times : sequence of float
            By joint: angle [rad], speed [rad/s], and when the angle was measured, monotonic [s].
        now : float
            Monotonic time [s].
        slow : bool, optional
            Whether the joints must keep their `reduced_velocity`. Only the measured speed is
            compared with it: the air cannot drive a joint above `max_velocity` in any case.
        """
        pressures = self._correction.pressures(pressures)
        positions = self._correction.positions(positions)
        for index, (joint, velocity) in enumerate(zip(self._joints, velocities, strict=True)):
            acceleration = joint.accelerates(velocity, times[index])
            driven = joint.driven_speed(acceleration, pressures, positions)
            limit = joint.joint.max_velocity
            reduced = min(joint.joint.reduced_velocity, limit) if slow else limit
            if abs(velocity) > reduced:
                sign = math.copysign(1.0, velocity)
                text = f"at {abs(velocity):.2f} rad/s, max_velocity is {limit:g} rad/s"
                if reduced < limit:
                    text = (
                        f"at {abs(velocity):.2f} rad/s, reduced_velocity is {reduced:g} rad/s and "
                        "full speed is not permitted"
                    )
            elif math.hypot(velocity, driven) > limit:
                sign = math.copysign(2.0, acceleration)
                text = (
                    f"at {velocity:+.2f} rad/s and {acceleration:+.0f} rad/s^2, from where the air "
                    f"in the muscles can drive it to {math.hypot(velocity, driven):.2f} rad/s, "
                    f"max_velocity is {limit:g} rad/s"
                )
            else:
                sign, text = 0.0, ""
            if sign == 0.0 or sign * self._signs[index] < 0.0:
                self._since[index] = math.inf if sign == 0.0 else now
            elif self._since[index] == math.inf:
                self._since[index] = now
            self._signs[index], self._texts[index] = sign, text

    def conditions(self, now: float) -> Iterator[Condition]:
        """One condition for each joint that has been too fast for `LASTS`."""
        for joint, since, text in zip(self._joints, self._since, self._texts, strict=True):
            if now - since >= LASTS - 1e-9:
                yield Condition("joint_too_fast", joint.joint.name, text)
