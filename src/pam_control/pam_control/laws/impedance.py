"""Impedance: the joint is a spring and a damper about its reference.

With the reference q_r, the measured angle q and the commanded stiffness K, an outside torque T that
lasts deflects the joint by T/K. The muscles are that spring: their pressures give the torque of the
reference's motion and the stiffness K at the reference, so that the spring acts without delay and
cannot oscillate by itself. The feedback adds only what they lack,

    u = (K - K_m)(q_r - q) + g(q) - g(q_r) + D (q_r' - q')

where K_m is the stiffness that they reach and g gravity, none of which the spring carries. There
is no integral, nothing is learnt, and there is no limit of the tracking error: a joint that
somebody pushes away is no fault. K - K_m and D are at most the gains that the position law has,
which keep its margins.

Source: N. Hogan, Impedance control, J. Dyn. Sys. Meas. Control 107 (1985), equations 1 to 3 of part
I; the muscles as the spring are this suite's.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Final

from pam_control.control_step import PlanRequest, PressurePlan
from pam_control.feedback.kept_designs import KeptDesigns
from pam_control.joint_channel import JointChannel, Pair
from pam_control.laws.position_stiffness import PositionStiffnessController
from pam_control.settings import ControlSettings
from pam_model.rig import Rig

START_TIME: Final = 0.3  # s, in which the torque at the take-over passes into that of the law


class ImpedanceController(PositionStiffnessController):
    """The law of the module's docstring."""

    has_observer = False
    has_adaptation = False
    has_lead = False

    def __init__(
        self, rig: Rig, settings: ControlSettings, designs: KeptDesigns | None = None
    ) -> None:
        self._start = [0.0] * len(rig.joints)
        super().__init__(rig, settings, designs)
        for channel in self.channels:
            channel.yields = True

    def _begin(self, index: int, channel: JointChannel, position: float, pressures: Pair) -> None:
        super()._begin(index, channel, position, pressures)
        self._start[index] = channel.pid.integral

    def _continue(self, index: int, channel: JointChannel) -> None:
        self._begin(index, channel, channel.position, channel.desired)

    def _spring(self, request: PlanRequest) -> float:
        """What the feedback adds to the muscles [N m]."""
        channel = request.channel
        gains = self._gains(channel)
        position, seen = channel.inside(channel.position), request.seen
        lacking = 0.0
        if not math.isnan(channel.telemetry.stiffness_reached):
            lacking = channel.telemetry.stiffness - channel.telemetry.stiffness_reached
        lacking = max(-gains.proportional, min(gains.proportional, lacking))
        damping = min(channel.scale.complete(self.settings).impedance_damping, gains.derivative)
        gravity = channel.dynamics.gravity
        return (
            lacking * (seen.position - position)
            + gravity(position)
            - gravity(seen.position)
            + damping * (seen.velocity - channel.velocity)
        )

    def _plan(self, request: PlanRequest) -> PressurePlan:
        index = request.index
        self._start[index] *= 1.0 - min(request.step / START_TIME, 1.0)
        # the PID's own state is not used; it would integrate while somebody holds the joint
        request.channel.pid.reset(0.0)
        output = self._start[index] + self._spring(request)
        plan = super()._plan(dataclasses.replace(request, output=output))
        return dataclasses.replace(plan, missed=0.0)
