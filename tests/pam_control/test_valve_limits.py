"""What the valves of a joint can drive limits every reference."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pam_control.joint_models import JointModels
from pam_control.references.jerk_limited_stop import rest_position
from pam_control.references.limited_references import (
    R_HELD,
    R_KIND,
    R_PLANNED,
    TRAJECTORY,
    LimitedReferences,
)
from pam_control.references.motion_limiter import MotionLimits
from pam_control.references.spline import JointReference
from pam_control.valve_limits import ValveDemand
from pam_model.gas import pressure_rate, valve_flow
from pam_model.rig import Rig
from pam_model.robot import compose

STIFFNESS = 14.0
STREAM = 0.2, 40.0  # time-out [s] and bandwidth [rad/s]
LIMITS = MotionLimits(3.6, 200.0, 2.5, 50.0, 1200.0, jerk=2000.0)


def demand(rig: Rig) -> ValveDemand:
    robot = compose(rig)
    return ValveDemand(robot, JointModels.of(robot, robot.joints[0], 5e3), STIFFNESS)


def share(rig: Rig, *motion: float) -> float:
    return float(demand(rig).share(*(np.array([x]) for x in motion))[0])


def with_valves(rig: Rig, size: float) -> Rig:
    for muscle in rig.muscles:
        conductance = size * muscle.valve.sonic_conductance
        valve = dataclasses.replace(muscle.valve, sonic_conductance=conductance)
        rig = rig.with_muscle(dataclasses.replace(muscle, valve=valve))
    return rig


def test_the_share_of_a_constant_speed_is_that_of_the_pressures_on_the_way(rig: Rig) -> None:
    """Two equilibria a little apart, and the flow that leads from one to the other."""
    joint, gas = rig.joints[0], rig.gas
    robot = compose(rig)
    models = JointModels.of(robot, robot.joints[0], 5e3)
    position, speed, step = 0.3, 1.5, 1e-4
    torque = joint.viscous_friction * speed

    def pressures(q: float) -> tuple[float, float]:
        reached = models.model.pressures_for(models.dynamics.gravity(q) + torque, STIFFNESS, q)
        return reached.agonist, reached.antagonist

    found = []
    slopes, volumes = models.model.volume_slopes(position), models.model.volumes(position)
    ends = zip(pressures(position), pressures(position + step), strict=True)
    for (first, then), slope, volume, muscle in zip(
        ends, slopes, volumes, rig.muscles, strict=True
    ):
        inside = first + gas.ambient_pressure
        needed = speed * ((then - first) / step + inside * slope / volume)  # isothermal
        flow = valve_flow(
            math.copysign(1.0, needed),
            inside,
            supply_pressure=rig.supply_pressure,
            ambient_pressure=gas.ambient_pressure,
            conductance=muscle.valve.sonic_conductance,
            critical_ratio=muscle.valve.critical_ratio,
            temperature=gas.temperature,
        )
        found.append(needed / pressure_rate(flow, inside, volume, temperature=gas.temperature))
    assert share(rig, position, speed, 0.0, 0.0) == pytest.approx(max(found), rel=0.02)


def test_valves_of_twice_the_size_drive_twice_the_speed_and_jerk(rig: Rig) -> None:
    velocity, _, jerk = demand(rig).everywhere()
    twice = demand(with_valves(rig, 2.0)).everywhere()
    # a faster motion also needs more torque against friction, and so other pressures
    assert (twice[0], twice[2]) == pytest.approx((2.0 * velocity, 2.0 * jerk), rel=0.1)


def test_a_heavier_joint_changes_its_acceleration_more_slowly_and_moves_as_fast(rig: Rig) -> None:
    joint = rig.joints[0]
    heavy = rig.with_joint(dataclasses.replace(joint, inertia=4.0 * joint.inertia))
    (velocity, _, jerk), (as_fast, _, slower) = (demand(r).everywhere() for r in (rig, heavy))
    assert as_fast == pytest.approx(velocity)
    assert slower == pytest.approx(0.25 * jerk, rel=0.05)


@settings(max_examples=60, deadline=None)
@given(st.floats(-3.0, 3.0), st.floats(-50.0, 50.0))
def test_braking_as_computed_ends_where_it_was_said(velocity: float, acceleration: float) -> None:
    """Against an integration that takes the acceleration back as late as possible."""
    deceleration, jerk, step = 50.0, 1200.0, 1e-4
    said = rest_position(0.0, velocity, acceleration, deceleration, jerk)
    q, v, a = 0.0, velocity, acceleration
    for _ in range(6000):
        left = v + a * abs(a) / (2.0 * jerk)
        a += max(-jerk * step, min(jerk * step, math.copysign(deceleration, -left) - a))
        q, v = q + step * v, v + step * a
    assert q == pytest.approx(said, abs=2e-3)


def follow(target: JointReference, duration: float) -> np.ndarray:
    """References of a limiter that follows a constant target, a row every 2 ms."""
    references = LimitedReferences([LIMITS], [(-2.0, 2.0)])
    references.sources[0][R_HELD] = target.position
    rows = []
    for step in range(round(duration / 0.002)):
        references.advance(step * 0.002, step * 0.002, *STREAM, [])
        state = references.state(0)
        rows.append((state.position, state.velocity, state.acceleration))
    return np.array(rows)


@pytest.mark.parametrize("jump", [0.001, 0.045, 0.4, -1.8])
def test_a_jump_becomes_a_motion_of_limited_jerk_that_does_not_overshoot(jump: float) -> None:
    position, velocity, acceleration = follow(JointReference(jump), 1.6).T
    assert np.abs(velocity).max() <= 1.001 * LIMITS.own_velocity
    assert np.abs(acceleration).max() <= 1.001 * LIMITS.own_acceleration
    assert np.abs(np.diff(acceleration)).max() / 0.002 <= 1.001 * LIMITS.own_jerk
    assert position[-1] == pytest.approx(jump, abs=1e-6)
    assert (np.sign(jump) * position).max() <= abs(jump) + 1e-4
    # no slower than it has to be: the time of the fastest motion, and a tenth of a second
    fastest = (32.0 * abs(jump) / LIMITS.own_jerk) ** (1.0 / 3.0)
    fastest = max(fastest, abs(jump) / LIMITS.own_velocity + 0.05, (abs(jump) * 0.08) ** 0.5)
    there = np.flatnonzero(np.abs(position - jump) > 1e-3 * abs(jump) + 1e-5)
    assert (there[-1] + 1) * 0.002 < fastest + 0.1


def test_a_planned_reference_that_the_valves_can_follow_passes_unchanged() -> None:
    references = LimitedReferences([LIMITS], [(-2.0, 2.0)])
    references.sources[0][R_KIND], references.sources[0][R_PLANNED] = TRAJECTORY, 1.0
    turn = 2.0 * math.pi * 2.0

    def swing(time: float) -> JointReference:
        """2 Hz, with up to 2.5 rad/s and 32 rad/s^2, eased in within half a second."""
        x = min(time / 0.5, 1.0)
        ease = (
            x**3 * (10.0 - 15.0 * x + 6.0 * x * x),
            60.0 * (x * (1.0 - x)) ** 2,
            240.0 * x * (1.0 - x) * (1.0 - 2.0 * x),
        )
        wave = (math.sin(turn * time), turn * math.cos(turn * time))
        return JointReference(
            0.2 * ease[0] * wave[0],
            0.2 * (ease[1] * wave[0] + ease[0] * wave[1]),
            0.2 * (ease[2] * wave[0] + 2.0 * ease[1] * wave[1] - ease[0] * turn**2 * wave[0]),
        )

    for step in range(500):
        references.advance(step * 0.002, step * 0.002, *STREAM, [(0, swing)])
        wanted, state = swing(step * 0.002), references.state(0)
        assert state.position == pytest.approx(wanted.position)
        assert state.velocity == pytest.approx(wanted.velocity)
        assert not references.is_limited(0)
