"""Decides from levels alone whether the search seeks one more effect."""

from __future__ import annotations

from dataclasses import astuple, dataclass

from pam_gap.inference.verdict import accepts_further, has_gap
from pam_gap.rules.decision_rules import DecisionRules
from pam_gap.rules.search_rules import SearchRules


@dataclass(frozen=True, slots=True)
class GrowthStep:
    """State of the search after all hypotheses of one size."""

    size: int  # number of effects of the hypotheses found last
    channels: int  # number of channels that are judged
    matters: bool  # whether the best of them leaves an error that is material
    # nominal, best: levels of the re-tuned nominal plant and of the best hypothesis found last
    nominal: float
    best: float
    # previous, runner_up: levels of the best hypothesis with one effect less, and of the hypothesis
    # with the next best effect in place of the last one; None for the first effect
    previous: float | None = None
    runner_up: float | None = None

    def to_list(self) -> list[float | None]:
        """The fields in order."""
        return list(astuple(self))


def grows(step: GrowthStep, search: SearchRules, decision: DecisionRules) -> bool:
    """Whether one more effect is sought.

    It is sought while what is left is itself a gap, by the limits that hold for the re-tuned
    nominal plant, and the last effect was worth accepting.
    """
    if step.size >= search.most_effects:
        return False
    if not (step.matters and has_gap(step.best, step.channels, decision)):
        return False
    if step.previous is None or step.runner_up is None:
        return True
    return accepts_further(step.previous, step.best, step.nominal, step.runner_up, decision)
