"""What was learnt acts by the share that has helped lately."""

import numpy as np
import pytest

from pam_control.adaptation.averaged_fit import AveragedFit, Rival
from pam_control.adaptation.forgetting_fit import new_state
from pam_control.adaptation.normal_equations import SHARE
from pam_control.adaptation.recursive_fit import RecursiveFit
from pam_control.adaptation.running_comparison import WINDOW, compare, memory_of

STEP = 0.01  # s
TRIFLE = 0.01


def compared(true_share, seconds, noise=0.0, size=1.0):
    """The share by a comparison of expectations of which a share comes true."""
    random, state = np.random.default_rng(3), new_state()
    for _ in range(round(seconds / STEP)):
        expected = size * random.standard_normal()
        value = true_share * expected + noise * random.standard_normal()
        compare(state, TRIFLE, expected, value, STEP)
    return state[SHARE]


@pytest.mark.parametrize(
    ("true_share", "share"), [(1.0, 1.0), (0.5, 0.5), (0.0, 0.0), (-0.7, 0.0), (1.6, 1.0)]
)
def test_the_share_is_what_has_helped_within_what_can_help(true_share, share):
    assert compared(true_share, 2.0) == pytest.approx(share, abs=0.01)


def test_before_anything_was_expected_and_for_trifles_nothing_is_taken_back():
    assert new_state()[SHARE] == 1.0
    assert compared(0.0, 2.0, size=0.1 * TRIFLE) > 0.95


def test_noise_takes_little_back():
    assert compared(1.0, 3.0, noise=0.5) > 0.85


def test_the_memory_shrinks_with_the_share_and_never_to_nothing():
    state = new_state()
    assert memory_of(state, 15.0) == 15.0
    for _ in range(300):
        compare(state, TRIFLE, 1.0, 0.0, STEP)
    assert 2.0 * WINDOW < memory_of(state, 15.0) < 1.0


def averaged():
    return AveragedFit((1.0,), [Rival((0,), 0.0)], 0.02, 0.0, TRIFLE, {})


def recursive():
    return RecursiveFit((1.0,), 0.02, TRIFLE)


@pytest.mark.parametrize("fit", [averaged, recursive])
def test_either_fit_takes_back_within_a_second_what_took_a_minute_to_learn(fit):
    random, learnt = np.random.default_rng(4), fit()

    def goes_on(weight, seconds):
        for _ in range(round(seconds / STEP)):
            function = random.standard_normal()
            learnt.update(np.array([function]), weight * function, STEP)
        return learnt.weights[0]

    assert goes_on(0.6, 60.0) == pytest.approx(0.6, abs=0.02)
    assert abs(goes_on(0.0, 1.0)) < 0.05, "a fit over 15 s alone would have 0.56"
    assert goes_on(0.4, 2.0) == pytest.approx(0.4, abs=0.05), "and another weight is learnt"
