"""The health of one bus for /diagnostics: its state, its load, and what happened on it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

from pam_driver.can_bus.bus import BusState, CanPort
from pam_ros.diagnostics import ERROR, OK, WARN, diagnostic_status

# Frames of other devices on a shared bus are legitimate: they are counted, without a warning.
_HARMLESS = frozenset({"unknown_id", "unknown_board", "extended_id", "remote_or_fd"})


class BusDiagnostics:
    """Makes the status of one bus; remembers the last counts, to warn of new events only.

    Parameters
    ----------
    name : str
        Its name in the rig file; "" for the only bus of a robot.
    bitrate : float
        Needed to compute the bus load [bit/s].
    """

    def __init__(self, name: str, port: CanPort, bitrate: float) -> None:
        self._title = f"pam_driver: bus {name}".rstrip()
        self._port = port
        self._bitrate = bitrate
        self._counted: Counter[str] = Counter()
        self._bits = 0
        self._time: float | None = None

    def status(self, frame_errors: Counter[str], last_errors: Mapping[str, str], now: float) -> Any:
        """The status.

        Parameters
        ----------
        frame_errors : Counter
            Frames on this bus that were not valid messages, by kind.
        last_errors : mapping of str to str
            The last error of each kind.
        now : float
            Monotonic time [s].
        """
        port = self._port
        elapsed = now - self._time if self._time is not None else 0.0
        load = (port.bits - self._bits) / elapsed / self._bitrate if elapsed > 0.0 else 0.0
        self._time, self._bits = now, port.bits
        counts = port.counts + frame_errors
        last = {**port.last_offender, **last_errors}
        new = {
            kind: count - self._counted[kind]
            for kind, count in counts.items()
            if count > self._counted[kind] and kind not in _HARMLESS
        }
        self._counted = counts
        level = OK
        text = port.state.name.lower().replace("_", "-")
        if port.state in {BusState.BUS_OFF, BusState.DOWN}:
            level = ERROR
        elif new or port.state is not BusState.ERROR_ACTIVE:
            level = WARN
            text += "".join(
                f"; {count} {kind}: {last.get(kind, '')}".rstrip(": ")
                for kind, count in new.items()
            )
        values: dict[str, object] = {"bus load [%]": 100.0 * load}
        for kind in sorted(counts):
            values[kind] = counts[kind]
            if kind in last:
                values[f"{kind}, last"] = last[kind]
        return diagnostic_status(self._title, level, text, values, port.name)
