"""A supply that sags is found from the flows of all valves, and only if they are a surprise."""

import math

import numpy as np
import pytest

from pam_control.adaptation.recursive_fit import RecursiveFit
from pam_control.adaptation.supply_watch import LARGEST_SLOPE, N_SAG, P_ACTS, flow_slope, learn_sag
from pam_model.gas import reference_flow

SINCE = 0.02
NOISE = 0.01


@pytest.mark.parametrize("ratio", [0.2, 0.4, 0.7, 0.9])
def test_the_slope_is_that_of_the_flow_by_iso_6358(ratio):
    critical, supply = 0.3, 7e5

    def flow(before):
        return reference_flow(4e-9, critical, before, ratio * supply)

    change = 1e-5
    slope = (flow(supply * (1 + change)) - flow(supply * (1 - change))) / (
        2 * change * flow(supply)
    )
    assert flow_slope(ratio, critical) == pytest.approx(min(slope, LARGEST_SLOPE), rel=1e-4)


def watched(sags, slope=0.4, variance=NOISE**2, row=None):
    """The sag that acts after each sample of a valve whose flow the true sags take away."""
    row, acts = row or [0.0] * N_SAG, []
    for sag in sags:
        learn_sag(row, slope * (sag - row[P_ACTS]), slope, variance, SINCE)
        acts.append(row[P_ACTS])
    return np.array(acts)


def test_a_sag_is_found_within_half_a_second_and_given_back():
    acts = watched([0.0] * 20 + [-0.25] * 100 + [0.0] * 100)
    assert np.all(acts[:20] == 0.0)
    assert acts[45] < -0.18
    assert acts[115] == pytest.approx(-0.25, abs=0.03)
    assert acts[-1] > -0.03


def test_a_flow_that_its_fit_holds_possible_is_no_sag():
    assert np.all(watched([-0.25] * 200, variance=0.1**2) == 0.0)


def test_noise_is_no_sag():
    random = np.random.default_rng(3)
    acts = watched(NOISE * random.standard_normal(3000))
    assert np.all(acts == 0.0)


def test_more_than_was_promised_is_no_sag():
    assert np.all(watched([0.3] * 100) == 0.0)


def test_another_valve_knows_of_it_at_once():
    row = [0.0] * N_SAG
    watched([0.0] * 20 + [-0.25] * 60, row=row)
    assert watched([-0.25], slope=0.2, row=row)[0] < -0.2


def test_the_fit_states_how_well_it_promises_a_flow():
    """Large before anything was seen, small along what was seen, large beside it."""
    fit = RecursiveFit((0.3, 0.3), NOISE, 0.003)
    along, beside = [0.4, 0.0], [0.0, 0.4]
    before = fit.variance(along)
    assert math.sqrt(before) == pytest.approx(0.12, rel=0.05)
    random = np.random.default_rng(1)
    for _ in range(200):
        fit.update(along, 0.04 + NOISE * random.standard_normal(), SINCE)
    assert fit.variance(along) < 0.05 * before
    assert fit.variance(beside) == pytest.approx(before, rel=0.3)
