"""The measurements of a device: from the payloads of its TPDOs to samples in SI units."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final

from pam_driver.boards.canopen.device import ANGLE_INPUT, PRESSURE_INPUT, Input, Tpdo
from pam_driver.boards.frame_errors import FrameLengthError, FrameRangeError
from pam_driver.boards.protocol import NEVER, Channel, Hear, Sample, WiredBoard

_TURN: Final = 2.0 * math.pi


class Measurements:
    """What a device has measured.

    Parameters
    ----------
    wired : WiredBoard
        Its muscles and joints.
    node : int
        Its node number, for messages.
    answers : tuple of Tpdo
        Its PDOs with measurements.
    heard : callable
        Called after each valid PDO.

    Attributes
    ----------
    pressures, angles : dict of channel to Sample
        The last samples [Pa gauge], [rad].
    supply_pressure : float
        [Pa absolute]; NaN if none was received.
    invalid : dict of str to str
        By measurement, the name of the value that means that there is none.
    heard_at : dict of str to float
        By PDO, when it was last received, monotonic [s].
    listeners : dict of int to Hear
        By identifier, what takes the payload.
    """

    def __init__(
        self,
        wired: WiredBoard,
        node: int,
        answers: tuple[Tpdo, ...],
        heard: Callable[[], None],
    ) -> None:
        self.pressures: dict[Channel, Sample] = {wire.channel: Sample() for wire in wired.pressures}
        self.angles: dict[Channel, Sample] = {angle.channel: Sample() for angle in wired.angles}
        self.supply_pressure = math.nan
        self.invalid: dict[str, str] = {}
        self.heard_at = {f"TPDO{pdo.number}": NEVER for pdo in answers}
        self._node, self._heard = node, heard
        self.listeners: Mapping[int, Hear] = {pdo.frame_id: self._listener(pdo) for pdo in answers}

    def missing(self, now: float, timeout: float) -> list[str]:
        """The names of the PDOs that are older than `timeout` [s]."""
        return [name for name, time in self.heard_at.items() if now - time > timeout]

    def invalid_texts(self) -> list[str]:
        """The measurements that the device says it does not have."""
        return [f"{what}: {name}" for what, name in self.invalid.items()]

    def _listener(self, pdo: Tpdo) -> Hear:
        entries = tuple((entry, _name(entry), self._store(entry)) for entry in pdo.inputs)
        name = f"TPDO{pdo.number}"
        objects = ", ".join(str(entry.field.name) for entry in pdo.inputs)

        def hear(data: bytes, time: float, stamp: float) -> None:
            if len(data) != pdo.length:
                raise FrameLengthError(
                    pdo.frame_id,
                    f"{name} of node {self._node} ({objects}) has {len(data)} bytes, expected "
                    f"{pdo.length}",
                )
            word = int.from_bytes(data, "little")
            found = []
            for entry, called, store in entries:
                raw = entry.field.raw(word)
                invalid = entry.invalid.get(int(raw), "") if entry.invalid else ""
                if raw != raw:  # noqa: PLR0124  (NaN)
                    invalid = "not a number"
                elif not invalid and not entry.low <= raw <= entry.high:
                    raise FrameRangeError(
                        pdo.frame_id,
                        f"{name} of node {self._node}, {entry.field.name} is {raw:g} raw, expected "
                        f"{entry.low:g} to {entry.high:g}",
                    )
                found.append((called, store, invalid, entry.gain * raw + entry.bias))
            self.heard_at[name] = time
            self._heard()
            for called, store, invalid, value in found:
                if invalid:
                    self.invalid[called] = invalid
                else:
                    self.invalid.pop(called, None)
                    store(value, time, stamp)

        return hear

    def _store(self, entry: Input) -> Callable[[float, float, float], None]:
        """The function that keeps a valid measurement."""

        def pressure(value: float, time: float, stamp: float) -> None:
            self.pressures[entry.channel] = Sample(value, time, stamp)

        def angle(value: float, time: float, stamp: float) -> None:
            if entry.wraps:
                value = math.remainder(value, _TURN)
            self.angles[entry.channel] = Sample(value, time, stamp)

        def supply(value: float, time: float, stamp: float) -> None:
            self.supply_pressure = value

        if entry.what == PRESSURE_INPUT:
            return pressure
        return angle if entry.what == ANGLE_INPUT else supply


def _name(entry: Input) -> str:
    return f"{entry.what} {entry.channel}".strip()
