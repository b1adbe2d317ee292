"""What was wrong at any moment since the last judgement: a "no" counts, however short it was.

The driver judges once in a cycle, but messages and frames arrive at any time, and several of them
wait after a pause of the driver. If only the newest of them counted, an emergency stop that is
pressed and released between two cycles would be lost. Every input that can forbid motion therefore
passes its content to this object before the next message or frame replaces it.
"""

from __future__ import annotations

from collections.abc import Iterable

from pam_driver.boards.protocol import Condition


class SinceJudged:
    """The conditions that held since the last judgement, by kind and subject."""

    def __init__(self) -> None:
        self._kept: dict[tuple[str, str], Condition] = {}

    def keep(self, found: Iterable[Condition]) -> None:
        """Keep conditions until they have been judged; of several equal ones the first."""
        for condition in found:
            self._kept.setdefault(condition[:2], condition)

    def added_to(self, found: Iterable[Condition], *kinds: str) -> tuple[Condition, ...]:
        """What holds now, and then what held since the last judgement.

        Parameters
        ----------
        *kinds : str
            The kinds that are wanted of those that were kept; all if none is given.
        """
        kept = tuple(self._kept.values())  # in one step: other threads may keep more
        now = tuple(found)
        if not kept:
            return now
        seen = {condition[:2] for condition in now}
        return now + tuple(
            condition
            for condition in kept
            if condition[:2] not in seen and (not kinds or condition.kind in kinds)
        )

    def judged(self) -> None:
        """Forget what was kept; the driver has acted on it."""
        self._kept.clear()
