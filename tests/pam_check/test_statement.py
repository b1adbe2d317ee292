"""The posterior under the statement of belief, and the answer of least cost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pam_check.blind.calibrate_statement import believed, calibrated
from pam_check.blind.posterior import Choice, believed_answer, least_cost, log_likelihood, posterior
from pam_check.blind.sensitivity import Campaign
from pam_check.blind.statement import STATEMENT
from pam_gap.inference.evidence import Evidence
from pam_gap.inference.score import Score

CHANNELS, BLOCKS = 3, 12


def score(effects: tuple[str, ...], over: float, unlisted: str = "") -> Score:
    """A score that leaves this multiple of an ordinary background (RMS) in every channel."""
    counts = np.full((BLOCKS, CHANNELS), 40.0)
    sums = counts * (1.0 + 100.0 * over**2)
    return Score(effects, " + ".join(effects), len(effects), sums, counts, unlisted=unlisted)


def evidence(nominal: float, *tried: Score, unlisted: tuple[Score, ...] = ()) -> Evidence[Score]:
    """A rig whose background is ten times its noise."""
    return Evidence(
        floor=np.ones(CHANNELS),
        background=np.full(CHANNELS, 100.0),
        present=np.ones(CHANNELS, dtype=bool),
        motion=np.zeros(CHANNELS),
        written=score((), nominal + 1.0),
        nominal=score((), nominal),
        tried=tried,
        singles=("creep", "hysteresis", "leakage"),
        stages=(),
        growth=(),
        unlisted=unlisted,
    )


def verdict(kept: Evidence[Score]) -> tuple[str, list[str]]:
    answer = believed_answer(kept, STATEMENT)
    assert sum(answer["probabilities"].values()) == pytest.approx(1.0)
    return answer["verdict"], answer["effects"]


def test_an_ordinary_rig_needs_no_cause() -> None:
    assert verdict(evidence(1.0, score(("creep",), 0.95))) == ("none", [])


def test_a_cause_that_removes_a_large_error_is_named() -> None:
    assert verdict(evidence(9.0, score(("creep",), 1.0), score(("leakage",), 8.0))) == (
        "named",
        ["creep"],
    )


def test_two_that_explain_alike_are_both_told() -> None:
    kept = evidence(9.0, score(("creep",), 1.0), score(("leakage",), 1.02))
    assert verdict(kept) == ("ambiguous", ["creep", "leakage"])


def test_a_second_cause_must_pay_for_its_prior() -> None:
    both = ("creep", "leakage")
    for left, named in ((1.45, ["creep"]), (0.7, ["creep", "leakage"])):
        kept = evidence(9.0, score(("creep",), 1.5), score(both, left))
        assert sorted(verdict(kept)[1]) == named


def test_what_no_law_explains_is_unknown_and_so_is_a_cause_outside_the_table() -> None:
    assert verdict(evidence(30.0, score(("creep",), 25.0))) == ("unknown", [])
    encoder = score((), 1.0, unlisted="an eccentricity of the encoder")
    assert verdict(evidence(9.0, score(("creep",), 4.0), unlisted=(encoder,))) == ("unknown", [])


def test_a_diverged_hypothesis_is_improbable() -> None:
    wild = score(("hysteresis",), np.nan)
    found = posterior(evidence(9.0, score(("creep",), 1.0), wild), STATEMENT)
    assert found["hysteresis"] < 1e-6


def test_the_likelihood_is_a_density_of_the_mean_squares() -> None:
    """With the count of its errors, it integrates to one constant whatever the usual variance."""
    sharp = replace(STATEMENT, background_spread=1e-6, law_spread=1e-6)
    grid = np.exp(np.linspace(-12.0, 12.0, 6001))
    worth = sharp.independent_errors

    def mass(background: float) -> float:
        left, none = grid[:, None], np.zeros((grid.size, 1))
        values = log_likelihood(left, none[0], np.array([background]), none, sharp)
        return float(np.log(np.trapezoid(np.exp(values) * grid ** (worth / 2.0 - 1.0), grid)))

    assert mass(1.0) == pytest.approx(mass(20.0), abs=1e-3)


def test_silence_is_chosen_where_naming_is_too_dear() -> None:
    found = {"creep": 0.45, "none": 0.4, "unknown": 0.15}
    assert least_cost(found, replace(STATEMENT, false_name=3.0)).verdict == "none"
    assert least_cost(found, replace(STATEMENT, false_name=0.2)).sets == (frozenset({"creep"}),)


def test_costs_of_an_answer() -> None:
    named = Choice("named", (frozenset({"creep", "leakage"}),))
    assert named.cost("creep + leakage", STATEMENT) == 0.0
    assert named.cost("creep", STATEMENT) == 0.5 * STATEMENT.false_name
    assert named.cost("none", STATEMENT) == STATEMENT.false_name
    assert Choice("unknown").cost("creep", STATEMENT) == STATEMENT.silence
    assert Choice("none").cost("none", STATEMENT) == 0.0


def test_calibration_lowers_the_surprise(tmp_path) -> None:
    rigs = {
        "0": ("none", [], evidence(2.5, score(("creep",), 2.4))),
        "1": ("one", ["creep"], evidence(9.0, score(("creep",), 2.8), score(("leakage",), 6.0))),
        "2": ("outside", ["backlash"], evidence(20.0, score(("creep",), 15.0))),
    }
    labels = [{"case": c, "kind": kind, "effects": e} for c, (kind, e, _) in rigs.items()]
    campaign = Campaign(tmp_path, labels, {}, {c: kept for c, (_, _, kept) in rigs.items()})
    found = calibrated([campaign])
    assert believed([campaign], found) < believed([campaign], STATEMENT)
    assert (found.nothing, found.false_name) == (STATEMENT.nothing, STATEMENT.false_name)
