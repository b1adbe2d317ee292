"""Joints that one, two, three or four muscles turn, and muscles that cross two joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from pam_model.errors import PamError
from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.plant.constants import derive_constants
from pam_model.plant.joint_muscles import JointMuscle
from pam_model.plant.lane_choice import lane_kernels
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.plant_batch import PlantBatch
from pam_model.plant.robot_plant import Crossing, RobotPlant
from pam_model.plant.simulate import Plant, initial_state, simulate, vented_state
from pam_model.rig import Muscle, Rig

SAMPLE_TIME = 2e-3
LIFTER, SECOND = JointMuscle("lifter", 1.0), JointMuscle("second", 1.0)
LOWERER, SMALL = JointMuscle("lowerer", -1.0), JointMuscle("small", -0.6)
FOUR = (LIFTER, LOWERER, SECOND, SMALL)
EFFECTS: dict[str, float] = {
    "coulomb_friction.torque": 0.2,
    "hysteresis.amplitude": 0.08,
    "leakage.conductance": 2e-12,
    "pressure_lag.time_constant": 3e-3,
}


def joint_of(
    rig: Rig, muscles: Mapping[JointMuscle, Muscle] | tuple[JointMuscle, ...]
) -> PlantParameters:
    """The joint of a rig, turned by other muscles; by default each is like the rig's first one."""
    if not isinstance(muscles, Mapping):
        muscles = dict.fromkeys(muscles, rig.muscles[0])
    return PlantParameters.with_muscles(rig, 0, muscles)


def swing(muscles: int, samples: int = 150) -> np.ndarray:
    """Commands of so many flow valves, all different."""
    time = np.arange(samples)[:, None] * SAMPLE_TIME
    each = np.arange(muscles)
    return 0.25 * np.sin(2 * np.pi * (1.1 + 0.7 * each) * time + 2.0 * each) + 0.03


@pytest.mark.parametrize("arm", [1.0, -1.0, -0.7])
@pytest.mark.parametrize("pressure", [0.6e5, 1e5])
def test_one_muscle_lifts_a_load_until_its_torque_is_that_of_the_load(
    rig: Rig, arm: float, pressure: float
) -> None:
    parameters = joint_of(rig, (JointMuscle("lifter", arm),))
    state = initial_state(parameters, pressures=[pressure])
    at_rest = simulate(parameters, np.zeros((4000, 1)), SAMPLE_TIME, state, shut=True)
    position, gauge = float(at_rest.position[-1]), float(at_rest.pressures[-1, 0])
    assert abs(float(at_rest.velocity[-1])) < 1e-6
    joint, muscle = rig.joints[0], rig.muscles[0]
    length = muscle.neutral_length - arm * joint.pulley_radius * position
    assert at_rest.lengths[-1, 0] == pytest.approx(length, rel=1e-12)
    force = float(rig.force_model(muscle.name).force(gauge, length))
    assert at_rest["lifter.force"][-1] == pytest.approx(force, rel=1e-12)
    load = joint.gravity_torque * np.sin(position - joint.gravity_angle)
    assert force * arm * joint.pulley_radius == pytest.approx(load, abs=1e-5)
    assert abs(load) > 0.5


def test_two_equal_muscles_pull_as_one_of_twice_the_force_flow_and_volume(rig: Rig) -> None:
    muscle = rig.muscles[0]
    valve = replace(muscle.valve, sonic_conductance=2.0 * muscle.valve.sonic_conductance)
    # Force and volume of this braid are inversely proportional to the square of its turns.
    twice = replace(
        muscle, turns=muscle.turns / np.sqrt(2.0), dead_volume=2.0 * muscle.dead_volume, valve=valve
    )
    one = joint_of(rig, {LIFTER: twice, LOWERER: muscle})
    two = joint_of(rig, (LIFTER, SECOND, LOWERER))
    commands = swing(2)
    single = simulate(one, commands, SAMPLE_TIME)
    both = simulate(two, commands[:, [0, 0, 1]], SAMPLE_TIME)
    assert np.ptp(single.position) > 0.3
    np.testing.assert_allclose(both.position, single.position, atol=1e-10)
    np.testing.assert_allclose(both.pressures[:, 0], both.pressures[:, 1], rtol=0.0)
    np.testing.assert_allclose(both.pressures[:, 1:], single.pressures, rtol=1e-9, atol=1e-4)


def test_a_pair_written_as_two_muscles_is_the_pair_of_the_rig_file(rig: Rig) -> None:
    pair = PlantParameters.from_rig(rig)
    same = joint_of(rig, dict(zip((LIFTER, LOWERER), rig.muscles, strict=True)))
    np.testing.assert_array_equal(same.values, pair.values)
    own, theirs = (simulate(one, swing(2), SAMPLE_TIME) for one in (same, pair))
    np.testing.assert_array_equal(own.outputs, theirs.outputs)
    np.testing.assert_array_equal(own["lowerer.spool"], theirs["antagonist.spool"])
    # The order of muscles does not matter, but for rounding.
    other = joint_of(rig, dict(zip((LOWERER, LIFTER), reversed(rig.muscles), strict=True)))
    turned = simulate(other, swing(2)[:, ::-1], SAMPLE_TIME)
    np.testing.assert_allclose(turned.position, theirs.position, atol=1e-12)


