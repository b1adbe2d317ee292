"""Commands of the recent past, for valves that follow them with a delay."""

from __future__ import annotations

from collections.abc import Sequence

Row = tuple[float, ...]


class CommandHistory:
    """Keeps one row of commands per step, back to the longest delay.

    Parameters
    ----------
    longest_delay : float
        [s].
    """

    def __init__(self, longest_delay: float) -> None:
        self._longest = longest_delay
        self._rows: list[Row] = []
        self._period = 0.0

    def with_next(self, commands: Sequence[float], duration: float) -> tuple[list[Row], int]:
        """Past commands, one row per `duration` [s], with the present ones at the index given."""
        row = tuple(map(float, commands))
        if self._longest <= 0.0:
            return [row], 0
        if duration != self._period:
            # For a new duration, the past commands are resampled.
            old, period = self._rows, self._period
            keep = int(self._longest / duration) + 2
            self._rows = [
                old[max(len(old) - 1 - int((keep - 1 - i) * duration / period), 0)]
                for i in range(keep)
            ] if old else [row]  # fmt: skip
            self._period = duration
        self._rows.append(row)
        keep = int(self._longest / duration) + 3
        del self._rows[:-keep]
        return self._rows, len(self._rows) - 1
