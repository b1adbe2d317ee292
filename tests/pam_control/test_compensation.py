"""The controller's inverses of known effects: valves, friction, and what muscles remember."""

from __future__ import annotations

import dataclasses
import math
from functools import partial

import numpy as np
import pytest

from pam_control.compensation.dry_friction import SMOOTHING_SPEED, JointFriction, friction_change
from pam_control.compensation.history_torque import history_torque
from pam_control.joint_models import JointModels
from pam_control.laws.position_rows import PositionRows
from pam_control.rows.plan_rows import W_PLANNED
from pam_model.effects.valve_dead_zone import ROUNDED
from pam_model.plant.compiled import for_kernel
from pam_model.plant.composition import memory_pull
from pam_model.plant.control_laws import (
    flow_opening,
    inverse_row,
    memory_advance,
    spool_position,
)
from pam_model.plant.layout import C_MUSCLES
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import initial_state, simulate
from pam_model.robot import compose


def with_effects(rig, **effects):
    """The agonist of the elbow with these effects."""
    return dataclasses.replace(rig.muscle(rig.joints[0].agonist), effects=effects)


def rows_of(rig) -> PositionRows:
    """The rows of the first joint."""
    robot = compose(rig)
    return PositionRows([JointModels.of(robot, robot.joints[0], 5e3)])


class Memory:
    """What the agonist of the elbow remembers."""

    def __init__(self, rig, muscle) -> None:
        rows = rows_of(rig.with_muscle(muscle))
        self.constants, self.state = rows.c[0], rows.memory[0]

    def move(self, stroke, duration):
        memory_advance(C_MUSCLES, self.constants, self.state, 0, stroke, duration)

    def pull(self, pressure):
        return memory_pull(C_MUSCLES, self.constants, self.state, 0, pressure)[0]


def along(rig):
    """The torque of the history of the first joint, as a function of time and reference."""
    rows = rows_of(rig)
    own = (rows.c[0], rows.j[0], rows.w[0], rows.y[0], rows.memory[0])

    def torque(time, position, velocity=0.0, acceleration=0.0, pressure=2e5):
        for muscle in rows.w[0]:
            muscle[W_PLANNED] = pressure
        return history_torque(*own, time, position, velocity, acceleration)

    return torque


def friction_of(rig, joint) -> JointFriction:
    return JointFriction.from_joint(compose(rig.with_joint(joint)).joints[0])


def test_dry_friction_is_odd_and_saturates(rig):
    joint = dataclasses.replace(
        rig.joints[0],
        effects={
            "coulomb_friction": {"torque": 0.3},
            "stribeck_friction": {"static_torque": 0.6, "torque": 0.4, "speed": 0.1},
        },
    )
    friction = friction_of(rig, joint)
    for speed in (1e-3, 0.02, 0.1, 2.0):
        assert friction.torque(-speed) == -friction.torque(speed)
        assert 0.0 < friction.torque(speed) <= 0.9
    assert friction.torque(0.0) == 0.0
    assert friction.torque(30.0 * SMOOTHING_SPEED) == pytest.approx(0.7, rel=1e-3)
    assert friction_of(rig, rig.joints[0]).laws == ()


def test_dry_friction_turns_over_its_presliding_angle_and_pushes_nothing_at_rest(rig):
    """Protects the ends of motions: breakaway torque at rest throws the joint past its target."""
    named = {"static_torque": 0.8, "torque": 0.4, "speed": 0.1, "presliding_angle": 2e-3}
    joint = dataclasses.replace(rig.joints[0], effects={"stribeck_friction": named})
    friction = friction_of(rig, joint)
    history = along(rig.with_joint(joint))

    def torque(position, velocity, acceleration):
        return history(position, position, velocity, acceleration)

    assert torque(0.0, 0.0, 1.0) == 0.0
    assert torque(2e-3, 1.0, 1.0) == pytest.approx(-0.4 * (1.0 - math.exp(-1.0)))
    assert torque(0.1, 1.0, 0.0) == pytest.approx(-0.4)
    assert torque(0.101, 0.01, -1.0) == pytest.approx(
        -friction.level(0.01) * math.tanh(0.01 / SMOOTHING_SPEED)
    )
    assert torque(0.101, 0.0, 0.0) == 0.0


