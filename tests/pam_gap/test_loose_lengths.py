"""An error that re-tuned lengths explain comes with a caution if nobody stated their tolerance."""

from dataclasses import replace

import numpy as np
import pytest

import pam_gap
from pam_gap.inference.hypothesis import HypothesisFitter
from pam_gap.inference.loose_lengths import (
    LooseLengths,
    as_measured,
    loose_lengths,
    shared_probabilities,
)
from pam_gap.inference.probabilities import cause_probabilities
from pam_gap.prediction.problem import PredictionProblem
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.written_numbers import LENGTHS
from pam_model.rig import Rig

from .conftest import Maker


def lengths(rig: Rig, record: Maker, changes: dict[str, float]) -> LooseLengths | None:
    problem = PredictionProblem(rig, 0, [record(changes)])
    fitter = HypothesisFitter(problem, np.ones(5))
    return loose_lengths(fitter, fitter.fit_nominal())


def test_an_offset_that_lengths_explain_comes_with_a_caution(rig: Rig, record: Maker) -> None:
    loose = replace(rig, parameter_tolerance=0.05)
    found = lengths(loose, record, {"position_offset.offset": 0.06})
    assert found is not None
    told = found.caution
    assert "length_tolerance" in told
    assert "joint_states.elbow.position" in told
    assert "wrong by 5 %" in told
    tight = replace(loose, length_tolerance=0.005)
    assert lengths(tight, record, {"position_offset.offset": 0.06}) is None


@pytest.mark.parametrize("changes", [{}, {"coulomb_friction.torque": 0.6}])
def test_lengths_that_explain_little_are_not_told(
    rig: Rig, record: Maker, changes: dict[str, float]
) -> None:
    assert lengths(replace(rig, parameter_tolerance=0.02), record, changes) is None


@pytest.mark.long("a whole search, as the one below, which stays")
def test_an_offset_is_named_with_lengths_of_which_no_tolerance_is_stated(
    rig: Rig, record: Maker
) -> None:
    """Lengths within 5 % explained an offset of 0.06 rad, and the answer was `none`."""
    loose = replace(rig, parameter_tolerance=0.05)
    (answer,) = pam_gap.diagnose(record({"position_offset.offset": 0.06}), loose, threads=1)
    assert "position_offset" in answer.effects
    assert sum(answer.probabilities.values()) == pytest.approx(1.0)
    assert answer.cause_probabilities["position_offset"] < 0.999
    assert any("lengths within 0.5 %, as a ruler gives them" in c for c in answer.cautions)


def test_wrong_lengths_are_not_named_as_an_offset(rig: Rig, record: Maker) -> None:
    loose = replace(rig, parameter_tolerance=0.05)
    lengths = {f"{side}.{key}": 1.0 for side in ("agonist", "antagonist") for key in LENGTHS}
    written = PlantParameters.from_rig(rig)
    factors = np.random.default_rng(4).uniform(0.97, 1.03, len(lengths))
    changes = {
        name: written[name] * f
        for name, f in zip(lengths, factors, strict=True)
        if written[name] != 0.0
    }
    (answer,) = pam_gap.diagnose(record(changes), loose, threads=1)
    assert "position_offset" not in answer.effects
    assert answer.cause_probabilities.get("position_offset", 0.0) < 0.5
    assert answer.verdict == "none" or answer.cautions


def test_the_probabilities_of_both_views_of_the_lengths_are_mixed() -> None:
    tight = {"position_offset + valve_lag": 0.9, "none": 0.1}
    loose = {"valve_lag": 0.95, "none": 0.05}
    mixed = shared_probabilities(tight, loose, 0.4)
    assert sum(mixed.values()) == pytest.approx(1.0)
    assert mixed["position_offset + valve_lag"] == pytest.approx(0.54)
    both = cause_probabilities(mixed, {"valve_lag", "position_offset"})
    assert both["valve_lag"] == pytest.approx(0.92)
    assert both["position_offset"] == pytest.approx(0.54)


def test_lengths_are_tightened_only_where_nothing_is_stated(rig: Rig) -> None:
    loose = replace(rig, parameter_tolerance=0.05)
    assert as_measured(loose).length_tolerance == 0.005
    assert as_measured(replace(rig, parameter_tolerance=0.002)).length_tolerance == 0.002
    stated = replace(loose, length_tolerance=0.03)
    assert as_measured(stated) is stated
