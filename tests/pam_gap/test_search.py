"""The search of causes: simple laws beside richer ones, and sizes at the end of their range."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pytest

from pam_gap.answer.sentences import rivals_at_the_end, sizes_at_the_end
from pam_gap.inference.candidates import Candidate, candidates_for
from pam_gap.inference.hypothesis import FitTask, Hypothesis, HypothesisFitter
from pam_gap.prediction.fit import PlantFit
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.rules import DEFAULT
from pam_gap.search.candidate_search import CandidateSearch
from pam_gap.search.effect_search import EffectSearch
from pam_model.rig import Rig

DRY = {"coulomb_friction.torque": 0.6, "pulley_radius.scale": 1.15}
FALLING = {
    "stribeck_friction.static_torque": 1.2,
    "stribeck_friction.torque": 0.4,
    "stribeck_friction.speed": 0.1,
    "pulley_radius.scale": 1.15,
}


def candidate(rig: Rig, effect: str) -> Candidate:
    return next(c for c in candidates_for(rig, rig.joints[0]) if c.effect == effect)


def with_values(one: Candidate, values: dict[str, float]) -> Hypothesis:
    start = [values.get(p.name, v) for p, v in zip(one.free, one.starts[0], strict=True)]
    none = np.zeros((1, 5))
    result = PlantFit(np.array(start), none, 0.0, np.zeros((1, 5, len(start))), 1)
    return Hypothesis((one,), result, np.zeros(5))


def test_a_richer_law_beside_another_cause_is_compared_with_its_simpler_law(
    rig: Rig, record
) -> None:
    problem = PredictionProblem(rig, 0, [record(DRY)])
    fitter = HypothesisFitter(problem, np.ones(5))
    fitter.fit_nominal()
    fitter.drop_background()
    rich, radius = (candidate(rig, name) for name in ("stribeck_friction", "pulley_radius"))
    search = CandidateSearch(fitter, candidates_for(rig, rig.joints[0]))
    start = np.concatenate([rich.starts[0], [1.15]])
    pair = fitter.fit((rich, radius), start, max_iterations=8)
    (simple,) = search._twins([pair])
    assert simple.effects == ("coulomb_friction", "pulley_radius")
    assert search.level(simple) < search.level(pair) + 0.1
    torque = dict(zip((p.name for p in simple.members[0].free), simple.result.values, strict=False))
    assert torque["torque"] == pytest.approx(0.6, rel=0.1)


def test_a_simple_law_beside_another_cause_is_compared_with_its_richer_law(
    rig: Rig, record
) -> None:
    """The simple law may have been found first, and the other cause beside it."""
    problem = PredictionProblem(rig, 0, [record(FALLING)])
    fitter = HypothesisFitter(problem, np.ones(5))
    fitter.fit_nominal()
    fitter.drop_background()
    dry, radius = (candidate(rig, name) for name in ("coulomb_friction", "pulley_radius"))
    search = CandidateSearch(fitter, candidates_for(rig, rig.joints[0]))
    start = np.concatenate([dry.starts[0], [1.15]])
    pair = fitter.fit((dry, radius), start, max_iterations=8)
    rich = min(search._twins([pair]), key=search.level)
    assert rich.effects == ("stribeck_friction", "pulley_radius")
    assert search.level(rich) < search.level(pair) - 1.0


class FitsByName:
    """Fits whose errors depend on nothing but their effects."""

    def __init__(self, left: dict[frozenset[str], float]) -> None:
        self.left = left
        self.rules = DEFAULT
        self.problem = SimpleNamespace(present=np.ones(5, dtype=bool))
        self.floor = np.ones(5)
        self.nuisances = ()

    def fit_all(self, tasks: Sequence[FitTask]) -> list[Hypothesis]:
        found = []
        for task in tasks:
            mean = np.full(5, self.left.get(frozenset(m.effect for m in task.members), 30.0))
            slopes = np.zeros((1, 5, len(task.start)))
            result = PlantFit(np.asarray(task.start), np.zeros((1, 5)), 0.0, slopes, 1)
            found.append(Hypothesis(task.members, result, mean))
        return found

    def fit_nominal(self) -> Hypothesis:
        return self.fit_all([FitTask((), np.zeros(0), 0)])[0]

    def from_the_rig_file(self, values: np.ndarray) -> np.ndarray:
        return values


def test_two_large_causes_are_found_although_a_third_effect_explains_most_alone(rig: Rig) -> None:
    """A dead volume and a bladder were taken for an extensible braid and a hysteresis."""
    causes = frozenset(["bladder_elasticity", "dead_volume"])
    fits = FitsByName({frozenset(["braid_extensibility"]): 12.0, causes: 1.0}
        | {frozenset(["braid_extensibility", c]): 10.0 for c in causes | {"creep", "hysteresis"}}
        | {frozenset([c]): 15.0 for c in causes | {"creep"}})  # fmt: skip
    candidates = candidates_for(rig, rig.joints[0])
    judge = SimpleNamespace(background=np.zeros(5), motion=np.zeros(5))
    search = EffectSearch(fits, None, judge, candidates)  # type: ignore[arg-type]
    result = search.singles.singles()
    assert result.by_size[0][0].effects == ("braid_extensibility",)
    search.grow(result, (0.4, 0.75))
    assert frozenset(result.by_size[1][0].effects) == causes


def test_a_size_at_the_end_of_its_range_is_a_caution(rig: Rig) -> None:
    payload = candidate(rig, "payload")
    largest = next(p.high for p in payload.free if p.name == "mass")
    ((effect, name, value, unit),) = with_values(payload, {"mass": largest}).at_the_end
    assert (effect, name, value, unit) == ("payload", "mass", largest, "kg")
    assert not with_values(payload, {"mass": 0.5 * largest}).at_the_end
    (caution,) = sizes_at_the_end([(effect, name, value, unit)])
    assert "payload" in caution
    assert f"mass {largest:.2g} kg" in caution


def test_a_rival_at_the_end_of_its_range_is_told(rig: Rig) -> None:
    """Its size may only be limited by the table, and the probability of the cause not know it."""
    caps = candidate(rig, "end_caps")
    largest = caps.free[0]
    at_end = with_values(caps, {p.name: 1.0 for p in caps.free} | {largest.name: largest.high})
    (caution,) = rivals_at_the_end([at_end.at_the_end, at_end.at_the_end])
    assert caution.count("end caps (") == 1
    assert f"{largest.high:.2g}" in caution and "also remove most of the gap" in caution
    assert rivals_at_the_end([]) == ()


def test_a_size_that_stands_for_no_effect_is_no_caution(rig: Rig) -> None:
    delay = candidate(rig, "command_delay")
    values = {p.name: 0.0 for p in delay.free}
    assert not with_values(delay, values).at_the_end
    values[delay.free[0].name] = delay.free[0].high
    assert [name for _, name, *_ in with_values(delay, values).at_the_end] == [delay.free[0].name]
