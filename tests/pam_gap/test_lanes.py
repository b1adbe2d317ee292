"""Lanes of a batch give the same result as one joint alone, whatever effects the lanes have."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pam_gap.prediction.observer import observe
from pam_model.effects import EFFECTS
from pam_model.physics.decay import decay
from pam_model.physics.sine import sine
from pam_model.plant import layout as lay
from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.plant.constants import derive_constants
from pam_model.plant.kernel import step_count
from pam_model.plant.lane_blocks import blocks_of_lanes
from pam_model.plant.lane_choice import GROUPS, LAWS, LaneKernel, lane_kernels
from pam_model.plant.lane_twins import LANES, SINGLE
from pam_model.plant.parameters import INDEX, PlantParameters, parameter_names
from pam_model.plant.sensors import sensor_constants, sensors_of
from pam_model.plant.simulate import initial_state, simulate

SAMPLE_TIME = 2e-3
STEP = 1e-3
SENSING = ("pressure_gain", "pressure_bias", "pressure_lag", "position_offset", "position_delay")


def one_lane_per_effect(parameters: PlantParameters) -> np.ndarray:
    """The plant as written, and with each effect at the size of its portrait (n, n_parameters)."""
    lanes = [parameters.values]
    for name, effect in EFFECTS.items():
        changed = parameters.values.copy()
        for key, size in effect.portrait.sizes.items():
            changed[[INDEX[place] for place in parameter_names(name, key)]] = size
        lanes.append(changed)
    return np.array(lanes)


def motion() -> np.ndarray:
    """Commands under which the joint swings and comes to rest (n, 2)."""
    time = np.arange(250) * SAMPLE_TIME
    swing = 0.3 * np.sin(2 * np.pi * 1.7 * time) * (time < 0.4)
    return np.stack([swing, 0.02 - swing], axis=1)


def all_laws(constants: np.ndarray) -> list[LaneKernel]:
    """The kernel of a plant that has everything, and so needs every group of laws."""
    return [lane_kernels(constants.max(axis=0, keepdims=True))[0].for_all(len(constants))]


EACH = pytest.param(
    "each",
    marks=pytest.mark.long(
        "one kernel with all laws serves every lane; the others are made of it by leaving out laws"
    ),
)


@pytest.fixture(scope="module", params=["all", EACH])
def chosen(request):
    """A function from constants to kernels: one with all laws, or those that the suite chooses."""
    if not HAVE_NUMBA:
        return lambda constants: []
    if request.param == "each":
        return lane_kernels
    return all_laws


@pytest.fixture(scope="module")
def alone(rig):
    """Each plant, simulated alone."""
    parameters = PlantParameters.from_rig(rig)
    values = one_lane_per_effect(parameters)
    state = initial_state(parameters, pressures=(2e5, 1.5e5), position=0.2)
    return simulate(parameters, motion(), SAMPLE_TIME, state, STEP, values=values, kernels=())


@pytest.fixture(scope="module")
def both(rig, alone, chosen):
    """Outputs of the joint alone and predictions of the lanes, (n_lane, n, 5 channels) each."""
    parameters, commands = PlantParameters.from_rig(rig), motion()
    values = one_lane_per_effect(parameters)
    time = np.arange(len(commands)) * SAMPLE_TIME
    state = initial_state(parameters, pressures=(2e5, 1.5e5), position=0.2)
    truth = np.concatenate(
        [alone.valve_pressures, alone.position[..., None], alone.forces], axis=-1
    )
    sensors = np.array([sensor_constants(v) for v in values])
    ideal = np.tile(sensor_constants(parameters.values), (len(values), 1))
    assert sensors.shape == ideal.shape == (len(values), sensors_of(2))
    state = np.tile(state, (len(values), 1))
    constants = np.array([derive_constants(v) for v in values])
    four = np.repeat(np.arange(len(values)), 4)  # so that lanes of every number of steps are many
    errors = observe(
        constants[four],
        ideal[four],
        tuple(np.ascontiguousarray(table) for table in parameters.tables),
        commands,
        np.zeros((len(time), 5)),
        np.ones((len(time), 5), dtype=bool),
        state[four],
        sample_time=SAMPLE_TIME,
        step=STEP,
        horizon=np.inf,
        block=1,
        catch_time=0.0,
        kernels=chosen(constants[four]),
    )
    return truth, -errors.reshape(len(values), 4, *errors.shape[1:])


@pytest.mark.parametrize("lane", range(len(EFFECTS) + 1), ids=["nominal", *EFFECTS])
def test_a_lane_equals_the_joint_alone(both, lane):
    truth, shown = both
    for channel in range(truth.shape[-1]):
        size = np.abs(truth[lane, :, channel]).max()
        difference = np.abs(shown[lane, ..., channel] - truth[lane, :, channel]).max()
        assert difference <= 1e-12 * size, channel


@pytest.mark.skipif(not HAVE_NUMBA, reason="without numba there are no lanes")
@pytest.mark.parametrize("threads", [1, 2])
def test_a_batch_side_by_side_equals_one_after_the_other(rig, alone, chosen, threads):
    parameters = PlantParameters.from_rig(rig)
    four = np.repeat(one_lane_per_effect(parameters), 4, axis=0)
    kernels = chosen(np.array([derive_constants(v) for v in four]))
    # none is left alone
    assert np.any([kernel.serves for kernel in kernels], axis=0).all()
    state = initial_state(parameters, pressures=(2e5, 1.5e5), position=0.2)
    found = simulate(
        parameters, motion(), SAMPLE_TIME, state, STEP,
        values=four, threads=threads, kernels=kernels,
    )  # fmt: skip
    for shown, truth in (
        (found.outputs, alone.outputs),
        (found.final_state, alone.final_state),
    ):
        size = np.abs(truth).max(axis=tuple(range(truth.ndim - 1)))
        assert np.all(np.abs(shown - np.repeat(truth, 4, axis=0)) <= 1e-12 * size)


def test_lanes_that_need_shorter_steps_have_blocks_of_their_own(rig):
    parameters = PlantParameters.from_rig(rig)
    constants = np.tile(derive_constants(parameters.values), (30, 1))
    constants[3:9, lay.C_RATE] = 5.0 / SAMPLE_TIME
    constants[20, lay.constants_of(0) + lay.M_CABLE] = 1e-5  # costly
    constants[25, lay.JOINT_EFFECTS["coulomb_friction"].is_on] = 1.0
    bare, joint, cable = lane_kernels(constants)
    assert np.flatnonzero(~bare.serves).tolist() == [20, 25]
    assert np.flatnonzero(~joint.serves).tolist() == [20]
    assert np.flatnonzero(~cable.serves).tolist() == [25]
    blocks = blocks_of_lanes(constants, [bare, joint, cable], SAMPLE_TIME, STEP)
    assert {tuple(b.members): (b.steps, b.variant) for b in blocks} == {
        (0, 1, 2, *range(9, 20), *range(21, 25), *range(26, 30)): (2, bare.variant),
        tuple(range(3, 9)): (6, bare.variant),
        (20,): (2, SINGLE),
        (25,): (2, SINGLE),
    }
    halves = blocks_of_lanes(constants, [bare], SAMPLE_TIME, STEP, threads=2)
    shares = [(b.steps, len(b.members)) for b in halves if b.variant is not SINGLE]
    assert shares == [(6, 6), (2, 16), (2, 6)]  # those that take longest begin
    many = np.tile(constants[:1], (70, 1))
    each = blocks_of_lanes(many, [bare.for_all(70)], SAMPLE_TIME, STEP)
    assert [len(b.members) for b in each] == [LANES, LANES, 6]
    assert all(b.variant is SINGLE for b in blocks_of_lanes(constants, [], SAMPLE_TIME, STEP))


def test_each_lane_has_a_kernel_with_the_groups_of_laws_that_it_needs(rig):
    parameters = PlantParameters.from_rig(rig)
    constants = np.tile(derive_constants(parameters.values), (6, 1))
    constants[1, lay.JOINT_EFFECTS["coulomb_friction"].is_on] = 1.0
    constants[2, lay.constants_of(0) + lay.MUSCLE_EFFECTS["creep"].is_on] = 1.0
    constants[3, lay.constants_of(1) + lay.M_TUBE] = 1.0
    constants[4, lay.constants_of(0) + lay.M_CABLE] = 1e-5
    constants[5] = constants[1:5].max(axis=0)
    kernels = lane_kernels(constants)
    served = [np.flatnonzero(kernel.serves).tolist() for kernel in kernels]
    assert served == [[0], [0, 3], [0, 1], [0, 2], [0, 4], [0, 1, 2, 3, 4, 5]]
    groups = [{name for name, laws in GROUPS.items() if not laws.keys() & k.off} for k in kernels]
    assert groups == [set(), {"gas"}, {"joint"}, {"muscle"}, {"cable"}, set(GROUPS)]
    assert LAWS.keys() <= kernels[0].off


def test_every_law_of_an_effect_is_in_a_group():
    effects = {**lay.JOINT_EFFECTS, **lay.MUSCLE_EFFECTS}
    assert {f"{name.upper()}_IS_ON" for name in effects} <= LAWS.keys()


def test_a_sample_has_enough_steps_and_few_different_numbers_of_them():
    numbers = {step_count(rate, SAMPLE_TIME, STEP) for rate in np.linspace(0.0, 64e3, 4001)}
    assert numbers == {2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128}
    for rate in np.linspace(0.0, 60e3, 997).tolist():
        steps = step_count(rate, SAMPLE_TIME, STEP)
        assert steps >= SAMPLE_TIME * rate - 1e-9
        assert steps <= max(2, 1.5 * SAMPLE_TIME * rate + 1.0)


def test_exponent_and_sine_of_the_lanes_are_those_of_the_library():
    for x in np.linspace(0.0, 80.0, 4001).tolist():
        assert decay(x) == pytest.approx(math.exp(-x), rel=5e-16)
    for x in np.linspace(-10.0, 10.0, 4001).tolist():
        assert sine(x) == pytest.approx(math.sin(x), abs=3e-16)


@pytest.mark.skipif(not HAVE_NUMBA, reason="without numba there are no lanes")
def test_lanes_turn_an_uneven_pulley_as_the_joint_alone_does(rig):
    parameters, commands = PlantParameters.from_rig(rig), motion()
    constants = np.tile(derive_constants(parameters.values), (32, 1))
    constants[:, lay.C_ARM_SLOPE] = np.linspace(-0.5, 0.5, len(constants))
    constants[:, lay.C_ARM_BEND] = np.linspace(0.0, -0.4, len(constants))
    state = initial_state(parameters, pressures=(2e5, 1.5e5), position=0.2)

    def shown(kernels):
        return observe(
            constants,
            np.tile(sensor_constants(parameters.values), (len(constants), 1)),
            tuple(np.ascontiguousarray(table) for table in parameters.tables),
            commands,
            np.zeros((len(commands), 5)),
            np.ones((len(commands), 5), dtype=bool),
            np.tile(state, (len(constants), 1)),
            sample_time=SAMPLE_TIME,
            step=STEP,
            horizon=np.inf,
            block=1,
            catch_time=0.0,
            kernels=kernels,
        )

    # the kernel of the tests above, which is compiled already
    everything = np.array([derive_constants(v) for v in one_lane_per_effect(parameters)])
    kernel = all_laws(everything)[0].for_all(len(constants))
    lanes, alone = shown([kernel]), shown(())
    assert np.ptp(alone[:, -1, 2]) > 0.01  # the pulleys matter
    size = np.abs(alone).max(axis=(0, 1))
    assert np.all(np.abs(lanes - alone) <= 1e-12 * size)
