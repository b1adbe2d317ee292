"""Whether the search seeks one more effect: a question of levels alone."""

from __future__ import annotations

from dataclasses import astuple, dataclass

from pam_gap.inference.verdict import accepts_further
from pam_gap.rules.decision_rules import DecisionRules
from pam_gap.rules.search_rules import SearchRules


@dataclass(frozen=True, slots=True)
class GrowthStep:
    """Where the search stands after a size.

    Attributes
    ----------
    size : int
        Effects of the hypotheses found last.
    worst_channel : float
        RMS error over floor of the worst channel that the best of them leaves.
    nominal, best : float
        Levels of the re-tuned nominal plant and of the best hypothesis found last.
    previous, runner_up : float or None
        Levels of the best hypothesis with one effect less, and of the next best in the last
        effect's place; None for the first effect.
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

    It is while something is left to explain, and while the effect added last paid for itself.
    """
    if step.size >= search.most_effects:
        return False
    if step.best < search.level_to_explain or step.worst_channel < search.left_to_explain:
        return False
    if step.previous is None or step.runner_up is None:
        return True
    return accepts_further(step.previous, step.best, step.nominal, step.runner_up, decision)
