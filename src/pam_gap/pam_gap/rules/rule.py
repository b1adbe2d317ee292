"""How a constant is declared: its value together with the text of its row in the table."""

from __future__ import annotations

from dataclasses import field
from functools import partial
from typing import Any

DECISION = "decision"
"""The constant acts after the search; the verdict can be decided again from kept evidence."""
DIAGNOSIS = "diagnosis"
"""The constant acts on noise, prediction or search; the recording must be diagnosed again."""
PROPOSAL = "proposal"
"""The constant changes notes, figures or the next experiment, but no verdict."""

FIRST = (
    "Hand-set in the first version of the diagnosis. It was tuned on withheld rigs of other seeds "
    "than the published one; neither those seeds nor a derivation were written down."
)
BEFORE_3727343088 = (
    "Hand-set after misses in withheld checks that came before the check of seed 3727343088; their "
    "seeds were not written down. No derivation."
)
AFTER_3727343088 = "Hand-set after misses in the withheld check of seed 3727343088. No derivation."
NUMERICAL = "Numerical setting, hand-set in the first version of the diagnosis."


def rule(
    default: Any,
    *,
    unit: str,
    decides: str,
    trades: str,
    origin: str = FIRST,
    acts: str = DIAGNOSIS,
) -> Any:
    """Declare one constant as a field of a frozen dataclass.

    Parameters
    ----------
    default : float or int
        The value in use.
    unit : str
        Unit of the value; "-" for a plain number.
    decides : str
        What the value means.
    trades : str
        What happens when the value is smaller or larger.
    origin : str
        Where the value comes from.
    acts : str
        DECISION, DIAGNOSIS or PROPOSAL: the first step that a change affects.
    """
    about = {"unit": unit, "decides": decides, "trades": trades, "origin": origin, "acts": acts}
    return field(default=default, metadata=about)


decision_rule = partial(rule, acts=DECISION)
proposal_rule = partial(rule, acts=PROPOSAL)
