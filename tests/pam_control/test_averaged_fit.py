"""What is learnt is averaged over rival explanations, by how probable each of them is."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from pam_control.adaptation.averaged_fit import AveragedFit, Rival
from pam_control.adaptation.motion_functions import (
    DEVIATIONS,
    N_ELEMENTS,
    begin_memory,
    element,
    move_memory,
)
from pam_control.adaptation.normal_equations import CORRELATED, SOLVED_EVERY
from pam_control.adaptation.torque_adaptation import (
    DELAY,
    GRIP,
    RIVALS,
    SLIPS,
    ZERO,
    TorqueAdaptation,
    move_reference,
    take_torque,
)
from pam_control.rows.plan_rows import N_LEARNING, N_MEMORY, N_PLAN, Y_STIFFNESS
from pam_model.plant.compiled import for_kernel

NOISE = 0.05


def fit(*rivals, bounds=None, believed=0.0, deviations=(1.0, 1.0)):
    return AveragedFit(deviations, rivals, NOISE, believed, 0.01, bounds or {})


def test_noise_is_ignored_and_what_is_there_is_found():
    random, wanted = np.random.default_rng(3), np.array([0.5, -0.2])
    silent, finding = (fit(Rival((0, 1), 0.0)) for _ in range(2))
    for _ in range(500):
        functions = random.standard_normal(2)
        noise = NOISE * random.standard_normal()
        silent.update(functions, noise, 0.01)
        finding.update(functions, float(functions @ wanted) + noise, 0.01)
    assert silent.weights == [0.0, 0.0]
    assert finding.fitted == pytest.approx(wanted, abs=0.02)
    assert finding.weights == pytest.approx(wanted, abs=0.04), "what noise takes back"


def test_rivals_that_no_data_tell_apart_share_by_what_was_believed_before():
    shared = fit(Rival((0,), 0.0), Rival((1,), np.log(3.0)))
    for _ in range(200):
        shared.update(np.array([1.0, 1.0]), 0.6, 0.01)
    assert shared.probabilities == pytest.approx([0.25, 0.75])
    assert shared.certainty(1) == pytest.approx(0.75)
    assert shared.weights == pytest.approx([0.15, 0.45], abs=0.01)


def test_a_function_that_the_data_do_not_need_is_improbable():
    random = np.random.default_rng(5)
    simple = fit(Rival((0,), 0.0), Rival((0, 1), 0.0))
    for _ in range(3000):
        first, second = random.standard_normal(2)
        value = 0.5 * first + NOISE * random.standard_normal()
        simple.update(np.array([first, second]), value, 0.01)
    assert simple.certainty(1) < 0.2
    assert simple.weights == pytest.approx([0.5, 0.0], abs=0.01)


@pytest.mark.parametrize("seed", range(8))
def test_bounded_weights_are_the_least_squares_with_bounds(seed):
    random = np.random.default_rng(seed)
    wanted, seen = random.normal(size=5), random.normal(size=(60, 5)) @ random.normal(size=(5, 5))
    rival, bounds = Rival(tuple(range(5)), 0.0), {0: 0.0, 2: -0.3, 4: 0.2}
    bounded = fit(rival, bounds=bounds, deviations=(9.0,) * 5)
    values = seen @ wanted
    for functions, value in zip(seen, values, strict=True):
        bounded.update(functions, float(value), CORRELATED)
    free = np.inf
    expected = lsq_linear(seen, values, ([0.0, -free, -0.3, -free, 0.2], free)).x
    assert bounded.fitted == pytest.approx(expected, abs=0.05 * np.abs(wanted).max())


def test_what_was_learnt_follows_a_change():
    random, following = np.random.default_rng(4), fit(Rival((0,), 0.0), deviations=(1.0,))
    for load in (0.5, 0.1):
        for _ in range(6000):  # a minute
            value = random.standard_normal()
            following.update(np.array([value]), load * value, 0.01)
        assert following.weights == pytest.approx([load], abs=0.02)


LARGEST = 30.0  # N m
STIFF = 14.0  # N m/rad
PULLS = 20.0  # N m, of both muscles without their signs
STROKE = 0.05 * LARGEST  # N m of friction


def zeros(count):
    return for_kernel(np.zeros(count))


def after_one_stroke(torque):
    """The fit of a joint's torques after one smooth stroke of 0.4 rad in 0.6 s."""
    learnt = TorqueAdaptation(zeros(N_PLAN), zeros(N_LEARNING), 0.05, 0.25, LARGEST)._fit
    memory, step = [0.0] * N_MEMORY, 0.01
    begin_memory(memory, 0)
    for k in range(60):
        phase = np.pi * k * step / 0.6
        q, speed = 0.2 * (1.0 - np.cos(phase)), 0.2 * np.pi / 0.6 * np.sin(phase)
        acceleration = 0.2 * (np.pi / 0.6) ** 2 * np.cos(phase)
        move_memory(memory, 0, q, step)
        elements = [element(memory, 0, number) for number in range(N_ELEMENTS)]
        rate = 12.0 * speed
        functions = np.array([1.0, q, q**3, speed, acceleration, *elements, rate, STIFF, PULLS])
        value = torque(speed, elements, rate)
        learnt.update(functions, value, step * min(abs(speed) / 0.1, 1.0))
    return learnt


