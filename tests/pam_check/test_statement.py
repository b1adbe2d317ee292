"""The posterior under the statement of belief, and the answer of least cost."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from pam_check.blind.calibrate_statement import believed, calibrated
from pam_check.blind.sensitivity import Campaign
from pam_gap.inference.decide import decide
from pam_gap.inference.evidence import Evidence
from pam_gap.inference.posterior import Choice, least_cost, log_likelihood, posterior
from pam_gap.inference.probabilities import cause_probabilities
from pam_gap.inference.score import Score
from pam_gap.rules import DEFAULT
from pam_gap.rules.statement import STATEMENT
from pam_model.effects import EFFECTS

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
        unlisted=unlisted,
    )


def verdict(kept: Evidence[Score]) -> tuple[str, list[str]]:
    answer = decide(kept, DEFAULT)
    assert sum(answer.probabilities.values()) == pytest.approx(1.0)
    return answer.verdict, list(answer.effects)


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


def test_the_more_probable_cause_comes_first_though_its_set_is_less_probable() -> None:
    """Leakage alone explains a little more than creep alone; with a second cause, creep does."""
    both = score(("creep", "hysteresis"), 0.65)
    found = decide(evidence(9.0, score(("creep",), 1.02), score(("leakage",), 1.0), both), DEFAULT)
    causes = dict(found.candidates)
    assert found.probabilities["leakage"] > found.probabilities["creep"]
    assert causes["creep"] > causes["leakage"]
    assert found.effects[0] == "creep"
    assert "leakage" in found.effects
    assert found.chosen is both  # the more probable set of the two with creep


def test_with_or_without_a_second_cause_is_one_answer() -> None:
    both = score(("creep", "leakage"), 0.85)
    found = decide(evidence(9.0, score(("creep",), 1.15), both), DEFAULT)
    assert found.verdict == "ambiguous"
    assert found.indistinguishable == (("leakage",),)


def test_a_cause_may_have_a_second_one_that_nobody_can_see() -> None:
    """It is certain that the cause is there, and less so that it is alone."""
    found = posterior(evidence(30.0, score(("pulley_radius",), 0.5)), DEFAULT)
    alone = found["pulley_radius"]
    assert 0.8 < alone <= 1.0 - STATEMENT.hidden
    assert cause_probabilities(found, {"pulley_radius"})["pulley_radius"] > alone + 0.05


def test_a_second_cause_must_pay_for_its_prior() -> None:
    both = ("creep", "leakage")
    for left, named in ((1.45, ["creep"]), (0.7, ["creep", "leakage"])):
        kept = evidence(9.0, score(("creep",), 1.5), score(both, left))
        assert sorted(verdict(kept)[1]) == named


def test_what_no_law_explains_is_unknown_and_so_is_a_cause_outside_the_table() -> None:
    assert verdict(evidence(30.0, score(("creep",), 25.0))) == ("unknown", [])
    encoder = score((), 1.0, unlisted="an eccentricity of the encoder")
    assert verdict(evidence(9.0, score(("creep",), 4.0), unlisted=(encoder,))) == ("unknown", [])


def test_an_unusual_background_elsewhere_is_no_reason_for_unknown() -> None:
    """A late encoder was `unknown` with 0.91: an unusual background stayed at the pressures."""
    late = score(("position_delay",), 1.0)
    late = replace(late, sums=late.sums * [23.0, 23.0, 7.0])
    kept = evidence(20.0, late, score(("creep",), 19.0))
    nominal = replace(kept.nominal, sums=late.counts * 101.0 * np.array([23.0, 23.0, 470.0]))
    kept = replace(kept, nominal=nominal, motion=np.full(CHANNELS, 1e6))
    assert verdict(kept) == ("named", ["position_delay"])


def test_a_diverged_hypothesis_is_improbable() -> None:
    wild = score(("hysteresis",), np.nan)
    found = posterior(evidence(9.0, score(("creep",), 1.0), wild), DEFAULT)
    assert "hysteresis" not in found


def test_the_likelihood_is_a_density_of_the_mean_squares() -> None:
    """With the count of its errors, it integrates to one constant whatever the usual variance."""
    sharp = replace(STATEMENT, background_spread=1e-6)
    grid = np.exp(np.linspace(-12.0, 12.0, 6001))
    worth = sharp.independent_errors

    def mass(background: float) -> float:
        left, none = grid[:, None], np.zeros((grid.size, 1))
        spread = np.array([background])
        values = log_likelihood(left, none[0], spread, none, np.ones(grid.size, dtype=bool), sharp)
        return float(np.log(np.trapezoid(np.exp(values) * grid ** (worth / 2.0 - 1.0), grid)))

    assert mass(1.0) == pytest.approx(mass(20.0), abs=1e-3)


def test_a_law_with_several_forms_may_leave_more_than_one_with_a_single_form() -> None:
    left, noise = np.full((2, CHANNELS), 400.0), np.ones(CHANNELS)
    change, is_sharp = np.full((2, CHANNELS), 2500.0), np.array([False, True])
    several, single = log_likelihood(left, noise, noise, change, is_sharp, STATEMENT)
    assert several > single + 1.0


def test_a_free_number_has_its_price() -> None:
    """Of two causes that leave the same, the one with fewer free numbers is more probable."""
    few, many = score(("creep",), 1.0), score(("leakage",), 1.0)
    found = posterior(evidence(9.0, few, replace(many, free_numbers=4)), DEFAULT)
    assert np.log(found["creep"] / found["leakage"]) == pytest.approx(3 * STATEMENT.number_price)


@pytest.mark.parametrize("spread", [0.2, 2.0])
def test_probabilities_are_right_on_rigs_drawn_from_the_statement(spread: float) -> None:
    """Simulation-based calibration: of all answers with a probability, that share is right.

    The errors of a rig are vectors: those of noise and background, and the change that its cause
    makes; a hypothesis subtracts the change of its own cause. A cause outside the table has errors
    of its own size in every channel.
    """
    worth, laws = 4, 3
    said = replace(
        STATEMENT, background_spread=spread, independent_errors=float(worth), number_price=0.0,
        hidden=1e-12, sharp_law_error=1e-9, law_error=1e-9,
    )  # fmt: skip
    rules = replace(
        DEFAULT, statement=said, decision=replace(DEFAULT.decision, most_of_the_gap=0.0)
    )
    random = np.random.default_rng(47)
    noise, background = np.full(CHANNELS, 0.1), np.array([1.0, 4.0, 0.5])
    names = ["creep", "hysteresis", "leakage"]
    weights = np.array([said.nothing, *[said.one / len(EFFECTS)] * laws, said.outside])
    stated, right = [], []
    for _ in range(800):
        truth = int(random.choice(laws + 2, p=weights / weights.sum()))
        # of a common size, about which each channel scatters
        variance = noise + background * np.exp(spread * random.standard_normal())
        if truth == laws + 1:
            ends = np.log([said.least_unknown, said.largest_unknown])
            sizes = np.exp(random.uniform(*ends, CHANNELS))
            variance = variance + sizes**2 * (noise + background)
        freedom = said.channel_freedom
        variance = variance * freedom / random.chisquare(freedom, CHANNELS)
        errors = np.sqrt(variance) * random.standard_normal((worth, CHANNELS))
        changes = 3.0 * np.sqrt(background) * random.standard_normal((laws, worth, CHANNELS))
        if 0 < truth <= laws:
            errors = errors + changes[truth - 1]
        left = [errors, *(errors - change for change in changes)]
        none, *tried = [
            Score((), "", 0, np.sum(one**2, axis=0)[None], np.full((1, CHANNELS), float(worth)))
            for one in left
        ]
        kept = replace(
            evidence(1.0), floor=noise, background=background, nominal=none,
            tried=tuple(replace(s, effects=(n,)) for n, s in zip(names, tried, strict=True)),
        )  # fmt: skip
        found = posterior(kept, rules)
        for place, name in enumerate(("none", *names, "unknown")):
            stated.append(found.get(name, 0.0))
            right.append(place == truth)
    told, were = np.array(stated), np.array(right, dtype=float)
    for low, high in pairwise((0.0, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 1.01)):
        inside = (told >= low) & (told < high)
        mean, share = told[inside].mean(), were[inside].mean()
        scatter = np.sqrt(max(mean * (1.0 - mean), 1e-4) / inside.sum())
        assert abs(share - mean) < 4.0 * scatter + 0.005, (low, mean, share)


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
