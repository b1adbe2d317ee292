"""How old commands and measurements are on their way around the control loop.

In every cycle three ages are added: the round trip of the slowest board (a command to the board and
its echo back), the age of the oldest measurement, and the age with which the last valve command
arrived, by its stamp. A loop at a fixed rate needs three cycles for them even if the bus takes no
time. What is beyond this is extra delay; the controller's gains are designed for a limited one.

A single late frame changes one of the ages for a few cycles. The loop is too slow only when the
extra delay was above its limit in 80 % of the cycles of the last 0.15 s.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping
from typing import Final

from pam_driver.boards.protocol import Condition

CYCLES: Final = 3.0
WINDOW: Final = 0.15  # s
SHARE: Final = 0.8
_FEWEST: Final = 5  # cycles, so that one late cycle at a low rate is not a fault


class LoopWatch:
    """Watches the delays of one driver's loop.

    Parameters
    ----------
    limit : float
        Largest extra delay beyond three cycles [s].
    period : float
        Time between two cycles [s].

    Attributes
    ----------
    round_trips : dict of str to float
        By board, from a command to its echo [s]; NaN if the board echoes nothing.
    measurement_age, command_age : float
        As last given [s].
    """

    def __init__(self, limit: float, period: float) -> None:
        self.round_trips: dict[str, float] = {}
        self.measurement_age = self.command_age = 0.0
        self._limit = limit
        self._period = period
        self._window: deque[tuple[float, bool]] = deque()
        self._over = 0

    @property
    def delay(self) -> float:
        """Sum of the ages now [s]; ages that are unknown count as zero."""
        trips = [trip for trip in self.round_trips.values() if -math.inf < trip < math.inf]
        return max(trips, default=0.0) + self.measurement_age + self.command_age

    @property
    def extra_delay(self) -> float:
        """What the delay exceeds three cycles by [s], at least 0."""
        return max(self.delay - CYCLES * self._period, 0.0)

    def update(
        self,
        round_trips: Mapping[str, float],
        measurement_age: float,
        command_age: float,
        now: float,
    ) -> None:
        """Take the ages of one cycle.

        Parameters
        ----------
        round_trips : mapping of str to float
            By board [s]; NaN if unknown.
        measurement_age : float
            Of the oldest measurement in use [s]; not finite if there is none, which other checks
            report.
        command_age : float
            Age with which the command in use arrived [s]; 0 while no command is in use.
        now : float
            Monotonic time [s].
        """
        self.round_trips = dict(round_trips)
        self.measurement_age = measurement_age if math.isfinite(measurement_age) else 0.0
        self.command_age = max(command_age, 0.0)
        over = self.extra_delay > self._limit
        window = self._window
        window.append((now, over))
        self._over += over
        while window[0][0] < now - WINDOW:
            self._over -= window.popleft()[1]

    def conditions(self) -> Iterator[Condition]:
        """One condition if the loop has been too slow for most of the window."""
        window = self._window
        if len(window) < _FEWEST or window[-1][0] - window[0][0] < SHARE * WINDOW:
            return
        if self._over < SHARE * len(window):
            return
        name, trip = max(
            ((name, trip) for name, trip in self.round_trips.items() if math.isfinite(trip)),
            key=lambda item: item[1],
            default=("no board", math.nan),
        )
        text = (
            f"{1e3 * self.extra_delay:.0f} ms slower than {CYCLES:.0f} cycles, loop_delay_limit is "
            f"{1e3 * self._limit:g} ms: {name} echoes commands after {1e3 * trip:.0f} ms, "
            f"measurements are {1e3 * self.measurement_age:.0f} ms old, commands "
            f"{1e3 * self.command_age:.0f} ms"
        )
        yield Condition("loop_too_slow", "", text)
