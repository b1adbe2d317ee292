"""How long a command needs to a board and its echo back, from the counters in both."""

from __future__ import annotations

import math


class EchoDelay:
    """Measures the round trip of one board's commands.

    The board returns the counter of the last command that it has accepted. As long as the echo does
    not change, the command that it names grows older, so that lost commands are seen as well.

    Attributes
    ----------
    value : float
        Time from sending the command that the last status names until this status arrived [s];
        NaN if the counter is not one of this driver.
    """

    def __init__(self) -> None:
        self.value = math.nan
        self._sent: dict[int, float] = {}
        self._echo: int | None = None
        self._echo_sent = math.nan

    def sent(self, counter: int, now: float) -> None:
        """Note when a command was sent; a counter that wraps names the latest command."""
        self._sent[counter] = now

    def heard(self, counter: int, time: float) -> None:
        """Take the counter of a status that arrived at `time` [s]."""
        if counter != self._echo or math.isnan(self._echo_sent):
            self._echo = counter
            self._echo_sent = self._sent.get(counter, math.nan)
        self.value = max(time - self._echo_sent, 0.0)