def test_dry_friction_is_no_viscosity_after_the_first_stroke():
    learnt = after_one_stroke(lambda speed, elements, rate: STROKE * elements[1])
    assert learnt.certainty(SLIPS[0]) > 0.9
    assert sum(learnt.weights[place] for place in SLIPS) == pytest.approx(STROKE, rel=0.3)
    assert abs(learnt.weights[3]) < 0.02 * STROKE, "N m s/rad at 1 rad/s"
    assert min(learnt.weights[place] for place in SLIPS) > -1e-6


def test_viscosity_is_no_dry_friction_after_the_first_stroke():
    learnt = after_one_stroke(lambda speed, elements, rate: 0.6 * speed)
    assert learnt.certainty(SLIPS[0]) < 0.1
    assert sum(learnt.weights[place] for place in SLIPS) < 0.05


@pytest.mark.parametrize("place", [ZERO, GRIP])
def test_a_false_sensor_is_no_viscosity_when_a_joint_is_taken_over(place):
    """The muscles are stiffened while the joint hardly moves; the error grows with their force."""
    learnt = TorqueAdaptation(zeros(N_PLAN), zeros(N_LEARNING), 0.05, 0.25, LARGEST)._fit
    memory, step = [0.0] * N_MEMORY, 0.01
    begin_memory(memory, 0)
    for k in range(100):
        time = k * step
        q, speed = 0.05 * np.cos(np.pi * time), -0.05 * np.pi * np.sin(np.pi * time)
        stiffness = STIFF * (1.0 - 0.2 * np.exp(-time / 0.2))
        move_memory(memory, 0, q, step)
        elements = [element(memory, 0, number) for number in range(N_ELEMENTS)]
        acceleration = -(np.pi**2) * q
        sensors = [stiffness, PULLS * stiffness / STIFF * (1.0 + 0.5 * q)]
        functions = [1.0, q, q**3, speed, acceleration, *elements, 12.0 * speed, *sensors]
        learnt.update(np.array(functions), 0.04 * functions[place], step)
    fast = [0.0, 0.0, 0.0, 1.0, 0.0, *[0.0] * N_ELEMENTS, 12.0, 0.0, 0.0]
    assert abs(np.dot(learnt.fitted, fast)) < 0.02, "N m at 1 rad/s"


def test_the_functions_of_the_rivals_are_those_of_the_motion():
    assert {place for rival in RIVALS for place in rival.functions} == {*range(GRIP + 1)}
    assert len(DEVIATIONS) == DELAY


