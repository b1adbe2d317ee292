"""An ordinary background is fitted in whole diagnoses of simulated recordings, and is not named."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from pam_gap.diagnosis_engine import JointDiagnosis
from pam_gap.inference.candidates import ordinary_sizes
from pam_gap.inference.hypothesis import FitTask, Hypothesis
from pam_gap.prediction.fit import mean_squares
from pam_gap.rules import DEFAULT
from pam_gap.search.candidate_search import CandidateSearch
from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.plant.uneven_pulley import UnevenPulley
from pam_model.rig import Rig

from .conftest import Maker

needs_numba = pytest.mark.skipif(not HAVE_NUMBA, reason="a fit needs the compiled plant")


def with_few(engine: JointDiagnosis) -> JointDiagnosis:
    """The diagnosis with few effects, which is quicker."""
    few = [c for c in engine.candidates if c.effect in ("dead_volume", "position_offset")]
    engine.candidates = few
    return engine


@needs_numba
def test_a_background_that_is_fitted_down_to_the_noise_is_still_a_background(
    rig: Rig, record: Maker
) -> None:
    """Without one, the simulation alone would have to explain the recording, and cannot."""
    sizes = ordinary_sizes(rig, rig.joints[0])
    amounts = {path: 0.5 * size for _, paths, size in sizes for path in paths}
    volumes = {f"{side}.dead_volume": 6e-5 for side in ("agonist", "antagonist")}
    engine = with_few(JointDiagnosis(rig, 0, [record(amounts | volumes)]))
    assert engine.run().effects == ("dead_volume",)
    assert engine.fitter.background is not None
    clean = with_few(JointDiagnosis(rig, 0, [record(volumes)]))
    assert clean.run().effects == ("dead_volume",)
    assert clean.fitter.background is None


@needs_numba
def test_two_causes_on_a_rig_without_a_background_are_both_named(rig: Rig, record: Maker) -> None:
    """A fitted background imitated the second one, and the search ended with the first."""
    volumes = {f"{side}.dead_volume": 6e-5 for side in ("agonist", "antagonist")}
    both = volumes | {"position_offset.offset": 8e-3}
    clean = with_few(JointDiagnosis(rig, 0, [record(both)]))
    assert set(clean.run().effects) == {"dead_volume", "position_offset"}
    assert clean.fitter.background is None


@needs_numba
def test_a_background_is_no_pair_of_causes(rig: Rig, record: Maker) -> None:
    sizes = ordinary_sizes(rig, rig.joints[0])
    amounts = {path: 0.5 * size for _, paths, size in sizes for path in paths}
    volumes = {f"{side}.dead_volume": 6e-5 for side in ("agonist", "antagonist")}
    engine = with_few(JointDiagnosis(rig, 0, [record(amounts | volumes)]))
    result = CandidateSearch(engine.fitter, engine.candidates).singles()
    assert engine.effect_search().clean_explanation(result) is None
    without = with_few(JointDiagnosis(rig, 0, [record(volumes)]))
    singles = CandidateSearch(without.fitter, without.candidates).singles()
    assert without.effect_search().clean_explanation(singles) is not None


@needs_numba
def test_a_search_without_a_background_goes_on_from_the_sizes_found_with_one(
    rig: Rig, record: Maker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It took longer than everything else: all single effects were fitted to the end."""
    volumes = {f"{side}.dead_volume": 6e-5 for side in ("agonist", "antagonist")}
    engine = with_few(JointDiagnosis(rig, 0, [record(volumes)]))
    search = CandidateSearch(engine.fitter, engine.candidates)
    first = search.singles()
    engine.fitter.drop_background()
    fit_all, asked = engine.fitter.fit_all, []

    def noted(tasks: Sequence[FitTask]) -> list[Hypothesis]:
        asked.append(tasks)
        return fit_all(tasks)

    monkeypatch.setattr(engine.fitter, "fit_all", noted)
    again = search.again(first)
    at = len(engine.fitter.nuisances)
    found = {h.label: h.result.values[at:] for h in first.by_size[0]}
    for task in asked[0]:
        assert task.max_iterations == engine.rules.search.screening_steps
        assert task.cached is not None
        np.testing.assert_array_equal(task.start[at:], found[task.members[0].label])
    assert {h.label for h in again.by_size[0]} == set(found)
    assert again.by_size[0][0].effects == ("dead_volume",)
    assert search.level(again.by_size[0][0]) < 1.0


@needs_numba
def test_an_eccentric_encoder_is_no_offset_of_it(rig: Rig, record: Maker) -> None:
    recording = record()
    values = dict(recording.values)
    name = f"joint_states.{rig.joints[0].name}.position"
    values[name] = values[name] + 0.06 * np.sin(values[name] + 0.7)
    answer = with_few(JointDiagnosis(rig, 0, [replace(recording, values=values)])).run()
    assert answer.verdict == "unknown"
    assert answer.looks_like == "an eccentricity of the encoder"
    assert answer.effects == ()


