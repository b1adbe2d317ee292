"""One row of the table of rules, written where its value is declared."""

from __future__ import annotations

from dataclasses import field
from typing import Any

DECISION = "decision"
"""Acts after the search: the verdict can be decided again from the evidence that was kept."""
DIAGNOSIS = "diagnosis"
"""Acts on the noise, the predictions or the search: the recording has to be diagnosed again."""
PROPOSAL = "proposal"
"""Changes notes, figures or the next experiment, and no verdict."""

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
        Of the value; "-" for a plain number.
    decides : str
        What depends on it.
    trades : str
        What happens when it is smaller or larger.
    origin : str
        Where the value came from.
    acts : str
        DECISION, DIAGNOSIS or PROPOSAL: from which step on a change has an effect.
    """
    about = {"unit": unit, "decides": decides, "trades": trades, "origin": origin, "acts": acts}
    return field(default=default, metadata=about)
