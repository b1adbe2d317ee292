"""Faults of sensors, valves and boards of a simulated rig. No bus, no clock of its own.

A sensor fault changes the reading of a converter, after noise and rounding. A valve fault changes
the position of a valve regardless of its board's command. A frozen board neither receives nor
sends, and its valves do not move until its hardware watchdog resets it.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from pam_driver.boards.protocol import Address
from pam_sim.boards.protocol import BoardValve

Reading = Callable[[float, float], float]
"""Turns (true reading, time) into the faulty reading."""
POSITION = -1  # number of a board's first angle; its pressures are numbered from 0


def stuck() -> Reading:
    """Repeats the first reading for ever."""
    kept: list[float] = []

    def show(value: float, time: float) -> float:
        if not kept:
            kept.append(value)
        return kept[0]

    return show


def noisy(amplitude: float, seed: int = 0) -> Reading:
    """Adds Gaussian noise with the standard deviation `amplitude` in the sensor's unit."""
    draw = random.Random(seed)
    return lambda value, time: value + draw.gauss(0.0, amplitude)


def constant(shown: float) -> Reading:
    """Always reads `shown`, NaN for "not available": shorted, disconnected, out of range."""
    return lambda value, time: shown


def drifting(rate: float, start: float) -> Reading:
    """Drifts by `rate` per second, beginning at `start` [s]."""
    return lambda value, time: value + rate * (time - start)


def offset(by: float) -> Reading:
    """Adds a constant offset."""
    return lambda value, time: value + by


def lagging(time_constant: float) -> Reading:
    """Follows the value with a first-order lag [s]."""
    last: list[float] = []

    def show(value: float, time: float) -> float:
        if not last:
            last[:] = [value, time]
        share = 1.0 - math.exp(-(time - last[1]) / time_constant)
        last[:] = [last[0] + share * (value - last[0]), time]
        return last[0]

    return show


@dataclass(slots=True)
class RigFaults:
    """The present faults."""

    # faulty readings by (board, input): pressures are numbered from 0, the encoder is `POSITION`
    sensors: dict[tuple[Address, int], Reading] = field(default_factory=dict)
    # by (board, valve): the opening at which a valve is stuck, -1 to 1, NaN for its present one
    valves: dict[tuple[Address, int], float] = field(default_factory=dict)
    # by (board, valve): the largest opening to ambient, 0 for a blocked exhaust
    exhausts: dict[tuple[Address, int], float] = field(default_factory=dict)
    # boards whose first two valves are connected to each other's muscle
    crossed: set[Address] = field(default_factory=set)
    # boards whose processor hangs, with the time at which a hardware watchdog resets them [s]; it
    # is not the watchdog that supervises commands
    frozen: dict[Address, float] = field(default_factory=dict)
    # boards that are not connected to their bus, with their supply of power
    unplugged: set[Address] = field(default_factory=set)
    # boards whose pressure sensors are exchanged
    swapped: set[Address] = field(default_factory=set)

    def clear(self) -> None:
        """End all faults."""
        self.sensors.clear()
        self.valves.clear()
        self.exhausts.clear()
        self.crossed.clear()
        self.frozen.clear()
        self.unplugged.clear()
        self.swapped.clear()

    @property
    def move_valves(self) -> bool:
        """Whether a valve may do something else than its board commands."""
        return bool(self.valves or self.exhausts or self.crossed)

    def readings(
        self, board: Address, pressures: Sequence[float], angles: Sequence[float], now: float
    ) -> tuple[list[float], list[float]]:
        """The readings of a board's sensors with their faults."""
        shown, turned = list(pressures), list(angles)
        if board in self.swapped:
            shown.reverse()
        for place, value in enumerate(shown):
            fault = self.sensors.get((board, place))
            if fault is not None:
                shown[place] = fault(value, now)
        fault = self.sensors.get((board, POSITION))
        if fault is not None and turned:
            turned[0] = fault(turned[0], now)
        return shown, turned

    def spools(
        self, board: Address, commands: Sequence[float], kinds: Sequence[BoardValve]
    ) -> Sequence[float]:
        """The commands of a board's valves with their faults."""
        done = list(commands)
        for place, kind in enumerate(kinds):
            opening = self.valves.get((board, place))
            if opening is None:
                continue
            if math.isnan(opening):
                opening = commands[place] / kind.full_scale
                self.valves[board, place] = opening
            done[place] = max(opening, 0.0) * kind.full_scale if kind.is_regulator else opening
        for (where, place), share in self.exhausts.items():
            if where == board and not kinds[place].is_regulator:
                done[place] = max(done[place], -share)
        if board in self.crossed:
            done[0], done[1] = done[1], done[0]
        return tuple(done)

    def reset_by_watchdog(self, now: float) -> list[Address]:
        """Boards that their hardware watchdog resets now; they are no longer frozen."""
        due = [board for board, until in self.frozen.items() if now > until]
        for board in due:
            del self.frozen[board]
        return due
