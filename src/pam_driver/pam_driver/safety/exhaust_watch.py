"""Whether the muscles are empty: "safe" is measured in the arm, not assumed at the valve.

While the valves vent, every pressure has to fall below `vented_pressure` within a time limit. If
one does not, its exhaust is blocked, or its valve is stuck open to the supply.

Noise at the limit must not change the state in every cycle. Therefore muscles count as empty when
no reading was above the limit for a moment, and as filled again when a reading was well above it
for a moment.

While the computer stands still, nobody looks, and a valve may stay as it was told before. A pause
therefore counts as no more venting than the longest time between two cycles that is none.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from pam_driver.boards.protocol import NEVER, Condition
from pam_driver.safety.pauses import longest_gap
from pam_model.robot import Robot
from pam_model.views.time_to_empty import time_to_empty

# A muscle that was empty counts as filled again above this multiple of the limit.
_FILLED_AGAIN: Final = 1.25
# The readings must agree for this time, without a single exception [s]. At 500 Hz, a muscle at the
# limit whose sensor has 5 kPa of white noise (more is `sensor_noise`) then changes the state once
# in minutes at most.
_AGREED: Final = 0.02
# The default time limit is so many times the ideal time, for exhausts that are narrower than the
# rig file says (silencers, tubes), plus a second.
_NARROWER: Final = 4.0
_ADDED: Final = 1.0  # s


class ExhaustWatch:
    """Watches how the muscles of a rig become empty.

    Parameters
    ----------
    robot : Robot
        Names the muscles.
    vented_pressure : float
        A muscle is empty below this pressure [Pa gauge].
    timeout : float
        A muscle that is not empty after this time of venting is a fault [s].
    period : float, optional
        Time between two updates [s].

    Attributes
    ----------
    timeout : float
        As given [s].
    below : bool
        Whether the last reading of every pressure is below `vented_pressure`.
    empty : bool
        Whether all muscles count as empty.
    """

    def __init__(
        self, robot: Robot, vented_pressure: float, timeout: float, period: float = 0.002
    ) -> None:
        self.timeout = timeout
        self._longest_gap = longest_gap(period)
        self._names = robot.muscle_names
        self._limit = vented_pressure
        self._pressures: Sequence[float] = (math.nan,) * len(robot.muscles)
        self._since = math.inf
        self._changing_since = math.inf
        self._updated_at = NEVER
        self.below = self.empty = False

    def update(self, pressures: Sequence[float], venting: bool, now: float) -> None:
        """Take the measurements of one cycle.

        Parameters
        ----------
        pressures : sequence of float
            By muscle [Pa gauge]; NaN if unknown, which does not count as empty.
        venting : bool
            Whether every valve is commanded to vent.
        now : float
            Monotonic time [s].
        """
        pause, self._updated_at = now - self._updated_at - self._longest_gap, now
        if pause > 0.0:
            self._since += pause
        self._pressures = pressures
        self._judge(pressures, venting, now)
        if self.empty or not venting:
            self._since = math.inf
        elif self._since == math.inf:
            self._since = now

    def _judge(self, pressures: Sequence[float], venting: bool, now: float) -> None:
        """Whether all muscles are empty by now; valves that do not vent fill them at once."""
        self.below = all(pressure < self._limit for pressure in pressures)
        filled = not all(pressure < _FILLED_AGAIN * self._limit for pressure in pressures)
        if not (filled if self.empty else self.below):
            self._changing_since = math.inf
            return
        self._changing_since = min(self._changing_since, now)
        unknown = any(math.isnan(pressure) for pressure in pressures)
        wait = 0.0 if self.empty and (unknown or not venting) else _AGREED
        if now - self._changing_since >= wait:
            self.empty = not self.empty
            self._changing_since = math.inf

    def start_again(self) -> None:
        """Give the muscles the whole time once more, as after faults were cleared."""
        self._since = math.inf

    def remaining(self) -> str:
        """The muscles that are not measured empty, as one line; empty if all are."""
        found = "; ".join(
            f"{name}: still {pressure:.0f} Pa"
            if math.isfinite(pressure)
            else f"{name}: its pressure is unknown"
            for name, pressure in zip(self._names, self._pressures, strict=True)
            if not pressure < self._limit
        )
        if found or self.empty:
            return found
        return f"below {self._limit:.0f} Pa for less than {1e3 * _AGREED:.0f} ms"

    def conditions(self, now: float) -> Iterator[Condition]:
        """One condition for each muscle that does not become empty."""
        if self.empty or not now - self._since > self.timeout:
            return
        for name, pressure in zip(self._names, self._pressures, strict=True):
            if pressure >= self._limit:
                text = (
                    f"still {pressure:.0f} Pa after {self.timeout:.3g} s of venting, "
                    f"vented_pressure is {self._limit:.0f} Pa: exhaust blocked or valve stuck; "
                    "shut the air supply"
                )
                yield Condition("exhaust_blocked", name, text)


def exhaust_timeout(robot: Robot, vented_pressure: float) -> float:
    """A time limit for emptying the muscles, from their volumes and conductances [s].

    Parameters
    ----------
    robot : Robot
        Gives volumes, conductances and highest pressures.
    vented_pressure : float
        A muscle is empty below this pressure [Pa gauge].

    Returns
    -------
    float
        Four times the ideal time of the slowest muscle from its highest pressure, plus a second.
    """
    slowest = max(
        time_to_empty(robot, muscle, max(muscle.max_pressure, vented_pressure), vented_pressure)
        for muscle in robot.muscles
    )
    return _NARROWER * slowest + _ADDED
