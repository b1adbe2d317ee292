"""A policy is trained in the environment, and tried on the plant that no training has seen."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pam_check.control import trained_policy
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


def test_the_search_ends_at_the_best_numbers(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    """With numbers that are judged by themselves, without a robot."""
    best = START + np.array([0.5, -0.4, 0.3, 0.0, -0.2])

    def judged(numbers: np.ndarray) -> tuple[object, ...]:
        count = len(numbers)
        return None, -((numbers - best) ** 2).sum(axis=1), None, np.full(count, True), {}

    acts = SimpleNamespace(of=lambda numbers: SimpleNamespace(act=lambda _: numbers))
    robots = SimpleNamespace(reset=lambda seed: (None, {}), step=judged)
    monkeypatch.setattr(trained_policy, "Policy", acts)
    monkeypatch.setattr(trained_policy, "PamVectorEnv", lambda *_: robots)
    found = train(rig, Randomisation(), CrossEntropySearch(48, 2, 15), seed=3)
    assert np.abs(found - best).max() < 0.03


@pytest.mark.long("the environment, its plant and the search have tests of their own")
def test_training_brings_the_joint_to_the_target_on_the_unseen_plant(rig: Rig) -> None:
    untrained = tried(START, rig, *true_rig(rig), 3, seconds=10.0)
    numbers = train(rig, Randomisation(), CrossEntropySearch(24, 1, 8), seed=3)
    trained = tried(numbers, rig, *true_rig(rig), 3, seconds=10.0)
    assert np.array_equal(untrained.target, trained.target)
    assert trained.rms < 0.7 * untrained.rms
    assert trained.settled < 0.5 * untrained.settled
