"""The last measurements of a device, for kinds of board whose rig file says what each signal is."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Final

from pam_driver.boards.availability import Availability
from pam_driver.boards.protocol import Channel, Condition, Sample, WiredBoard

PRESSURE_INPUT: Final = "pressure"
ANGLE_INPUT: Final = "angle"
SUPPLY_INPUT: Final = "supply"
_TURN: Final = 2.0 * math.pi

Keep = Callable[[str, float, float, float], None]
"""Keeps a measurement: the name of the value that means that there is none (else empty), the value
in SI units, when it was measured (monotonic) and its stamp [s]."""
Miss = Callable[[str, float], None]
"""Notes a reading out of the range of the device's file: its text, and when it was measured [s]."""


class Samples:
    """What a device has measured.

    Attributes
    ----------
    pressures, angles : dict of channel to Sample
        The last samples [Pa gauge], [rad].
    supply_pressure : float
        [Pa absolute]; NaN if none was received.
    availability : Availability
        How often there was none.
    out_of_range : int
        Readings outside the range of the device's file so far.
    """

    def __init__(self, wired: WiredBoard) -> None:
        self.pressures: dict[Channel, Sample] = {wire.channel: Sample() for wire in wired.pressures}
        self.angles: dict[Channel, Sample] = {angle.channel: Sample() for angle in wired.angles}
        self.supply_pressure = math.nan
        self.availability = Availability()
        self.out_of_range = 0
        self._invalid: dict[str, str] = {}
        self._missed: dict[str, tuple[float, str]] = {}

    def missed(self, now: float, timeout: float) -> Iterator[str]:
        """The signals that have shown nothing within the range of their file for `timeout` [s].

        A reading out of range is no measurement; a single one has no other consequence.
        """
        for what, (since, text) in self._missed.items():
            if now - since > timeout:
                yield f"{what}: {text}"

    def range_conditions(self, board: str, now: float, timeout: float) -> Iterator[Condition]:
        """The condition of each signal that `missed` names."""
        for text in self.missed(now, timeout):
            yield Condition("sensor_range", board, text)

    def invalid_texts(self) -> list[str]:
        """The measurements that the device says it does not have."""
        return [f"{what}: {name}" for what, name in self._invalid.items()]

    def keeper(self, what: str, channel: Channel, *, wraps: bool = False) -> Keep:
        """The function that keeps one measurement.

        Parameters
        ----------
        what : str
            PRESSURE_INPUT [Pa gauge], ANGLE_INPUT [rad] or SUPPLY_INPUT [Pa absolute].
        channel : int, str
            As muscles and joints name it; "" for the supply pressure.
        wraps : bool, optional
            Bring an angle to -pi to pi.
        """
        called, invalids = f"{what} {channel}".strip(), self._invalid
        kept = self.pressures if what == PRESSURE_INPUT else self.angles

        def keep(invalid: str, value: float, time: float, stamp: float) -> None:
            self.availability.hear(what, channel, not invalid, time)
            if invalid:
                invalids[called] = invalid
                self._missed.pop(called, None)
                return
            invalids.pop(called, None)
            self._missed.pop(called, None)
            if what == SUPPLY_INPUT:
                self.supply_pressure = value
            else:
                value = math.remainder(value, _TURN) if wraps else value
                kept[channel] = Sample(value, time, stamp)

        return keep

    def misser(self, what: str, channel: Channel) -> Miss:
        """The function that notes a reading out of range; see `keeper` for the parameters."""
        called = f"{what} {channel}".strip()

        def miss(text: str, time: float) -> None:
            self.out_of_range += 1
            since = self._missed.get(called, (time,))[0]
            self._missed[called] = (since, text)

        return miss