def test_a_muscle_at_half_the_arm_moves_half_as_much_and_turns_half_as_hard(rig: Rig) -> None:
    parameters = joint_of(rig, (LIFTER, JointMuscle("small", 0.5)))
    found = simulate(parameters, swing(2), SAMPLE_TIME)
    radius, neutral = rig.joints[0].pulley_radius, rig.muscles[0].neutral_length
    for muscle, arm in ((0, 1.0), (1, 0.5)):
        moved = neutral - arm * radius * found.position
        np.testing.assert_allclose(found.lengths[:, muscle], moved, rtol=1e-12)
    torque = radius * (found.forces[:, 0] + 0.5 * found.forces[:, 1])
    np.testing.assert_allclose(found.torque, torque, atol=1e-12)
    plant = Plant(parameters, state=found.final_state)
    assert plant.path_speeds[1] == pytest.approx(0.5 * plant.path_speeds[0])


@pytest.mark.parametrize(
    "muscles", [1, 3, pytest.param(4, marks=pytest.mark.long("each number is compiled anew"))]
)
def test_steps_and_samples_of_any_muscles_give_the_same(rig: Rig, muscles: int) -> None:
    parameters = joint_of(rig, FOUR[:muscles]).replaced(EFFECTS)
    commands, state = swing(muscles), vented_state(parameters)
    along = simulate(parameters, commands, SAMPLE_TIME, state)
    plant = Plant(parameters, state=state)
    readings = [plant.step(row.tolist(), SAMPLE_TIME) for row in commands]
    np.testing.assert_array_equal(plant.state, along.final_state)
    assert {len(row) for row in readings} == {1 + muscles}
    assert plant.output.keys() >= {f"{FOUR[muscles - 1].name}.force", "reservoir_pressure"}
    assert plant.state[4] != 0.0


@pytest.mark.skipif(not HAVE_NUMBA, reason="without numba there are no lanes")
def test_lanes_of_three_muscles_are_simulated_side_by_side(rig: Rig) -> None:
    parameters = joint_of(rig, FOUR[:3])
    commands, state = swing(3), vented_state(parameters)
    along = simulate(parameters, commands, SAMPLE_TIME, state)
    values = np.repeat(parameters.values[None], 9, axis=0)
    kernels = lane_kernels(np.array([derive_constants(v, muscles=FOUR[:3]) for v in values]))
    lanes = simulate(
        parameters, commands, SAMPLE_TIME, state, values=values,
        kernels=kernels,
    )  # fmt: skip
    size = np.abs(along.outputs).max(axis=0)
    assert np.all(np.abs(lanes.outputs - along.outputs) <= 1e-12 * size)
    batch = PlantBatch(parameters, values, np.repeat(state[None], 9, axis=0), SAMPLE_TIME)
    plant = Plant(parameters, state=state)
    for row in commands:
        expected = plant.step(row.tolist(), SAMPLE_TIME)
        shown = batch.step(np.repeat(row[None], 9, axis=0))
        np.testing.assert_allclose(
            shown, np.broadcast_to(expected, shown.shape), rtol=1e-8, atol=1e-8
        )


def test_a_robot_has_joints_with_different_numbers_of_muscles(rig: Rig) -> None:
    joints = [joint_of(rig, FOUR[:muscles]) for muscles in (1, 3, 2)]
    robot = RobotPlant(joints, states=[vented_state(one) for one in joints])
    alone = [Plant(one, state=vented_state(one)) for one in joints]
    for row in swing(6):
        commands = [row[:1].tolist(), row[1:4].tolist(), row[4:].tolist()]
        together = robot.step(commands, SAMPLE_TIME)
        each = [plant.step(own, SAMPLE_TIME) for plant, own in zip(alone, commands, strict=True)]
        for seen, expected in zip(together, each, strict=True):
            assert seen == pytest.approx(expected, rel=1e-9, abs=1e-9)
    for joint, plant in zip(robot.joints, alone, strict=True):
        assert joint.output == pytest.approx(plant.output, rel=1e-8, abs=1e-9)
    robot.joints[2].change({"lifter.leakage.conductance": 1e-11})
    assert robot.joints[2].state.shape == alone[2].state.shape


def crossed(rig: Rig, **changes: float) -> tuple[RobotPlant, list[PlantParameters]]:
    """Two joints, of which the second has one muscle, which crosses the first one as well."""
    joints = [joint_of(rig, FOUR[:2]).forced(changes), joint_of(rig, FOUR[:1]).forced(changes)]
    states = [
        initial_state(joints[0], position=0.1, pressures=[0.8e5, 0.6e5]),
        initial_state(joints[1], position=-0.1, pressures=[0.5e5]),
    ]
    return RobotPlant(joints, states=states, crossings=[Crossing(1, 0, 0, -0.02)]), joints


