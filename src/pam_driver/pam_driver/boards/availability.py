"""How often a device says that it has no measurement, although it has one before and after.

A device that has lost a sensor says "not available" instead of a value, and the last value becomes
too old. Where values come in between, the last one stays recent: a cable with a loose contact, or
another device that sends under the same identifier, would go unnoticed. Every kind of board passes
each measurement that it receives to this object.
"""

from __future__ import annotations

from typing import Final

WINDOW: Final = 1.0
"""Time in which measurements are counted [s]."""
_PART: Final = 0.5 * WINDOW


class _Share:
    """The measurements of one channel, counted in the present and the last half of the window."""

    def __init__(self) -> None:
        self.part = 0
        self.available = self.missing = 0
        self.available_before = self.missing_before = 0
        self.pending = 0

    def advance(self, part: int) -> None:
        follows = part == self.part + 1
        self.available_before = self.available if follows else 0
        self.missing_before = self.missing if follows else 0
        self.available = self.missing = 0
        self.part = part


class Availability:
    """The measurements of one board, by input and channel.

    Attributes
    ----------
    has_missed : bool
        Whether a measurement was ever missing between others; until then, every share is 0.
    """

    def __init__(self) -> None:
        self.has_missed = False
        self._shares: dict[tuple[str, int | str], _Share] = {}

    def hear(self, what: str, channel: int | str, available: bool, time: float) -> None:
        """Count a measurement.

        Parameters
        ----------
        what : str
            Kind of input, as in `boards.samples`.
        channel : int, str
            As muscles and joints name it.
        available : bool
            False: the device says that it has none.
        time : float
            When it was measured, monotonic [s].
        """
        share = self._shares.get((what, channel))
        if share is None:
            share = self._shares[what, channel] = _Share()
        if not available:  # it counts when a value follows; until then the last one becomes old
            share.pending += 1
            return
        part = int(time / _PART)
        if part != share.part:
            share.advance(part)
        share.available += 1
        if share.pending:
            share.missing += share.pending
            share.pending = 0
            self.has_missed = True

    def missing_share(self, what: str, channel: int | str, now: float) -> float:
        """The share of measurements that were missing between others, in the last `WINDOW`."""
        share = self._shares.get((what, channel))
        if share is None:
            return 0.0
        part = int(now / _PART)
        if part != share.part:
            share.advance(part)
        missing = share.missing + share.missing_before
        return missing / (missing + share.available + share.available_before) if missing else 0.0
