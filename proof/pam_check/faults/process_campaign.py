"""The rig's faults once each on real processes: rig, driver and controller over a bus and ROS.

`pam check processes --out out/faults/processes.md` complements
`pam_check.faults.campaign`, which gives the statistics: here sockets, ROS, threads and the host's
scheduler take part. A fault is out of bounds if it must vent and does not vent within its bound
plus `HOST`, or if it must be tolerated and stops the joint.

A host that is busy for a moment also stops the joint, by the same time-outs as some faults. A trial
is repeated, at most `TRIES` times in total, if the host may be the cause: a stop by a time-out that
is unrelated to the fault, a stop that is too early, or a vent that is too late.
"""

from __future__ import annotations

import re
import signal
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol

from pam_check.fault_kinds.fault_kind import LOWERING, STOPS, FaultKind, Reaction
from pam_check.fault_kinds.kinds import KINDS
from pam_check.faults.chosen_kinds import kinds_called
from pam_demo.chain import Chain, multicast_bus, private_domain
from pam_driver.can_bus.bus import CanPort, open_bus
from pam_model.argument_types import make_parents
from pam_model.command_line import Arguments, Outcome
from pam_model.common_options import chosen_rig
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig
from pam_sim.fault_injection import FAULTS

HOST = 0.06  # s, for the injection, the period of the board's status and a busy host
PATIENCE = 120.0  # s, until nodes have started (again) on a busy host
HOST_FAULTS = (
    "driver_stopped", "driver_killed", "controller_stopped", "controller_killed", "vent_called"
)  # fmt: skip
START = ("rig", "driver", "controller", "model")
TOGETHER = ("rig", "robot")
"""What is started, with driver and controller as two processes or as one."""

# If the frames of a board are lost, it cannot report that it has vented; then the driver's commands
# are observed. The same is done for kinds whose bound applies to the driver alone.
UNHEARD = ("all_frames_lost_up", "frames_very_late_up")
QUIET = 0.05  # s, without a command that allows air flow

TRIES: Final = 3
TOO_EARLY: Final = 0.5  # share of the bound; an expected time-out does not stop the joint earlier
KEPT, REPEAT = "kept", "repeat"
# Texts in the driver's diagnostics for stops that a busy host may cause as well, by their names in
# `FaultKind.detected_by`.
TIME_OUTS: Final = {
    "command_timeout": re.compile(r"no valid command for"),
    "stale_sensor": re.compile(r"no (pressure|angle) for"),
    "WATCHDOG": re.compile(r"fault: .*watchdog"),
    "board_lost": re.compile(r"no (measurement|status|heartbeat)"),
    "board_not_active": re.compile(r"although it was commanded to be active"),
    "send_blocked": re.compile(r"nothing could be sent for"),
}

Row = tuple[str, str, str, str, str, str]


@dataclass(frozen=True, slots=True)
class Observation:
    """Observed reaction to one fault."""

    stopped: bool  # whether the air flow has stopped
    silent: bool  # whether no node was left that could report it
    after: float  # time from the fault to the last report of air flow [s]
    diagnostics: str  # text of the driver's diagnostics


class Operator(Protocol):
    """Moves the joints, injects faults and observes; `operator_node` implements it with ROS.

    Attributes
    ----------
    last_air, last_enabled : float
        Last times when a board allowed air flow, and when the driver commanded it, monotonic [s].
    fault, suspicion : str
        Last texts of the driver's diagnostics since `forget`.
    """

    last_air: float
    last_enabled: float
    fault: str
    suspicion: str

    @property
    def moves_air(self) -> bool:
        """Whether any board reports that it allows air flow."""
        ...

    def forget(self) -> None:
        """Delete the stored texts of the diagnostics."""
        ...

    def run(self, duration: float, until: Callable[[], bool] = ...) -> bool:
        """Move and observe for a time [s] or until a condition is true; return if it is true."""
        ...

    def inject(self, text: str) -> float:
        """Inject a fault of the rig and return the time."""
        ...

    def trigger(self, name: str) -> None:
        """Call a service of the rig or the driver."""
        ...

    def ready(self) -> bool:
        """Whether all services and subscribers are available."""
        ...

    def make_move(self, patience: float) -> None:
        """Remove faults, clear and activate until the boards allow air flow."""
        ...


