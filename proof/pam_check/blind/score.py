"""Scores the diagnoses by the opened labels.

The functions depend only on labels and answers, so the scores can be computed again from the files
of a campaign.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.stats import beta

from pam_gap.inference.probabilities import cause_probabilities

CLEAR_GAP = 3.0
"""In multiples of the noise: a weaker hidden effect need not be in the answer."""
BY_STRENGTH = ("weak", "medium", "strong")
"""Classes of strength above an ordinary background (`pam_check.blind.rough.STRENGTHS`)."""
MEDIUM, STRONG = 3.0, 10.0
STANDS_OUT = 1.0
"""Strength below which an effect changes a rig less than its ordinary background does."""


@dataclass(frozen=True)
class Share:
    """A share of cases, with its exact (Clopper-Pearson) 90 % confidence interval."""

    hits: int
    of: int

    @property
    def value(self) -> float:
        """The share; NaN without cases."""
        return self.hits / self.of if self.of else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """90 % interval of the share."""
        if not self.of:
            return 0.0, 1.0
        low = 0.0 if self.hits == 0 else float(beta.ppf(0.05, self.hits, self.of - self.hits + 1))
        high = (
            1.0
            if self.hits == self.of
            else float(beta.ppf(0.95, self.hits + 1, self.of - self.hits))
        )
        return low, high

    def to_json(self) -> dict[str, Any]:
        """Give the numbers for a JSON file."""
        return {"value": self.value, "hits": self.hits, "of": self.of, "interval": self.interval}


def share(outcomes: Sequence[bool]) -> Share:
    """Count the hits."""
    return Share(sum(outcomes), len(outcomes))


def reported_set(answer: Mapping[str, Any]) -> set[str]:
    """All effects that the answer considers possible: named ones and those it cannot exclude."""
    effects = set(answer["effects"])
    together = {e for group in answer["indistinguishable"] for e in group if effects & set(group)}
    return effects | together


CRASHED: Mapping[str, Any] = {
    "verdict": "crash", "effects": [], "indistinguishable": [], "stage": None
}  # fmt: skip
SPLIT = ("top1", "truth_in_set", "stage", "false_name", "both_of_two")
"""Figures that are given for each class of strength too, on rigs with a background."""


def strength_of(label: Mapping[str, Any]) -> str:
    """Class of strength of a rig with a background and hidden effects; empty for other rigs."""
    strength = float(label.get("strength", 0.0))
    if strength <= 0.0:
        return ""
    return BY_STRENGTH[(strength >= MEDIUM) + (strength >= STRONG)]


def says_what_is_left(answer: Mapping[str, Any]) -> bool:
    """Whether an answer is `unknown`, or says that an error that matters stays unexplained."""
    leftover = answer.get("leftover") or {}
    return answer["verdict"] == "unknown" or bool(leftover.get("material"))


BINS = (0.0, 0.5, 0.8, 0.95, 1.0)
"""Limits of the classes of stated probability."""


def hidden_explanation(label: Mapping[str, Any]) -> str:
    """Explanation of the answer that is right, as `probabilities` of diagnosis.json names it."""
    if label["kind"] == "outside":
        return "unknown"
    return " + ".join(sorted(label["effects"])) or "none"


def reliability(
    labels: Sequence[Mapping[str, Any]], answers: Mapping[str, Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """How often the most probable explanation is right, by the probability that was stated.

    Answers without probabilities (crashes, recordings with too little in them) are left out.

    Parameters
    ----------
    labels, answers
        As for `score`.
    """
    stated: list[tuple[float, bool]] = []
    for label in labels:
        probabilities = (answers.get(str(label["case"])) or {}).get("probabilities")
        if probabilities:
            best = max(probabilities, key=probabilities.__getitem__)
            stated.append((float(probabilities[best]), best == hidden_explanation(label)))
    return _by_stated(stated)


def reliability_of_causes(
    labels: Sequence[Mapping[str, Any]], answers: Mapping[str, Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """How often a cause that a `named` answer tells is hidden, by the probability it states for it.

    Parameters
    ----------
    labels, answers
        As for `score`.
    """
    stated: list[tuple[float, bool]] = []
    for label in labels:
        answer = answers.get(str(label["case"])) or CRASHED
        if answer["verdict"] == "named":
            causes = cause_probabilities(answer.get("probabilities") or {}, {*answer["effects"]})
            stated += [(p, effect in label["effects"]) for effect, p in causes.items()]
    return _by_stated(stated)


LEAST_PROBABILITY = 1e-4
"""Probability that every explanation has in `surprise`, so that one rig cannot decide alone."""


def surprise(
    labels: Sequence[Mapping[str, Any]], answers: Mapping[str, Mapping[str, Any]]
) -> float | None:
    """Mean of minus the logarithm of the probability that was given to what is hidden.

    It is a proper score: the smallest mean is that of probabilities which are right. None if no
    answer has probabilities.

    Parameters
    ----------
    labels, answers
        As for `score`.
    """
    given = [
        float(probabilities.get(hidden_explanation(label), 0.0))
        for label in labels
        if (probabilities := (answers.get(str(label["case"])) or {}).get("probabilities"))
    ]
    if not given:
        return None
    likely = LEAST_PROBABILITY + (1.0 - LEAST_PROBABILITY) * np.array(given)
    return float(-np.mean(np.log(likely)))


def _by_stated(stated: Sequence[tuple[float, bool]]) -> list[dict[str, Any]]:
    table: list[dict[str, Any]] = []
    for low, high in pairwise(BINS):
        inside = [(p, right) for p, right in stated if low <= p < high or p == high == BINS[-1]]
        mean = float(np.mean([p for p, _ in inside])) if inside else None
        right = share([is_right for _, is_right in inside]).to_json()
        table.append({"from": low, "to": high, "stated_mean": mean, "right": right})
    return table


def by_strength(
    labels: Sequence[Mapping[str, Any]], answers: Mapping[str, Mapping[str, Any]]
) -> dict[str, list[bool]]:
    """Outcomes on rigs with a background, for each class of strength of the hidden effects.

    Parameters
    ----------
    labels, answers
        As for `score`.
    """
    rows: dict[str, list[bool]] = {
        f"{name}_{strength}": [] for strength in BY_STRENGTH for name in SPLIT
    }
    rows["outside_unknown_or_leftover"] = []
    rows["both_of_two_that_stand_out"] = []
    for label in labels:
        answer = answers.get(str(label["case"])) or CRASHED
        truth, named = set(label["effects"]), list(answer["effects"])
        found, strength = reported_set(answer), strength_of(label)
        if label["kind"] == "outside":
            rows["outside_unknown_or_leftover"].append(says_what_is_left(answer))
        if not strength:
            continue
        if label["kind"] == "one":
            candidates = answer.get("candidates") or [[""]]
            rows[f"top1_{strength}"].append(bool(named) and candidates[0][0] in truth)
            rows[f"truth_in_set_{strength}"].append(truth <= found)
            rows[f"stage_{strength}"].append(answer["stage"] in label["stages"])
            rows[f"false_name_{strength}"].append(bool(named) and not truth & found)
        elif label["kind"] == "two":
            rows[f"both_of_two_{strength}"].append(truth <= found)
            if min(label.get("strengths") or [0.0]) >= STANDS_OUT:
                rows["both_of_two_that_stand_out"].append(truth <= found)
    return rows


def score(
    labels: Sequence[Mapping[str, Any]], answers: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """Score the answers.

    Parameters
    ----------
    labels : sequence of mapping
        The opened labels (`pam_check.blind.cases.Label` as JSON).
    answers : mapping of case name to mapping
        diagnosis.json of every case; a case without one counts as wrong.

    Returns
    -------
    dict
        Shares by name, confusion pairs and the list of failures.
    """
    rows: dict[str, list[bool]] = {
        name: []
        for name in (
            "top1",
            "truth_in_set",
            "stage",
            "false_name_on_clean",
            "unknown_recall",
            "false_unknown",
            "both_of_two",
            "one_of_two",
            "closed_interval_covers",
        )
    }
    confusion: list[tuple[str, str]] = []
    failures: list[dict[str, Any]] = []
    closed: list[float] = []
    closed_error: list[float] = []
    untouched: list[float] = []
    for label in labels:
        answer = answers.get(str(label["case"]))
        truth = set(label["effects"])
        clear = float(label["gap_over_floor"]) >= CLEAR_GAP
        if answer is None:
            answer = CRASHED
        verdict, named = str(answer["verdict"]), list(answer["effects"])
        right = True
        if label["kind"] == "none":
            right = verdict not in ("named", "ambiguous")
            rows["false_name_on_clean"].append(not right)
            rows["false_unknown"].append(verdict == "unknown")
            right = right and verdict != "unknown"
        elif label["kind"] == "outside" and clear:
            right = verdict == "unknown"
            rows["unknown_recall"].append(right)
        elif label["kind"] == "one" and clear:
            top = str(answer["candidates"][0][0]) if answer.get("candidates") else ""
            right = bool(named) and top in truth and verdict in ("named", "ambiguous")
            rows["top1"].append(right)
            rows["truth_in_set"].append(truth <= reported_set(answer))
            rows["stage"].append(answer["stage"] in label["stages"])
            rows["false_unknown"].append(verdict == "unknown")
        elif label["kind"] == "two" and clear:
            right = truth <= reported_set(answer)
            rows["both_of_two"].append(right)
            rows["one_of_two"].append(bool(truth & reported_set(answer)))
            rows["false_unknown"].append(verdict == "unknown")
        if label["kind"] != "two":
            shown = named[0] if named else verdict
            confusion.append((next(iter(label["effects"]), "none"), shown))
        if named and answer.get("closed"):
            closed.append(float(answer["closed"]["value"]))
            after = answer["closed"].get("untouched")
            if after is not None:
                rows["closed_interval_covers"].append(
                    answer["closed"]["low"] <= after <= answer["closed"]["high"]
                )
                untouched.append(float(after))
                closed_error.append(abs(after - float(answer["closed"]["value"])))
        if not right:
            failures.append(
                {
                    "case": label["case"],
                    "truth": sorted(truth),
                    "verdict": verdict,
                    "effects": named,
                    "candidates": list(answer.get("candidates", []))[:4],
                    "gap_over_floor": label["gap_over_floor"],
                }
            )
    return {
        "shares": {
            name: share(outcomes).to_json()
            for name, outcomes in (rows | by_strength(labels, answers)).items()
        },
        "reliability": reliability(labels, answers),
        "reliability_of_causes": reliability_of_causes(labels, answers),
        "closed_median": float(np.median(closed)) if closed else None,
        "untouched_median": float(np.median(untouched)) if untouched else None,
        "closed_error_median": float(np.median(closed_error)) if closed_error else None,
        "confusion": confusion,
        "failures": failures,
    }
