"""An error that re-tuned lengths explain comes with a caution if nobody stated their tolerance."""

from dataclasses import replace

import numpy as np
import pytest

from pam_gap.inference.hypothesis import HypothesisFitter
from pam_gap.inference.loose_lengths import loose_lengths
from pam_gap.prediction.problem import PredictionProblem
from pam_model.rig import Rig

from .conftest import Maker


def cautions(rig: Rig, record: Maker, changes: dict[str, float]) -> tuple[str, ...]:
    problem = PredictionProblem(rig, 0, [record(changes)])
    fitter = HypothesisFitter(problem, np.ones(5))
    return loose_lengths(fitter, fitter.fit_nominal())


def test_an_offset_that_lengths_explain_comes_with_a_caution(rig: Rig, record: Maker) -> None:
    loose = replace(rig, parameter_tolerance=0.05)
    (told,) = cautions(loose, record, {"position_offset.offset": 0.06})
    assert "length_tolerance" in told
    assert "joint_states.elbow.position" in told
    assert "wrong by 5 %" in told
    tight = replace(loose, length_tolerance=0.005)
    assert cautions(tight, record, {"position_offset.offset": 0.06}) == ()


@pytest.mark.parametrize("changes", [{}, {"coulomb_friction.torque": 0.6}])
def test_lengths_that_explain_little_are_not_told(
    rig: Rig, record: Maker, changes: dict[str, float]
) -> None:
    assert cautions(replace(rig, parameter_tolerance=0.02), record, changes) == ()
