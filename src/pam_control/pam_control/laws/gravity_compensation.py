"""Gravity compensation: the joint is moved by hand, carries its weight, and stays where it is put.

The joint is a spring about a rest angle (`impedance`), and the rest angle follows it: once the
spring's torque is above `float.hold_torque`, with the speed

    rest' = (q - rest -+ hold/K)/T

limited to `float.speed_limit`. A hand feels the hold torque, as of dry friction, and a damper K T.
A load that the rig file does not contain is held up to the hold torque; a heavier one lets the
joint sink no faster than the limit. Trajectories and streamed references are refused: the hand is
the only source of motion. `~/stop` holds the joint until the driver is activated again.

Source: the rest angle with a dead zone is an admittance (Keemink, van der Kooij, Stienen,
Admittance control for physical human-robot interaction, Int. J. Robotics Research 37 (2018)).
"""

from __future__ import annotations

import math
from typing import Final

from pam_control.control_step import ControlOutput, Measurement
from pam_control.feedback.kept_designs import KeptDesigns
from pam_control.joint_channel import JointChannel, Pair
from pam_control.laws.impedance import ImpedanceController
from pam_control.settings import ControlSettings
from pam_model.rig import Rig

FOLLOWING_TIME: Final = 0.1  # s, T
LONGEST_STEP: Final = 0.02  # s


class GravityCompensation(ImpedanceController):
    """The law of the module's docstring."""

    def __init__(
        self, rig: Rig, settings: ControlSettings, designs: KeptDesigns | None = None
    ) -> None:
        self._rest = [math.nan] * len(rig.joints)
        self._held = False
        super().__init__(rig, settings, designs)

    def reason_against_motion(self) -> str:
        """Nothing but a hand moves the joints."""
        return "law gravity_compensation: the joints are moved by hand"

    def stop(self, now: float) -> None:
        """Brake all joints and hold them; the hand moves them again after a new activation."""
        self._held = True
        super().stop(now)

    def lower(self, now: float) -> None:
        """Brake all joints, let their air out slowly, then stop."""
        self._held = True
        super().lower(now)

    def _begin(self, index: int, channel: JointChannel, position: float, pressures: Pair) -> None:
        super()._begin(index, channel, position, pressures)
        self._rest[index] = channel.inside(position)
        if not self.active:
            self._held = False

    def step(self, time: float, measurement: Measurement) -> ControlOutput:
        """One control cycle."""
        if self.active and not self._held:
            self._follow(min(max(time - self._time, 0.0), LONGEST_STEP))
        return super().step(time, measurement)

    def _follow(self, step: float) -> None:
        """Let the rest angles follow the hand for a step [s]."""
        fastest = self.settings.float_speed_limit
        for index, channel in enumerate(self.channels):
            stiffness = channel.telemetry.stiffness
            if math.isnan(channel.position) or not stiffness > 0.0:
                continue
            gap = channel.position - self._rest[index]
            held = channel.scale.complete(self.settings).float_hold_torque / stiffness
            beyond = math.copysign(max(abs(gap) - held, 0.0), gap)
            speed = max(-fastest, min(fastest, beyond / FOLLOWING_TIME))
            lower, upper = channel.joint.position_limits
            self._rest[index] = max(lower, min(upper, self._rest[index] + speed * step))
            self.references.lead(channel.joint.name, self._rest[index])
