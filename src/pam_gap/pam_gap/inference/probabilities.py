"""Names of the explanations that are no set of causes, and the probability of a single cause."""

from __future__ import annotations

from collections.abc import Mapping, Set

NONE, UNKNOWN = "none", "unknown"


def cause_probabilities(probabilities: Mapping[str, float], named: Set[str]) -> dict[str, float]:
    """The probability that each of the named effects is a cause, largest first.

    Parameters
    ----------
    probabilities : mapping
        Explanation (effects joined by " + ", `unknown` or `none`) -> probability.
    named : set of str
        Effects.

    Returns
    -------
    dict of str to float
        Of each of them the sum over all explanations that contain it.
    """
    found: dict[str, float] = {}
    for explanation, probability in probabilities.items():
        for effect in named & {*explanation.split(" + ")}:
            found[effect] = found.get(effect, 0.0) + probability
    return dict(sorted(found.items(), key=lambda item: -item[1]))
