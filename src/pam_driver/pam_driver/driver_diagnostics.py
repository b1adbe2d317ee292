"""The driver's health for /diagnostics: what is wrong, how often, and the last occurrence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pam_driver.boards.protocol import Board
from pam_driver.boards.weaker_promises import weaker_promises
from pam_driver.bus_diagnostics import BusDiagnostics
from pam_driver.can_bus.bus import CanPort
from pam_driver.driver import Driver
from pam_driver.safety.states import FAULTY
from pam_ros.diagnostics import ERROR, OK, WARN, diagnostic_status, loop_values
from pam_ros.periodic import LoopStatistics


class DriverDiagnostics:
    """Makes the statuses; remembers the last counts, so that it warns of new events only.

    Parameters
    ----------
    driver : Driver
        The driver whose health is reported.
    ports : CanPort, or mapping of str to CanPort
        Its bus, or its buses by name.
    bitrates : float, or mapping of str to float
        Needed to compute the bus load [bit/s].

    Attributes
    ----------
    commanders : int
        How many nodes publish valve commands; the driver cannot distinguish several.
    unmeasured : sequence of str
        Joints without a fresh measurement.
    """

    def __init__(
        self,
        driver: Driver,
        ports: CanPort | Mapping[str, CanPort],
        bitrates: float | Mapping[str, float],
    ) -> None:
        self.commanders = 0
        self.unmeasured: Sequence[str] = ()
        self._driver = driver
        named = ports if isinstance(ports, Mapping) else {"": ports}
        rates = bitrates if isinstance(bitrates, Mapping) else dict.fromkeys(named, bitrates)
        self._buses = {
            name: BusDiagnostics(name, port, rates[name]) for name, port in named.items()
        }
        self._rejected = 0
        self._late = 0

    def statuses(self, loop: LoopStatistics, now: float) -> list[Any]:
        """One status each for safety, every bus, commands, joint states, loop and every board."""
        boards = [self._board(board) for board in self._driver.boards.values()]
        errors = self._driver.errors_by_bus
        buses = [bus.status(*errors[name], now) for name, bus in self._buses.items()]
        measured = [self._commands(), self._joint_states()]
        return [self._safety(), *buses, *measured, self._loop(loop), *boards]

    def _safety(self) -> Any:
        driver = self._driver
        wrong = driver.faults if driver.state in FAULTY else driver.conditions
        text = "; ".join(str(condition) for condition in wrong)
        level = OK
        if driver.state in FAULTY:
            done = "lowering" if driver.lowers else "vented"
            level, text = ERROR, f"{done}, latched: {text}"
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

    def _joint_states(self) -> Any:
        missing = ", ".join(self.unmeasured)
        text = f"not measured: {missing}" if missing else "ok"
        return diagnostic_status(
            "pam_driver: joint_states", WARN if missing else OK, text, {"not measured": missing}
        )

    def _loop(self, loop: LoopStatistics) -> Any:
        late = loop.late + loop.skipped
        new = late - self._late
        self._late = late
        text = f"{new} cycles late or skipped" if new else "ok"
        # a few late cycles are normal on a kernel without PREEMPT_RT
        level = WARN if new > 50 else OK
        delays = self._driver.loop
        values = loop_values(loop) | {
            "extra delay [ms]": 1e3 * delays.extra_delay,
            "measurement age [ms]": 1e3 * delays.measurement_age,
            "command age on arrival [ms]": 1e3 * delays.command_age,
        }
        return diagnostic_status("pam_driver: loop", level, text, values)

    def _board(self, board: Board) -> Any:
        wrong = [found for found in self._driver.conditions if found.subject == board.name]
        report = board.report()
        values = {**report.values, **_promised(board)}
        values["command to echo [ms]"] = 1e3 * board.round_trip
        text = report.text
        if wrong:
            text = "; ".join(found.text for found in wrong)
        level = ERROR if wrong else OK
        return diagnostic_status(f"pam_driver: {board.name}", level, text, values, board.name)


def _promised(board: Board) -> dict[str, object]:
    """The diagnostic values that show what a board does for safety by itself."""
    seconds = board.promises.watchdog
    return {
        "vents by itself without commands after [s]": "never" if seconds is None else seconds,
        **{f"weaker {i}": line for i, line in enumerate(weaker_promises(board))},
    }
