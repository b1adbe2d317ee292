"""What a control step costs, counted in calls, because times depend on the machine."""

import cProfile
import math
import pstats

from pam_control.control_step import Measurement
from pam_control.laws.position_stiffness import PositionStiffnessController
from pam_control.settings import ControlSettings

PERIOD = 0.002
CYCLES = 250
MOST = 650
"""Calls in one cycle of one joint on average, those of built-in functions included. There were 523
when this was written, and 809 before the cycle was made cheaper."""


def test_a_cycle_of_one_joint_makes_few_calls(rig):
    """With all that is learnt, while the joint follows a stream."""
    controller = PositionStiffnessController(rig, ControlSettings())
    profile, now = cProfile.Profile(), 1.0
    for cycle in range(CYCLES + 50):
        now += PERIOD
        position = 0.3 * math.sin(2.0 * now)
        if cycle % 5 == 0 and controller.active:
            aim = 0.3 * math.sin(2.0 * (now + 0.01))
            controller.references.stream(rig.joint_names, [aim], (), now=now)
        stamp = now - PERIOD
        seen = Measurement([position], [2e5 + 1e4 * position] * 2, stamp, stamp)
        if cycle >= 50:
            profile.enable()
        output = controller.step(now, seen)
        profile.disable()
        assert output.commands is not None, output.reason
    calls = pstats.Stats(profile).total_calls
    assert calls / CYCLES < MOST