OpenOperator = Callable[[Rig, CanPort, Mapping[str, str]], AbstractContextManager[Operator]]
"""Creates the operator of this rig on this bus, in the ROS domain of this environment."""


def time_outs(diagnostics: str) -> set[str]:
    """The time-outs in the diagnostics; empty if a stop also has another reason."""
    _, _, reasons = diagnostics.partition("latched: ")
    found: set[str] = set()
    for reason in filter(None, reasons.split("; ")):
        if reason.startswith("last refused"):  # an addition to command_timeout
            continue
        names = {name for name, pattern in TIME_OUTS.items() if pattern.search(reason)}
        if not names:
            return set()
        found |= names
    return found


def judge(kind: FaultKind, seen: Observation) -> tuple[str, str]:
    """Return `KEPT`, `REPEAT` if the host may be the cause, or "failed"; and the reason."""
    vents = kind.reaction in STOPS
    if vents and (seen.silent or not seen.stopped):
        return "failed", "not vented"
    doubt = _doubt(kind, seen) if seen.stopped else ""
    if doubt:
        return REPEAT, doubt
    if seen.stopped and kind.reaction in {Reaction.RIDE, Reaction.WARN}:
        return "failed", "stopped"
    return KEPT, ""


def _doubt(kind: FaultKind, seen: Observation) -> str:
    """Why the host may be the cause of a stop; empty if the fault is the cause."""
    vents = kind.reaction in STOPS
    by = time_outs(seen.diagnostics)
    why = ", ".join(sorted(by)) or "an unknown cause"
    # a time-out may also appear as the board's own fault
    expected = by & set(kind.detected_by) or "board_fault" in kind.detected_by
    unexplained = not vents and not seen.diagnostics
    if kind.reaction is not Reaction.EITHER and (by or unexplained) and not expected:
        return f"stopped by {why}"
    bound = _time_to_vented(kind) + HOST
    if vents and seen.after > bound:
        return f"late, bound {1e3 * bound:.0f} ms"
    if vents and by and seen.after < TOO_EARLY * kind.bound:
        return f"stopped by {why} too early"
    return ""


def _time_to_vented(kind: FaultKind) -> float:
    """Largest time from the fault to vented valves [s]."""
    return kind.bound + (LOWERING if kind.reaction is Reaction.LOWER else 0.0)


def _begin(chain: Chain, operator: Operator, kind: FaultKind) -> float:
    """Inject the fault and return the time."""
    if kind.name in FAULTS:
        return operator.inject(kind.name)
    if kind.name == "vent_called":
        begin = time.monotonic()
        operator.trigger("pam_driver/vent")
        return begin
    name, what = _process_of(chain, kind)
    process = chain.processes[name]
    begin = time.monotonic()
    process.send(signal.SIGKILL if what == "killed" else signal.SIGSTOP)
    return begin


def _end(chain: Chain, kind: FaultKind) -> None:
    """Continue or restart the process that was stopped."""
    if kind.name in FAULTS or kind.name == "vent_called":
        return
    name, what = _process_of(chain, kind)
    if what == "stopped":
        chain.processes[name].send(signal.SIGCONT)
    else:
        chain.processes.pop(name).wait(5.0)
        _start(chain, name)


def _process_of(chain: Chain, kind: FaultKind) -> tuple[str, str]:
    """The process that a kind is about, and what happens to it."""
    name, _, what = kind.name.partition("_")
    return ("robot" if "robot" in chain.processes else name), what


def start_nodes(chain: Chain, *, one_process: bool) -> None:
    """Start the simulated rig and its nodes, with `one_process` as one program of the robot."""
    for name in TOGETHER if one_process else START:
        _start(chain, name)


def _start(chain: Chain, name: str) -> None:
    if name == "robot":
        chain.start_robot()
    else:
        chain.start(name)