def missing(rival, left, random):
    """Share of a fit that is not yet used after 0.4 s, when it leaves errors of this size."""
    following = fit(rival, deviations=(1.0,))
    for _ in range(40):
        first = random.standard_normal()
        value = 0.5 * first + left * random.standard_normal()
        following.update(np.array([first]), value, 0.01)
    return 1.0 - following.weights[0] / following.fitted[0]


def test_a_fit_that_explains_the_values_is_used_faster_than_one_that_does_not():
    """A doubtful one that acted at once would be a feedback whose margins nobody has designed."""
    random, alike = np.random.default_rng(6), Rival((0,), 0.0, exact=False)
    good, doubtful = (missing(alike, left * NOISE, random) for left in (0.1, 10.0))
    assert doubtful > 0.2
    assert good < 0.6 * doubtful


def test_a_fit_of_few_samples_is_solved_again_sooner_than_one_of_many():
    random, found = np.random.default_rng(4), fit(Rival((0,), 0.0), deviations=(1.0,))
    solutions = []
    for _ in range(400):
        first = random.standard_normal()
        found.update(np.array([first]), 0.5 * first + NOISE * random.standard_normal(), 0.01)
        solutions.append(found.fitted[0])
    solved = np.diff(solutions) != 0.0
    assert solved[5:25].all()
    assert solved[-100:].sum() == pytest.approx(100 * 0.01 / SOLVED_EVERY, abs=3)


def test_functions_of_the_law_are_used_by_the_share_of_the_values_that_they_explain():
    """What only resembles it waits until its errors are as small as the noise."""
    most, little = NOISE, 30.0 * NOISE
    lag = {
        (exact, left): np.median(
            [
                missing(Rival((0,), 0.0, exact=exact), left, np.random.default_rng(seed))
                for seed in range(20)
            ]
        )
        for exact in (True, False)
        for left in (most, little)
    }
    assert lag[True, most] < 0.1 * lag[False, most]
    assert lag[True, most] < 0.1 * lag[True, little]
    assert lag[True, little] > 0.7 * lag[False, little]


def test_functions_of_the_law_have_to_explain_more_than_noise_by_chance():
    """A trifle of them is used as soon as it is certain, one that resembles it is left alone."""
    for exact, used in ((True, True), (False, False)):
        random, found = np.random.default_rng(8), fit(Rival((0,), 0.0, exact=exact))
        for k in range(400):
            first = random.standard_normal() if k > 300 else 0.0  # a motion that begins
            value = 0.015 * first + 0.002 * random.standard_normal()
            found.update(np.array([first, 0.0]), value, 0.01)
        assert any(found.weights) == used


@pytest.mark.parametrize(("load", "friction"), [(0.0, 0.5), (0.5, 0.0), (0.4, 0.3)])
def test_the_rest_after_a_take_over_tells_a_load_from_friction(load, friction):
    """One stroke in one direction alone has 0.18 N m of a friction of 0.5 N m as a load."""
    y, row, step = zeros(N_PLAN), zeros(N_LEARNING), 0.002
    inertia, damping = 0.05, 0.25
    learnt = TorqueAdaptation(y, row, inertia, damping, LARGEST)
    y[Y_STIFFNESS] = STIFF
    strokes = np.clip((np.arange(700) - 250) / 400.0, 0.0, 1.0)  # of 0.5 rad in 0.8 s
    for k, x in enumerate(strokes):
        position = 0.5 * x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
        speed = 0.5 / 0.8 * 30.0 * x * x * (1.0 - x) ** 2
        push = 0.5 / 0.8**2 * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)
        move_reference(y, row, k * step, position)
        beside = load + friction * np.tanh(speed / 0.02) + damping * speed + inertia * push
        if take_torque(row, step, beside, 0.0, position, speed, 0.01, STIFF, PULLS):
            learnt.update()
    found = learnt._fit.fitted
    always = found[0] + found[ZERO] * STIFF + found[GRIP] * PULLS
    assert always == pytest.approx(load, abs=0.05)
