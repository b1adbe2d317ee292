"""Effects are sought in the beginning of long recordings, and fitted to all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pam_gap.diagnosis_engine import DiagnosisOptions, JointDiagnosis
from pam_gap.inference.hypothesis import FitTask, Hypothesis, HypothesisFitter
from pam_gap.prediction.fit import Array
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.parts import part_of
from pam_gap.rules import DEFAULT
from pam_gap.search.beginning_first import search_of_the_beginning
from pam_gap.search.clean_rig import explained
from pam_gap.search.effect_search import EffectSearch
from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.rig import Rig

from .conftest import Maker

needs_numba = pytest.mark.skipif(not HAVE_NUMBA, reason="a fit needs the compiled plant")
VOLUMES = {f"{side}.dead_volume": 6e-5 for side in ("agonist", "antagonist")}
LONG = 24.0  # s


def test_errors_of_the_beginning_are_the_first_rows_of_all(rig: Rig, record: Maker) -> None:
    recordings = [record(VOLUMES, duration=9.0), record(duration=7.0)]
    whole = PredictionProblem(rig, 0, recordings)
    small = whole.beginning(4.0)
    errors, first = (one.errors(one.base.values[None])[0] for one in (whole, small))
    begins = whole.row_time < 4.0
    np.testing.assert_array_equal(first, errors[begins])
    np.testing.assert_array_equal(small.counted, whole.counted[begins])
    assert small.n_rows == begins.sum() < whole.n_rows


@needs_numba
def test_most_of_a_long_recording_is_not_simulated_for_candidates(
    rig: Rig, record: Maker, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: dict[int, int] = {}
    errors = PredictionProblem.errors

    def counted(problem: PredictionProblem, values: Array, *options: Any) -> Array:
        asked[problem.n_rows] = asked.get(problem.n_rows, 0) + len(values)
        return errors(problem, values, *options)

    monkeypatch.setattr(PredictionProblem, "errors", counted)
    long = record(VOLUMES, duration=LONG)
    rules = replace(DEFAULT, search=replace(DEFAULT.search, search_rows=5000))
    whole = JointDiagnosis(rig, 0, [long], DiagnosisOptions(rules=rules)).effect_search()
    assert search_of_the_beginning(whole) is None  # too few rows
    engine = JointDiagnosis(rig, 0, [long])
    few = [c for c in engine.candidates if c.effect in ("dead_volume", "leakage", "payload")]
    engine.candidates = few
    small = search_of_the_beginning(engine.effect_search())
    assert small is not None
    asked.clear()
    found = engine.search()
    assert found.by_size[0][0].effects == ("dead_volume",)
    assert {h.result.errors.shape[0] for h in found.by_size[0]} == {engine.problem.n_rows}
    assert set(found.singles) == {c.effect for c in few}
    assert asked[small.problem.n_rows] > 2 * asked[engine.problem.n_rows]
    # It says how much it simulated in whole recordings.
    share = small.problem.n_rows / engine.problem.n_rows
    simulated = asked[engine.problem.n_rows] + share * asked[small.problem.n_rows]
    assert engine.problem.simulations < simulated + 200.0


@needs_numba
def test_unknown_is_said_only_after_a_search_in_all_data(rig: Rig, record: Maker) -> None:
    """A measured pair of muscles was `unknown`: its beginning did not show what all of it does."""
    told: list[str] = []
    rules = replace(DEFAULT, search=replace(DEFAULT.search, search_rows=500))
    options = DiagnosisOptions(rules=rules, progress=lambda task, share: told.append(task))
    for effect, verdict, times in (("dead_volume", "named", 0), ("payload", "unknown", 1)):
        told.clear()
        engine = JointDiagnosis(rig, 0, [record(VOLUMES, duration=LONG)], options)
        engine.candidates = [c for c in engine.candidates if c.effect in (effect, "leakage")]
        assert engine.run().verdict == verdict
        assert told.count("seeking effects in all data") == times
        assert engine.is_from_the_beginning is (times == 0)


@pytest.mark.parametrize(("probability", "times"), [(0.45, 2), (0.8, 1)])
def test_a_none_that_is_more_probably_wrong_is_sought_again(
    rig: Rig, record: Maker, monkeypatch: pytest.MonkeyPatch, probability: float, times: int
) -> None:
    """A pair of muscles, off by half of its range, was `none` with 0.32 and `unknown` with 0.32."""
    engine = JointDiagnosis(rig, 0, [record(VOLUMES, duration=LONG)])
    verdict = SimpleNamespace(verdict="none", probabilities={"none": probability})
    searches: list[bool] = []

    def search(*, in_all_data: bool = False) -> None:
        searches.append(in_all_data)
        engine.is_from_the_beginning = not in_all_data

    monkeypatch.setattr(engine, "search", search)
    monkeypatch.setattr(engine, "decided", lambda _: (None, verdict, None))
    engine.searched()
    assert searches == [False, True][:times]


@needs_numba
def test_a_beginning_without_the_motion_of_the_rest_is_not_enough(rig: Rig, record: Maker) -> None:
    moving = record(VOLUMES, duration=12.0)
    still = {name: np.full(4000, value[0]) for name, value in moving.values.items()}
    values = {name: np.append(still[name], value) for name, value in moving.values.items()}
    count = 4000 + moving.time.size
    recording = replace(
        moving,
        time=moving.sample_time * np.arange(count),
        values=values,
        valid={name: np.ones(count, dtype=np.bool_) for name in values},
    )
    rules = replace(DEFAULT, search=replace(DEFAULT.search, search_rows=1))
    engine = JointDiagnosis(rig, 0, [recording], DiagnosisOptions(rules=rules))
    assert search_of_the_beginning(engine.effect_search()) is None
    short = JointDiagnosis(rig, 0, [part_of(recording, 4000, count)], DiagnosisOptions(rules=rules))
    assert search_of_the_beginning(short.effect_search()) is None  # it is short


@needs_numba
@pytest.mark.parametrize("everywhere", [True, False])
def test_a_beginning_without_a_background_must_be_confirmed_by_all_data(
    rig: Rig, record: Maker, *, everywhere: bool
) -> None:
    engine = JointDiagnosis(rig, 0, [record(VOLUMES, duration=7.0)])
    few = [c for c in engine.candidates if c.effect == "dead_volume"]
    fitter, confirms = engine.fitter, lambda _: everywhere
    EffectSearch(fitter, engine.folds, engine.judge, few, confirms=confirms).begin()
    assert (fitter.background is None) is everywhere


@pytest.mark.parametrize(
    ("left", "fits", "answer"),
    [
        ((0.5, 0.3), 2, False),  # does not halve
        ((0.5, 0.2, 0.01), 3, True),
        ((0.01,), 1, True),
        ((0.5, 0.2, 0.09, 0.04), 4, False),  # the most steps
    ],
)
def test_a_pair_that_does_not_converge_is_given_up(
    left: tuple[float, ...], fits: int, answer: bool
) -> None:
    shares = iter(left)
    asked = []

    def fit_all(tasks: Sequence[FitTask]) -> list[Hypothesis]:
        asked.append(tasks)
        result = SimpleNamespace(values=np.zeros(0), jacobian=np.zeros((1, 5, 0)), simulated=None)
        return [cast(Hypothesis, SimpleNamespace(members=(), result=result, mean_square=0.0))]

    fitter = cast(HypothesisFitter, SimpleNamespace(rules=DEFAULT, fit_all=fit_all))
    task = FitTask((), np.zeros(0), DEFAULT.search.clean_steps, is_bare=True)
    assert (explained(fitter, task, lambda _: next(shares)) is not None) is answer
    assert len(asked) == fits