def test_a_muscle_that_crosses_two_joints_turns_both_by_virtual_work(rig: Rig) -> None:
    """Without friction and with valves that are nearly shut, the energy of all parts is kept."""
    robot, joints = crossed(
        rig, **{"joint.viscous_friction": 0.0, "valve.sonic_conductance": 1e-25}
    )
    b, turns = rig.muscles[0].thread_length, rig.muscles[0].turns
    dead, ambient = rig.muscles[0].dead_volume, rig.gas.ambient_pressure
    inertia, gravity = joints[0]["joint.inertia"], joints[0]["joint.gravity_torque"]
    content: dict[tuple[int, str], float] = {}
    energies, seen = [], []
    for _ in range(300):
        energy = 0.0
        for number, joint in enumerate(robot.joints):
            now = joint.output
            energy += 0.5 * inertia * now["velocity"] ** 2 - gravity * np.cos(now["position"])
            for muscle in joint.parameters.muscles:
                length = now[f"{muscle.name}.length"]
                volume = length * (b**2 - length**2) / (4 * np.pi * turns**2) + dead
                product = (now[f"{muscle.name}.pressure"] + ambient) * volume
                content.setdefault((number, muscle.name), product)
                assert product == pytest.approx(content[number, muscle.name], rel=1e-8)
                energy += ambient * volume - product * np.log(volume)
        energies.append(energy)
        both = robot.joints[1].output["position"], robot.joints[0].output["position"]
        seen.append(both)
        length = rig.muscles[0].neutral_length - 0.03 * both[0] + 0.02 * both[1]
        assert robot.joints[1].output["lifter.length"] == pytest.approx(length, rel=1e-12)
        robot.step([[0.0, 0.0], [0.0]], SAMPLE_TIME)
    assert np.all(np.ptp(seen, axis=0) > 0.2)
    np.testing.assert_allclose(energies, energies[0], atol=1e-6)


def test_a_held_joint_does_not_lengthen_the_muscle_that_crosses_it(rig: Rig) -> None:
    robot, joints = crossed(rig)
    joints[0] = joints[0].forced({"coulomb_friction.torque": 1e3})
    states = [plant.state for plant in robot.joints]
    held = RobotPlant(joints, states=states, crossings=[Crossing(1, 0, 0, -0.02)])
    alone = Plant(
        joints[1].forced(
            {"lifter.neutral_length": joints[1]["lifter.neutral_length"] + 0.02 * 0.1}
        ),
        state=states[1],
    )
    for row in swing(1):
        _, seen = held.step([[0.0, 0.0], row.tolist()], SAMPLE_TIME)
        assert seen == pytest.approx(alone.step(row.tolist(), SAMPLE_TIME), rel=1e-9, abs=1e-9)
    assert held.joints[0].output["position"] == 0.1


@pytest.mark.parametrize(
    ("muscles", "message"),
    [
        ((), "a joint without muscles: expected at least one"),
        ((LIFTER, JointMuscle("lifter", -1.0)), "'lifter' as the name of a muscle: expected one"),
        ((JointMuscle("two words", 1.0),), "'two words' as the name of a muscle"),
        ((JointMuscle("joint", 1.0),), "'joint' as the name of a muscle"),
        ((JointMuscle("weak", 0.0),), "lever arm 0.0 of muscle weak: expected"),
        ((JointMuscle("wild", float("nan")),), "lever arm nan of muscle wild: expected"),
    ],
)
def test_muscles_that_no_joint_can_have_are_refused(
    rig: Rig, muscles: tuple[JointMuscle, ...], message: str
) -> None:
    with pytest.raises(PamError, match=message):
        joint_of(rig, muscles)


@pytest.mark.parametrize(
    "crossing",
    [Crossing(0, 0, 0, 0.01), Crossing(0, 2, 1, 0.01), Crossing(0, 0, 2, 0.01),
     Crossing(1, 0, 0, float("nan"))],
)  # fmt: skip
def test_crossings_that_no_robot_can_have_are_refused(rig: Rig, crossing: Crossing) -> None:
    pair = PlantParameters.from_rig(rig)
    with pytest.raises(PamError, match=r"expected a muscle of one joint|lever arm of a crossing"):
        RobotPlant([pair, pair], crossings=[crossing])


def test_names_and_numbers_are_those_of_the_joint_s_own_muscles(rig: Rig) -> None:
    three = joint_of(rig, FOUR[:3])
    assert three.replaced({"leakage.conductance": 1e-12})["second.leakage.conductance"] == 1e-12
    with pytest.raises(PamError, match=r"unknown plant parameter .agonist\.turns"):
        three.replaced({"agonist.turns": 2.0})
    with pytest.raises(PamError, match=r"expected 3 of each, of lifter, lowerer, second"):
        initial_state(three, pressures=[1e5, 1e5])
    with pytest.raises(PamError, match=r"commands has shape \(5, 2\), expected \('n', 3\)"):
        simulate(three, np.zeros((5, 2)), SAMPLE_TIME)
