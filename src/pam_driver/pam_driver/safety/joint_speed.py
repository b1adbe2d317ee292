"""Whether a joint is measured to be faster than its rig file permits."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from pam_driver.boards.protocol import Condition
from pam_model.rig import Rig

# The speed must stay above the limit for so long: a single outlier of the encoder that is too small
# to be a fault of its own (`position_jump`) leaves the velocity's low pass after 8 ms.
LASTS: Final = 0.008  # s


class JointSpeedWatch:
    """Compares the measured speeds of a rig's joints with `max_velocity`.

    Parameters
    ----------
    rig : Rig
        Gives the limits.
    """

    def __init__(self, rig: Rig) -> None:
        self._joints = rig.joints
        self._since = [math.inf] * len(rig.joints)
        self._speeds: Sequence[float] = (0.0,) * len(rig.joints)

    def update(self, velocities: Sequence[float], now: float) -> None:
        """Take the velocities of one cycle [rad/s], by joint; NaN if unknown."""
        self._speeds = [abs(velocity) for velocity in velocities]
        for index, (joint, speed) in enumerate(zip(self._joints, self._speeds, strict=True)):
            if not speed > joint.max_velocity:
                self._since[index] = math.inf
            elif self._since[index] == math.inf:
                self._since[index] = now

    def conditions(self, now: float) -> Iterator[Condition]:
        """One condition for each joint that has been too fast for `LASTS`."""
        for joint, since, speed in zip(self._joints, self._since, self._speeds, strict=True):
            if now - since >= LASTS - 1e-9:
                text = f"at {speed:.2f} rad/s, max_velocity is {joint.max_velocity:g} rad/s"
                yield Condition("joint_too_fast", joint.name, text)
