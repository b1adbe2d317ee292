"""The measurements of a device: from the payloads of its TPDOs to samples in SI units."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from pam_driver.boards.canopen.device import Tpdo
from pam_driver.boards.frame_errors import FrameLengthError
from pam_driver.boards.protocol import NEVER, Hear, WiredBoard
from pam_driver.boards.samples import Samples


class PdoSamples(Samples):
    """What a device has measured, and how its PDOs say it.

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
        super().__init__(wired)
        self.heard_at = {f"TPDO{pdo.number}": NEVER for pdo in answers}
        self._node, self._heard = node, heard
        self.listeners: Mapping[int, Hear] = {pdo.frame_id: self._listener(pdo) for pdo in answers}

    def missing(self, now: float, timeout: float) -> list[str]:
        """The names of the PDOs that are older than `timeout` [s]."""
        return [name for name, time in self.heard_at.items() if now - time > timeout]

    def _listener(self, pdo: Tpdo) -> Hear:
        entries = tuple(
            (
                entry,
                self.keeper(entry.what, entry.channel, wraps=entry.wraps),
                self.misser(entry.what, entry.channel),
            )
            for entry in pdo.inputs
        )
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
            found, missed = [], []
            for entry, keep, miss in entries:
                raw = entry.field.raw(word)
                invalid = entry.invalid.get(int(raw), "") if entry.invalid else ""
                if raw != raw:  # noqa: PLR0124  (NaN)
                    invalid = "not a number"
                elif not invalid and not entry.low <= raw <= entry.high:
                    text = (
                        f"{entry.field.name} is {raw:g} raw, outside the range {entry.low:g} to "
                        f"{entry.high:g} of the EDS file"
                    )
                    missed.append((miss, text))
                    continue
                found.append((keep, invalid, entry.gain * raw + entry.bias))
            self.heard_at[name] = time
            self._heard()
            for keep, invalid, value in found:
                keep(invalid, value, time, stamp)
            for miss, text in missed:
                miss(text, time)

        return hear
