"""What the valves of a joint can drive limits a reference that asks for more."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from pam_control.joint_channel import JointChannel
from pam_control.references.motion_limiter import MotionLimiter, MotionLimits
from pam_control.references.spline import JointReference
from pam_control.valve_limits import drivable_motion
from pam_model.rig import Rig

STIFFNESS = 14.0


def drivable(rig: Rig) -> tuple[float, float]:
    return drivable_motion(rig, JointChannel(rig, rig.joints[0], 1e4), STIFFNESS)


def with_valves(rig: Rig, share: float) -> Rig:
    for muscle in rig.muscles:
        size = share * muscle.valve.sonic_conductance
        valve = dataclasses.replace(muscle.valve, sonic_conductance=size)
        rig = rig.with_muscle(dataclasses.replace(muscle, valve=valve))
    return rig


def test_valves_of_twice_the_size_drive_twice_the_speed_and_acceleration(rig: Rig) -> None:
    acceleration, velocity = drivable(rig)
    assert drivable(with_valves(rig, 2.0)) == pytest.approx((2.0 * acceleration, 2.0 * velocity))


def test_a_heavier_joint_accelerates_less_and_moves_as_fast(rig: Rig) -> None:
    joint = rig.joints[0]
    heavy = rig.with_joint(dataclasses.replace(joint, inertia=4.0 * joint.inertia))
    acceleration, velocity = drivable(rig)
    assert drivable(heavy) == pytest.approx((0.5 * acceleration, velocity))


def follow(limits: MotionLimits, target: JointReference, duration: float) -> np.ndarray:
    """Velocities of a limiter that follows a constant target, a row every 2 ms."""
    limiter = MotionLimiter(limits, (-2.0, 2.0))
    limiter.reset(0.0)
    rows = []
    for step in range(round(duration / 0.002)):
        limiter.advance(step * 0.002, lambda _: target)
        rows.append(limiter.state.velocity)
    return np.array(rows)


def test_a_jump_is_followed_on_the_line_of_the_valves() -> None:
    limits = MotionLimits(3.6, 200.0, 80.0, 3.0)
    speeds = follow(limits, JointReference(1.5), 1.0)
    gained = np.diff(speeds) / 0.002
    assert gained.max() == pytest.approx(80.0, rel=0.01)
    line = 80.0 * np.maximum(1.0 - speeds[:-1] / 3.0, 0.05)
    assert (gained <= 1.01 * line).all()
    assert gained.min() > -200.0
    assert speeds[-1] == pytest.approx(0.0, abs=1e-3)


def test_a_reference_that_keeps_the_limits_of_the_rig_file_passes_unchanged() -> None:
    """The valves limit what the limiter does itself, not what a user has planned."""
    limits = MotionLimits(3.6, 200.0, 80.0, 3.0)
    limiter = MotionLimiter(limits, (-2.0, 2.0))
    limiter.reset(0.09)
    turn = 2.0 * math.pi * 6.0

    def swing(time: float) -> JointReference:
        """From rest, with up to 128 rad/s^2 and 3.4 rad/s, beyond what the valves can drive."""
        ease = min(time / 0.5, 1.0)
        turned = turn * (0.5 * ease * ease * 0.5 + max(time - 0.5, 0.0))
        rate = turn * ease
        slope = turn / 0.5 if time < 0.5 else 0.0
        wave, slant = math.cos(turned), math.sin(turned)
        speed, gain = -0.09 * rate * slant, -0.09 * (rate * rate * wave + slope * slant)
        return JointReference(0.09 * wave, speed, gain)

    for step in range(500):
        limiter.advance(step * 0.002, swing)
        assert limiter.state == pytest.approx(swing(step * 0.002))
        assert not limiter.limited