@needs_numba
def test_an_eccentric_pulley_is_no_wrong_radius(rig: Rig, record: Maker) -> None:
    engine = JointDiagnosis(rig, 0, [record(arm=UnevenPulley(1.1, 0.35, -0.1, 0.02))])
    few = [c for c in engine.candidates if c.effect in ("pulley_radius", "position_offset")]
    engine.candidates = few
    answer = engine.run()
    assert answer.verdict == "unknown"
    assert "eccentric pulley" in answer.looks_like
    round_one = JointDiagnosis(rig, 0, [record({"pulley_radius.scale": 1.1})])
    round_one.candidates = few
    assert round_one.run().effects == ("pulley_radius",)


@needs_numba
def test_a_fit_removes_the_background_without_calling_it_a_cause(rig: Rig, record: Maker) -> None:
    """The friction of both muscles and of the joint acts together."""
    sizes = ordinary_sizes(rig, rig.joints[0])
    ordinary_amount = {path: 0.5 * size for _, paths, size in sizes for path in paths}
    engine = JointDiagnosis(rig, 0, [record(ordinary_amount, duration=9.0)])
    nominal = engine.fitter.fit_nominal()
    left = nominal.mean_square[2]
    simulated = mean_squares(nominal.simulated, engine.problem.counted)[2]
    assert simulated > 100.0 * engine.floor[2]
    assert engine.effect_search().far_beyond() == frozenset()
    assert left < 0.1 * simulated
    assert left < engine.floor[2] + engine.fitter.discrepancy[2]
    background = engine.fitter.background
    assert background is not None
    for part, amount in zip(background.terms.free, nominal.result.amounts, strict=True):
        assert part.low <= amount <= part.high
    hysteresis = background.beside(("hysteresis",)).slopes()
    assert not hysteresis[..., [name == "hysteresis" for name in background.effects]].any()


@needs_numba
@pytest.mark.parametrize(
    "shape",
    [
        {"creep.ratio": 0.015, "creep.time_constant": 1.0},
        {"hysteresis.amplitude": 0.012, "hysteresis.presliding_length": 0.0002},
    ],
    ids=["a bladder that relaxes within a second", "threads that slide after 0.2 mm"],
)
def test_ordinary_creep_and_friction_of_one_muscle_with_shapes_of_their_own_are_fitted(
    rig: Rig, record: Maker, shape: dict[str, float]
) -> None:
    """Neither muscles nor shapes are alike on a good rig; one common creep left a gap."""
    own = {f"agonist.{name}": value for name, value in shape.items()}
    engine = JointDiagnosis(rig, 0, [record(own, duration=9.0)])
    nominal = engine.fitter.fit_nominal()
    assert engine.fitter.bare is not None
    before, left = (
        np.sqrt(fit.mean_square[2] / engine.floor[2]) for fit in (engine.fitter.bare, nominal)
    )
    assert before > 8.0
    assert left < 0.2 * before


@needs_numba
def test_strokes_share_a_size_and_decades_of_creep_follow_a_power_law(
    rig: Rig, record: Maker
) -> None:
    engine = JointDiagnosis(rig, 0, [record(duration=9.0)])
    engine.fitter.fit_nominal()
    background = engine.fitter.background
    assert background is not None
    of: dict[str, float] = {}
    for effect, amount in zip(background.effects, background.terms.free, strict=True):
        of[effect] = of.get(effect, 0.0) + amount.prior**2
    muscles, share = 2.0, DEFAULT.decision.ordinary_share
    for effect in ("hysteresis", "leakage"):
        assert of[effect] == pytest.approx(muscles * share**2)
    decade = DEFAULT.decision.ordinary_relaxation**-DEFAULT.decision.ordinary_creep_order
    assert of["creep"] == pytest.approx(muscles * share**2 * (1.0 + decade**2 + decade**4))
    assert of["coulomb_friction"] == pytest.approx(share**2)


@needs_numba
def test_the_play_of_a_good_spool_is_no_lag_of_the_valve(rig: Rig, record: Maker) -> None:
    recording = record(duration=9.0)
    half = 0.4 * DEFAULT.decision.ordinary_spool
    played = dict(recording.values)
    for name in [key for key in played if key.startswith("valve_commands")]:
        wanted = played[name] + 0.0  # what was sent makes the spool stand where it was recorded
        direction = np.sign(np.gradient(wanted))
        played[name] = wanted + half * direction
    engine = JointDiagnosis(rig, 0, [replace(recording, values=played)])
    nominal = engine.fitter.fit_nominal()
    simulated = mean_squares(nominal.simulated, engine.problem.counted)
    assert (simulated[:2] > 2.0 * nominal.mean_square[:2]).all()
