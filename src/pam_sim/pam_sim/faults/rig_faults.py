"""What can be broken on a simulated rig: sensors, valves, boards. No bus, no clock of its own.

A sensor fault changes what a converter shows, after noise and rounding; a valve fault changes what
a valve does whatever its board says; a frozen board neither hears nor speaks, and its valves stay
as they were until its hardware watchdog resets it.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from pam_driver.boards.protocol import Address
from pam_sim.boards.protocol import BoardValve

Reading = Callable[[float, float], float]
"""(true reading, time) to what is shown."""
POSITION = -1  # a board's first angle, beside its pressures, which are counted from 0


def stuck() -> Reading:
    """Shows the first reading for ever."""
    kept: list[float] = []

    def show(value: float, time: float) -> float:
        if not kept:
            kept.append(value)
        return kept[0]

    return show


def noisy(amplitude: float, seed: int = 0) -> Reading:
    """Adds Gaussian noise of a standard deviation in the sensor's unit."""
    draw = random.Random(seed)
    return lambda value, time: value + draw.gauss(0.0, amplitude)


def constant(shown: float) -> Reading:
    """Shows a number, NaN for "not available": shorted, torn off, out of range."""
    return lambda value, time: shown


def drifting(rate: float, start: float) -> Reading:
    """Runs away by `rate` per second from `start` [s] on."""
    return lambda value, time: value + rate * (time - start)


def offset(by: float) -> Reading:
    """Jumps once and stays there."""
    return lambda value, time: value + by


@dataclass(slots=True)
class RigFaults:
    """What is broken now.

    Attributes
    ----------
    sensors : dict
        By (board, input): the pressures from 0 on, `POSITION` the encoder.
    swapped : set of int or str
        Boards whose pressure sensors are plugged the wrong way round.
    valves : dict
        By (board, valve): the opening a valve is stuck at, -1 to 1, NaN to stay where it is.
    frozen : dict of int or str to float
        Boards whose processor hangs, and when a hardware watchdog, apart from the one on commands,
        resets them [s].
    """

    sensors: dict[tuple[Address, int], Reading] = field(default_factory=dict)
    valves: dict[tuple[Address, int], float] = field(default_factory=dict)
    frozen: dict[Address, float] = field(default_factory=dict)
    swapped: set[Address] = field(default_factory=set)

    def clear(self) -> None:
        """Everything works again."""
        self.sensors.clear()
        self.valves.clear()
        self.frozen.clear()
        self.swapped.clear()

    def readings(
        self, board: Address, pressures: Sequence[float], angles: Sequence[float], now: float
    ) -> tuple[list[float], list[float]]:
        """What the sensors of a board show of their readings."""
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
        """What the valves of a board do with its commands."""
        done = list(commands)
        for place, kind in enumerate(kinds):
            opening = self.valves.get((board, place))
            if opening is None:
                continue
            if math.isnan(opening):
                opening = commands[place] / kind.full_scale
                self.valves[board, place] = opening
            done[place] = max(opening, 0.0) * kind.full_scale if kind.is_regulator else opening
        return tuple(done)

    def reset_by_watchdog(self, now: float) -> list[Address]:
        """Boards whose hardware watchdog fires now; they are frozen no longer."""
        due = [board for board, until in self.frozen.items() if now > until]
        for board in due:
            del self.frozen[board]
        return due
