"""The counter in a device's measurements: it shows frames that are lost, repeated or frozen."""

from __future__ import annotations

from pam_driver.boards.protocol import NEVER


class SampleCounter:
    """Judges the counter of one message.

    Parameters
    ----------
    values : int
        How many values it has before it begins again.

    Attributes
    ----------
    lost, repeated, reordered : int
        Frames that were counted.
    """

    def __init__(self, values: int) -> None:
        self.lost = self.repeated = self.reordered = 0
        self._values = values
        # A counter that is behind by less means frames out of order; else it was reset. A counter
        # of a few bits cannot distinguish frames out of order from lost frames.
        self._window = min(16, values // 16)
        self._last: int | None = None
        self._changed_at = NEVER
        self._repeated_in_a_row = 0
        self._reordered_in_a_row = 0

    def fresh(self, value: int, time: float) -> bool:
        """Whether the frame is newer than the last one; counts it otherwise."""
        if self._last is not None:
            step = (value - self._last) % self._values
            if step == 0:
                self.repeated += 1
                self._repeated_in_a_row += 1
                return False
            if step > self._values - self._window and self._reordered_in_a_row < self._window:
                self.reordered += 1
                self._reordered_in_a_row += 1
                return False
            self.lost += step - 1
        self._last = value
        self._changed_at = time
        self._repeated_in_a_row = self._reordered_in_a_row = 0
        return True

    def frozen(self, now: float, timeout: float) -> bool:
        """Whether frames arrive, but with the same value for longer than `timeout` [s]."""
        return self._repeated_in_a_row > 1 and now - self._changed_at > timeout

    def reset(self) -> None:
        """Accept any value next, since the device has restarted."""
        self._last = None
