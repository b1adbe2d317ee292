"""The improved rig file holds ordinary effects beside the causes, and never makes a rig worse."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pam_gap.answer.write_answer import AnswerForm
from pam_gap.diagnosis_engine import NOT_IMPROVED, JointDiagnosis
from pam_gap.inference.candidates import candidates_for, ordinary_sizes
from pam_gap.inference.confidence import NORMAL_90
from pam_gap.inference.held_out import HeldOut, score_held_out
from pam_gap.inference.hypothesis import FitTask
from pam_gap.inference.improved_fit import improved_fit, left_over, ordinary_members
from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.rig import Rig

from .conftest import Maker

needs_numba = pytest.mark.skipif(not HAVE_NUMBA, reason="a fit needs the compiled plant")
SHARE = 0.7  # of the largest ordinary size of every effect
DELAY = {f"{side}.command_delay.delay": 0.01 for side in ("agonist", "antagonist")}


def ordinary(rig: Rig) -> dict[str, float]:
    """A share of the largest ordinary size of every effect."""
    sizes = ordinary_sizes(rig, rig.joints[0])
    return {path: SHARE * size for _, paths, size in sizes for path in paths}


def chosen_fit(engine: JointDiagnosis, effect: str) -> HeldOut:
    """The fit of one cause beside an ordinary background, with its score."""
    engine.fitter.fit_nominal()
    member = next(c for c in engine.candidates if c.effect == effect)
    task = FitTask((member,), np.array(member.starts[0]), 8)
    return score_held_out(engine.fitter, engine.folds, engine.fitter.fit_all([task])[0])


@needs_numba
def test_ordinary_effects_that_a_verdict_takes_for_background_stand_in_the_improved_rig(
    rig: Rig, record: Maker
) -> None:
    engine = JointDiagnosis(rig, 0, [record(ordinary(rig) | DELAY, duration=14.0)])
    chosen = chosen_fit(engine, "command_delay")
    written = engine.written()
    shown = improved_fit(engine.fitter, engine.folds, chosen, engine.candidates, written)
    assert shown is not None
    assert shown.effects[0] == "command_delay"
    assert {"hysteresis", "creep"} < set(shown.ordinary)
    alone = FitTask(chosen.hypothesis.members, chosen.hypothesis.result.values, 8, is_bare=True)
    bare = score_held_out(engine.fitter, engine.folds, engine.fitter.fit_all([alone])[0])
    present = engine.present
    assert left_over(shown, present) < 0.5 * left_over(bare, present)
    at = sum(len(member.free) for member in shown.hypothesis.members[:1])
    for member in shown.hypothesis.members[1:]:
        values = shown.hypothesis.result.values[at : at + len(member.free)]
        at += len(member.free)
        for value, (neutral, reach) in zip(values, member.ordinary, strict=True):
            assert reach == 0.0 or neutral <= value <= neutral + reach


@needs_numba
def test_an_effect_that_the_rig_file_states_gets_no_ordinary_size(rig: Rig, record: Maker) -> None:
    recording = record(DELAY, duration=9.0)
    joint = replace(rig.joints[0], effects={"coulomb_friction": {"torque": 0.3}})
    engine = JointDiagnosis(rig.with_joint(joint), 0, [recording])
    chosen = chosen_fit(engine, "command_delay").hypothesis
    background = engine.fitter.background
    assert background is not None
    full = np.ones(len(background.effects))
    all_of_it = replace(chosen, result=replace(chosen.result, amounts=full))
    members, starts = ordinary_members(
        engine.fitter, background, all_of_it, candidates_for(rig, rig.joints[0])
    )
    assert {m.effect for m in members} == {"hysteresis", "creep", "leakage"}
    assert starts.size == sum(len(m.free) for m in members)


@needs_numba
def test_the_start_of_an_ordinary_size_is_the_mean_of_both_muscles(rig: Rig, record: Maker) -> None:
    engine = JointDiagnosis(rig, 0, [record(DELAY, duration=9.0)])
    chosen = chosen_fit(engine, "command_delay").hypothesis
    background = engine.fitter.background
    assert background is not None
    leakage = np.array([0.4 * (effect == "leakage") for effect in background.effects])
    fit = replace(chosen, result=replace(chosen.result, amounts=leakage))
    members, starts = ordinary_members(
        engine.fitter, background, fit, candidates_for(rig, rig.joints[0])
    )
    [member] = [m for m in members if m.effect == "leakage"]
    for start, (neutral, reach) in zip(starts[: len(member.free)], member.ordinary, strict=True):
        assert start == pytest.approx(neutral + 0.4 * reach)


def test_what_a_good_rig_has_less_of_starts_below_its_neutral_value(rig: Rig) -> None:
    """The exhaust of a good regulator lets up to half less air through than its supply path."""
    for muscle in rig.muscles:
        valve = replace(muscle.valve, kind="pressure_regulator", full_scale=muscle.max_pressure)
        rig = rig.with_muscle(replace(muscle, valve=valve))
    problem = SimpleNamespace(rig=rig, joint=0, sides=("agonist", "antagonist"))
    found = SimpleNamespace(result=SimpleNamespace(amounts=np.array([0.4, 0.8])), effects=())
    background = SimpleNamespace(effects=("exhaust_restriction",) * 2)
    [member], starts = ordinary_members(
        SimpleNamespace(problem=problem), background, found, candidates_for(rig, rig.joints[0])
    )
    assert member.effect == "exhaust_restriction"
    assert starts == pytest.approx(2 * [1.0 - 0.6 * 0.5])
    assert {(one.low, one.high) for one in member.free} == {(0.5, 1.0)}


@needs_numba
def test_no_improved_rig_is_written_that_is_worse_than_the_rig_file(
    rig: Rig, record: Maker
) -> None:
    engine = JointDiagnosis(rig, 0, [record(duration=9.0)])
    written = engine.written()
    worse = replace(written, sums=2.0 * written.sums)
    better = replace(written, sums=0.5 * written.sums)
    fitter, folds = engine.fitter, engine.folds
    assert improved_fit(fitter, folds, worse, engine.candidates, written) is None
    assert improved_fit(fitter, folds, better, engine.candidates, written) is better
    assert "no improved rig file" in NOT_IMPROVED


@needs_numba
def test_the_interval_of_a_parameter_spans_both_fits_and_the_accuracy_of_the_laws(
    rig: Rig, record: Maker
) -> None:
    engine = JointDiagnosis(rig, 0, [record(ordinary(rig) | DELAY, duration=9.0)])
    score = chosen_fit(engine, "command_delay")
    written = engine.written()
    improved = improved_fit(engine.fitter, engine.folds, score, engine.candidates, written)
    assert improved is not None
    shown, chosen = improved.hypothesis, score.hypothesis
    judged = SimpleNamespace(judge=engine.judge)
    form = AnswerForm(engine.fitter, engine.folds, SimpleNamespace(), judged)
    stated = form.parameters(shown, chosen)["command_delay"]
    first, second = form.intervals(shown), form.intervals(chosen)
    assert set(stated) == {"delay.agonist", "delay.antagonist"}
    for name, parameter in stated.items():
        one, other = (fit["command_delay", name] for fit in (first, second))
        assert one.value != other.value
        found = parameter.interval
        assert found.value == one.value
        exact = NORMAL_90 * form.judge.rules.statement.sharp_law_error * one.value
        assert found.low == min(one.low, other.low, one.value - exact)
        assert found.high == max(one.high, other.high, one.value + exact)
        assert found.low <= DELAY[f"{name.split('.')[1]}.command_delay.delay"] <= found.high
