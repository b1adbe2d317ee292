"""Whether a board has restarted, by the time since power-up that it reports."""

from __future__ import annotations

from typing import Final

_EDGE: Final = 1.0 / 16.0  # share of the range at each of its ends


def has_restarted(before: float, now: float, low: float, high: float) -> bool:
    """Whether the time since power-up has become smaller because the board was switched on again.

    A number of a few bits begins again at the end of its range, after 65 s if it has 16 bits and
    counts milliseconds. A jump from the last sixteenth of the range to the first is taken for that.

    Parameters
    ----------
    before, now : float
        What the board reported last, and what it reports now; `before` may be -infinity.
    low, high : float
        The range of the number.
    """
    if now >= before:
        return False
    edge = _EDGE * (high - low)
    return not (before > high - edge and now < low + edge)
