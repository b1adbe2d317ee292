"""A policy is trained in the environment, and tried on the plant that no training has seen."""

from __future__ import annotations

import numpy as np
import pytest

from pam_check.control.closed_loop import true_rig
from pam_check.control.trained_policy import START, CrossEntropySearch, Policy, train, tried
from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.rig import Rig, load_rig
from pam_sim.randomisation import Randomisation
from support.rigs import ELBOW

pytestmark = pytest.mark.skipif(not HAVE_NUMBA, reason="needs the compiled plants")


@pytest.fixture(scope="module")
def rig() -> Rig:
    return load_rig(ELBOW)


def test_a_policy_opens_the_valves_towards_the_target() -> None:
    seen = np.array([[0.0, 0.0, 0.35, 0.35, 0.4], [0.0, 0.0, 0.35, 0.35, -0.4]])
    towards, away = Policy.of(np.repeat(START[None], 2, axis=0)).act(seen)
    assert towards[0] > 0.0 > towards[1]
    assert away[0] < 0.0 < away[1]
    assert np.array_equal(np.abs(towards), np.abs(away[::-1]))


@pytest.mark.long("the environment and its plant have tests of their own; this one is a search")
def test_training_brings_the_joint_to_the_target_on_the_unseen_plant(rig: Rig) -> None:
    untrained = tried(START, rig, *true_rig(rig), 3, seconds=10.0)
    numbers = train(rig, Randomisation(), CrossEntropySearch(24, 1, 8), seed=3)
    trained = tried(numbers, rig, *true_rig(rig), 3, seconds=10.0)
    assert np.array_equal(untrained.target, trained.target)
    assert trained.rms < 0.7 * untrained.rms
    assert trained.settled < 0.5 * untrained.settled