def observe(chain: Chain, operator: Operator, kind: FaultKind) -> Observation:
    """Inject one fault into a moving chain and observe the reaction."""
    operator.make_move(PATIENCE)
    operator.forget()
    vents = kind.reaction in STOPS
    begin = _begin(chain, operator, kind)
    deaf = kind.name in UNHEARD or kind.bounds_driver

    def has_stopped() -> bool:
        now = time.monotonic()
        if deaf:
            return now - operator.last_enabled > QUIET
        return now > begin + 0.03 and not operator.moves_air

    stopped = operator.run(_time_to_vented(kind) + 0.5 if vents else 0.8, has_stopped)
    after = (operator.last_enabled if deaf else operator.last_air) - begin
    # a stopped driver reports nothing, so its last report proves nothing
    silent = kind.name.startswith("driver") and not stopped
    _end(chain, kind)
    reported: Callable[[], bool] = lambda: bool(operator.fault or operator.suspicion)  # noqa: E731
    operator.run(1.3, (lambda: bool(operator.fault)) if stopped else reported)
    return Observation(stopped, silent, max(after, 0.0), operator.fault or operator.suspicion)


def run_kind(chain: Chain, operator: Operator, kind: FaultKind) -> Row:
    """Repeat one fault until the host is not the cause of the result, and return its row."""
    tries = 0
    verdict = REPEAT
    while verdict == REPEAT and tries < TRIES:
        tries += 1
        seen = observe(chain, operator, kind)
        verdict, why = judge(kind, seen)
        if verdict == REPEAT:
            print(f"{kind.name}: {1e3 * seen.after:.0f} ms, {why}: repeat", flush=True)
    diagnostics = seen.diagnostics.replace("|", "/")
    shown = KEPT if verdict == KEPT else f"failed: {why}"
    return kind.name, kind.reaction.value, f"{1e3 * seen.after:.0f}", diagnostics, str(tries), shown


def run_all(
    rig_path: Path,
    kinds: Sequence[FaultKind],
    open_operator: OpenOperator,
    *,
    one_process: bool = False,
) -> Iterator[Row]:
    """Run every kind in turn on one chain of processes.

    With `one_process`, driver, controller and model are one of them.

    Raises
    ------
    PamError
        If the chain does not start, or does not become active again.
    """
    environment = private_domain()
    bus = multicast_bus()
    rig = load_rig(rig_path)
    port = open_bus(bus.interface, bus.channel, port=bus.port)
    try:
        with (
            open_operator(rig, port, environment) as operator,
            Chain([rig_path], bus, environment) as chain,
        ):
            start_nodes(chain, one_process=one_process)
            if not operator.run(PATIENCE, operator.ready):
                raise PamError(f"no chain within {PATIENCE:g} s")
            for kind in kinds:
                row = run_kind(chain, operator, kind)
                print(f"{row[0]}: {row[2]} ms, {row[-1]}", flush=True)
                yield row
    finally:
        port.close()


def run(given: Arguments, open_operator: OpenOperator) -> Outcome:
    """Run the campaign and write the table; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        If a kind is unknown, or not all kinds could be run; the finished kinds are written.
    """
    possible = [kind for kind in KINDS if kind.name in {*FAULTS, *HOST_FAULTS}]
    if given.one_process:
        possible = [kind for kind in possible if not kind.name.startswith("controller_")]
    kinds = kinds_called(given.kind, possible)
    done: list[Row] = []
    try:
        rows = run_all(chosen_rig(given), kinds, open_operator, one_process=given.one_process)
        for row in rows:
            done.append(row)  # the kinds before a failure are reported as well
    except PamError as error:
        left = len(kinds) - len(done)
        raise PamError(f"ended before {left} kinds more: {error}") from None
    finally:
        if done:
            lines = [
                "| fault | must follow | vented after [ms] | diagnostics | tries | verdict |",
                "|---" * 6 + "|",
                *("| " + " | ".join(row) + " |" for row in done),
            ]
            make_parents(given.out).write_text("\n".join(lines) + "\n", encoding="utf-8")
    bad = [row for row in done if row[-1] != KEPT]
    print(f"{len(done)} kinds on processes, {len(bad)} out of bounds: {given.out}")
    names = ("fault", "must_follow", "vented_after_ms", "diagnostics", "tries", "verdict")
    return Outcome(
        {
            "kinds": [dict(zip(names, row, strict=True)) for row in done],
            "out_of_bounds": len(bad),
            "page": given.out,
        },
        [f"{row[0]}: {row[-1]}" for row in bad],
    )
