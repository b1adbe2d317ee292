"""Decides from levels alone whether the search seeks one more effect."""

from __future__ import annotations

from dataclasses import astuple, dataclass

from pam_gap.inference.verdict import accepts_further
from pam_gap.rules.decision_rules import DecisionRules
from pam_gap.rules.search_rules import SearchRules


@dataclass(frozen=True, slots=True)
class GrowthStep:
    """State of the search after all hypotheses of one size.

    Attributes
    ----------
    size : int
        Number of effects of the hypotheses found last.
    worst_channel : float
        RMS error over floor of the worst channel of the best of them.
    nominal, best : float
        Levels of the re-tuned nominal plant and of the best hypothesis found last.
    previous, runner_up : float or None
        Levels of the best hypothesis with one effect less, and of the hypothesis with the next best
        effect in place of the last one; None for the first effect.
    """

    size: int
    worst_channel: float
    nominal: float
    best: float
    previous: float | None = None
    runner_up: float | None = None

    def to_list(self) -> list[float | None]:
        """The fields in order."""
        return list(astuple(self))


def grows(step: GrowthStep, search: SearchRules, decision: DecisionRules) -> bool:
    """Whether one more effect is sought.

    It is sought while an error is left to explain and the last effect was worth accepting.
    """
    if step.size >= search.most_effects:
        return False
    if step.best < search.level_to_explain or step.worst_channel < search.left_to_explain:
        return False
    if step.previous is None or step.runner_up is None:
        return True
    return accepts_further(step.previous, step.best, step.nominal, step.runner_up, decision)
