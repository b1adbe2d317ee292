"""Fits to a part of the data, which the score on the rest is judged by."""

import numpy as np
import pytest

from pam_gap.inference.candidates import candidates_for
from pam_gap.inference.hypothesis import FitTask, HypothesisFitter
from pam_gap.prediction.channel_order import BOTH_PRESSURES
from pam_gap.prediction.problem import PredictionProblem
from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.rig import Rig

from .conftest import Maker

needs_numba = pytest.mark.skipif(not HAVE_NUMBA, reason="a fit needs the compiled plant")
SIDES = ("agonist", "antagonist")
NARROW = {f"{side}.exhaust_restriction.ratio": 0.6 for side in SIDES}
UNKNOWN = {f"{side}.valve_null_offset.offset": 0.1 for side in SIDES}


@needs_numba
def test_an_effect_that_a_part_does_not_show_keeps_its_size_there(rig: Rig, record: Maker) -> None:
    """The half of a recording that does not vent says nothing of a narrow exhaust."""
    problem = PredictionProblem(rig, 0, [record(NARROW | UNKNOWN)])
    fitter = HypothesisFitter(problem, np.ones(5))
    fitter.fit_nominal()
    one = next(c for c in candidates_for(rig, rig.joints[0]) if c.effect == "exhaust_restriction")
    h = fitter.fit((one,), np.array(one.starts[0]), max_iterations=16)
    pressures = problem.data[0].rows(problem.data[0].measured)[:, BOTH_PRESSURES]
    filling = problem.counted & (np.gradient(pressures, axis=0) > -50.0).all(axis=1)
    free, stays = (
        np.abs(fit.result.values - h.result.values).max()
        for fit in fitter.fit_all(
            [FitTask.further(h, 8, rows=filling, stays=stays) for stays in (False, True)]
        )
    )
    assert free > 0.25
    assert stays < 0.5 * free


@needs_numba
def test_what_a_part_shows_is_fitted_to_it(rig: Rig, record: Maker) -> None:
    """Only what the part says nothing of stays."""
    problem = PredictionProblem(rig, 0, [record(NARROW)])
    fitter = HypothesisFitter(problem, np.ones(5))
    fitter.fit_nominal()
    one = next(c for c in candidates_for(rig, rig.joints[0]) if c.effect == "exhaust_restriction")
    task = FitTask((one,), np.array(one.starts[0]), 8, problem.row_time > 4.0, stays=True)
    assert fitter.fit_all([task])[0].result.values == pytest.approx([0.6, 0.6], abs=0.02)