def test_falling_friction_brakes_a_joint_that_is_too_fast(rig):
    """A sign that is wrong would double the negative damping of such a friction."""
    named = {"static_torque": 0.8, "torque": 0.4, "speed": 0.1}
    joint = dataclasses.replace(rig.joints[0], effects={"stribeck_friction": named})
    change = partial(friction_change, rows_of(rig.with_joint(joint)).c[0])
    for planned in (0.08, -0.08):
        forwards = math.copysign(1.0, planned)
        assert forwards * change(planned, 1.5 * planned) < -0.05
        assert forwards * change(planned, 0.5 * planned) > 0.05
        assert abs(change(planned, 1e3 * planned)) <= 0.4
    assert change(0.0, 0.2) == 0.0  # at rest nothing comes from the measured speed
    coulomb = dataclasses.replace(joint, effects={"coulomb_friction": {"torque": 0.3}})
    assert friction_change(rows_of(rig.with_joint(coulomb)).c[0], 0.05, 0.2) == 0.0


def test_thread_friction_does_not_know_time_nor_steps(rig):
    """Rate-independent: a stroke in one piece or in many ends in the same state."""
    muscle = with_effects(rig, hysteresis={"amplitude": 0.1, "presliding_length": 1e-3})
    whole, parts = Memory(rig, muscle), Memory(rig, muscle)
    saturated = 0.1 * muscle.thread_length**2 / (4.0 * math.pi * muscle.turns**2)
    for stroke in (2e-3, -7e-4, 3e-4):
        whole.move(stroke, 1.0)
        for _ in range(50):
            parts.move(stroke / 50, 7e-3)
        assert parts.pull(2e5) == pytest.approx(whole.pull(2e5), rel=1e-12)
        assert abs(whole.pull(2e5)) < 2e5 * saturated


def test_creep_relaxes_with_its_time_constant(rig):
    muscle = with_effects(rig, creep={"ratio": 0.2, "time_constant": 2.0})
    creep = Memory(rig, muscle)
    creep.move(0.01, 0.0)
    at_once = creep.pull(2e5)
    stiffness = 0.2 * 6.0 * 3e5 * muscle.rest_length / (4.0 * math.pi * muscle.turns**2)
    assert at_once == pytest.approx(0.01 * stiffness)
    creep.move(0.0, 2.0)
    assert creep.pull(2e5) == pytest.approx(at_once * math.exp(-1.0))


def test_history_is_that_of_the_simulated_muscle(rig):
    """Pushed through the same lengths, controller and plant agree on the torque."""
    effects = {"hysteresis": {"amplitude": 0.1}, "creep": {"ratio": 0.3, "time_constant": 1.0}}
    named = rig
    for name in rig.joints[0].muscles:
        named = named.with_muscle(dataclasses.replace(rig.muscle(name), effects=effects))
    time = np.arange(0.0, 4.0, 0.002)
    q = 0.4 * np.sin(1.5 * time) * np.minimum(time, 1.0)
    p = np.full((len(time), 2), 2.5e5)
    torques = []
    for each in (rig, named):
        parameters = PlantParameters.from_rig(each, 0)
        start = initial_state(parameters, pressures=(2.5e5, 2.5e5))
        result = simulate(
            parameters, np.zeros((len(time), 2)), 0.002, start, positions=q, pressures=p
        )
        torques.append(rig.joints[0].pulley_radius * (result.forces[:, 0] - result.forces[:, 1]))
    history = along(named)
    own = [history(t, x, pressure=2.5e5) for t, x in zip(time, q, strict=True)]
    difference = np.array(own) - (torques[1] - torques[0])
    assert np.abs(torques[1] - torques[0]).max() > 0.2
    assert np.abs(difference).max() < 0.02 * np.abs(torques[1] - torques[0]).max()


@pytest.mark.parametrize("overlap", [0.0, 0.05, 0.3])
@pytest.mark.parametrize("null", [-0.1, 0.0, 0.07])
def test_spool_undoes_overlap_and_null_offset(rig, overlap, null):
    row = inverse_row(
        with_effects(
            rig,
            valve_dead_zone={"overlap": overlap},
            valve_null_offset={"offset": null},
            exhaust_restriction={"ratio": 0.5},
        )
    )
    inverse = for_kernel(np.array(row))
    for opening in (-0.8, -0.2, -ROUNDED, ROUNDED, 0.3, 0.9):
        spool = spool_position(inverse, opening) + null
        passed = math.copysign(max(0.0, abs(spool) - overlap) / (1.0 - overlap), spool)
        assert passed == pytest.approx(opening, abs=1e-12)
    assert spool_position(inverse, 0.0) == -null
    assert flow_opening(inverse, -0.2) == pytest.approx(-0.4)
    assert flow_opening(inverse, 0.2) == 0.2
