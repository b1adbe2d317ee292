"""The driver's health for /diagnostics: what is wrong, how often, and the last occurrence."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

from pam_driver.boards.protocol import Board, Promises
from pam_driver.bus import BusState, CanPort
from pam_driver.driver import Driver
from pam_driver.safety.states import SafetyState
from pam_ros.diagnostics import ERROR, OK, WARN, diagnostic_status, loop_values
from pam_ros.periodic import LoopStatistics

# Frames of other devices on a shared bus are legitimate: they are counted, without a warning.
_HARMLESS = frozenset({"unknown_id", "unknown_board", "extended_id", "remote_or_fd"})


class DriverDiagnostics:
    """Makes the statuses; remembers the last counts, so that it warns of new events only.

    Parameters
    ----------
    driver : Driver
        The driver whose health is reported.
    port : CanPort
        Its bus.
    bitrate : float
        Needed to compute the bus load [bit/s].

    Attributes
    ----------
    commanders : int
        How many nodes publish valve commands; the driver cannot distinguish several.
    """

    def __init__(self, driver: Driver, port: CanPort, bitrate: float) -> None:
        self.commanders = 0
        self._driver = driver
        self._port = port
        self._bitrate = bitrate
        self._counted: Counter[str] = Counter()
        self._rejected = 0
        self._late = 0
        self._bits = 0
        self._time: float | None = None

    def statuses(self, loop: LoopStatistics, now: float) -> list[Any]:
        """One status each for safety, bus, commands, loop and every board.

        Parameters
        ----------
        loop : LoopStatistics
            Timing of the I/O thread.
        now : float
            Monotonic time [s].
        """
        boards = [self._board(board) for board in self._driver.boards.values()]
        return [self._safety(), self._bus(now), self._commands(), self._loop(loop), *boards]

    def _safety(self) -> Any:
        driver = self._driver
        wrong = driver.faults if driver.state is SafetyState.FAULT else driver.conditions
        text = "; ".join(str(condition) for condition in wrong)
        level = OK
        if driver.state is SafetyState.FAULT:
            level, text = ERROR, f"vented, latched: {text}"
        elif wrong:
            level, text = WARN, f"{driver.state.value}: {text}"
        elif driver.suspicions:
            suspected = "; ".join(str(suspicion) for suspicion in driver.suspicions)
            level, text = WARN, f"{driver.state.value}, suspected: {suspected}"
        values: dict[str, object] = {"state": driver.state.value}
        values |= {f"fault {place}": str(fault) for place, fault in enumerate(driver.faults)}
        values |= {f"now {place}": str(found) for place, found in enumerate(driver.conditions)}
        values |= {f"suspected {place}": str(one) for place, one in enumerate(driver.suspicions)}
        return diagnostic_status("pam_driver: safety", level, text or driver.state.value, values)

    def _bus(self, now: float) -> Any:
        port, driver = self._port, self._driver
        elapsed = now - self._time if self._time is not None else 0.0
        load = (port.bits - self._bits) / elapsed / self._bitrate if elapsed > 0.0 else 0.0
        self._time, self._bits = now, port.bits
        counts = port.counts + driver.frame_errors
        last: Mapping[str, str] = port.last_offender | driver.last_frame_error
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
        return diagnostic_status("pam_driver: bus", level, text, values, port.name)

    def _commands(self) -> Any:
        intake = self._driver.intake
        rejected = sum(intake.rejected.values())
        new = rejected - self._rejected
        self._rejected = rejected
        values: dict[str, object] = {"accepted": intake.accepted, "refused": rejected}
        values |= {f"refused: {kind}": count for kind, count in sorted(intake.rejected.items())}
        if intake.last_rejection:
            values["last refused"] = intake.last_rejection
        text = f"{new} refused: {intake.last_rejection}" if new else "ok"
        level = WARN if new else OK
        if self.commanders > 1:
            level, text = WARN, f"{self.commanders} nodes publish valve_commands, expected one"
        return diagnostic_status("pam_driver: valve_commands", level, text, values)

    def _loop(self, loop: LoopStatistics) -> Any:
        late = loop.late + loop.skipped
        new = late - self._late
        self._late = late
        text = f"{new} cycles late or skipped" if new else "ok"
        # a few late cycles are normal on a kernel without PREEMPT_RT
        level = WARN if new > 50 else OK
        return diagnostic_status("pam_driver: loop", level, text, loop_values(loop))

    def _board(self, board: Board) -> Any:
        wrong = [found for found in self._driver.conditions if found.subject == board.name]
        report = board.report()
        values = {**report.values, **_promised(board.promises)}
        text = report.text
        if wrong:
            text = "; ".join(found.text for found in wrong)
        level = ERROR if wrong else OK
        return diagnostic_status(f"pam_driver: {board.name}", level, text, values, board.name)


def _promised(promises: Promises) -> dict[str, object]:
    """The diagnostic values that show what a board does for safety by itself."""
    seconds = promises.watchdog
    return {"vents by itself without commands after [s]": "never" if seconds is None else seconds}
