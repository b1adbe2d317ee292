"""The rig's faults once each on real processes: rig, driver and controller over a bus and ROS.

`python -m pam_check processes --out out/faults/processes.md` complements
`pam_check.faults.campaign`, which has the numbers: here sockets, ROS, threads and the host's
scheduler take part. Out of bounds is a fault that must vent and does not do so within its bound
and `HOST`, and one that must be ridden through and stops the joint.

A host that is busy for a moment stops the joint by itself, by the same time-outs that some faults
run into. What may be the host's doing - a stop by a time-out that the fault has nothing to do with,
one that comes too early, a vent that comes too late - is tried again, `TRIES` times in all.
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

from pam_check.chain import Chain, multicast_bus, private_domain
from pam_driver.bus import CanPort, open_bus
from pam_model.argument_types import make_parents
from pam_model.command_line import Arguments, Outcome, chosen_rig
from pam_model.errors import PamError
from pam_model.rig import load_rig
from pam_sim.fault_injection import INJECTIONS
from pam_sim.faults.kinds import KINDS, FaultKind, Reaction, kinds_called

HOST = 0.06  # s, for the way of the injection, a status of the board and a host that is busy
PATIENCE = 120.0  # s, for nodes to start, or to start again, on a busy host
HOST_FAULTS = (
    "driver_stopped", "driver_killed", "controller_stopped", "controller_killed", "vent_called"
)  # fmt: skip
START = ("rig", "driver", "controller")

# Boards that are not heard cannot say that they have vented; the driver's commands can. The same
# holds for kinds whose bound is about the driver alone.
UNHEARD = ("all_frames_lost_up", "frames_very_late_up")
QUIET = 0.05  # s, without a command that lets air move

TRIES: Final = 3
TOO_EARLY: Final = 0.5  # of the bound, for a stop by a time-out that is to be expected
KEPT, REPEAT = "kept", "repeat"
# What the driver's diagnostics say of stops that a busy host causes alike, by the names that
# `FaultKind.detected_by` has for them.
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
    """What one fault was seen to do.

    Attributes
    ----------
    stopped : bool
        Whether air has stopped.
    silent : bool
        Whether nobody was left who could tell.
    after : float
        From the fault to the last word of air [s].
    told : str
        What the driver's diagnostics said of it.
    """

    stopped: bool
    silent: bool
    after: float
    told: str


class Operator(Protocol):
    """Who moves the joints, breaks things and listens; `operator_node` is the one that speaks ROS.

    Attributes
    ----------
    last_air, last_enabled : float
        When a board last let air move, when the driver last told one to, monotonic [s].
    fault, suspicion : str
        What the driver's diagnostics said last, since `forget`.
    """

    last_air: float
    last_enabled: float
    fault: str
    suspicion: str

    @property
    def moves_air(self) -> bool:
        """Whether any board has said so last."""
        ...

    def forget(self) -> None:
        """What diagnostics said is of no interest any more."""
        ...

    def run(self, duration: float, until: Callable[[], bool] = ...) -> bool:
        """Move and listen for so long [s], or until something holds; whether it does."""
        ...

    def inject(self, text: str) -> float:
        """Bring a fault of the rig about; returns when."""
        ...

    def trigger(self, name: str) -> None:
        """Call a service of the rig or the driver."""
        ...

    def ready(self) -> bool:
        """Whether all that is needed is there."""
        ...

    def make_move(self, patience: float) -> None:
        """Mend, clear, activate until the boards let air move."""
        ...


OpenOperator = Callable[
    [tuple[str, ...], CanPort, Mapping[str, str]], AbstractContextManager[Operator]
]
"""Makes the operator of these joints on this bus, in the ROS domain of this environment."""


def time_outs(told: str) -> set[str]:
    """The time-outs that diagnostics name as the only reasons of a stop; empty if any is none."""
    _, _, reasons = told.partition("latched: ")
    found: set[str] = set()
    for reason in filter(None, reasons.split("; ")):
        if reason.startswith("last refused"):  # a remark of command_timeout
            continue
        names = {name for name, pattern in TIME_OUTS.items() if pattern.search(reason)}
        if not names:
            return set()
        found |= names
    return found


def judge(kind: FaultKind, seen: Observation) -> tuple[str, str]:
    """`KEPT`, `REPEAT` where the host may have done it, or "failed"; and why."""
    vents = kind.reaction is Reaction.VENT
    if vents and (seen.silent or not seen.stopped):
        return "failed", "not vented"
    doubt = _doubt(kind, seen) if seen.stopped else ""
    if doubt:
        return REPEAT, doubt
    if seen.stopped and kind.reaction in {Reaction.RIDE, Reaction.WARN}:
        return "failed", "stopped"
    return KEPT, ""


def _doubt(kind: FaultKind, seen: Observation) -> str:
    """Why a stop may be the host's; empty if it is the fault's."""
    vents = kind.reaction is Reaction.VENT
    by = time_outs(seen.told)
    why = ", ".join(sorted(by)) or "nobody knows what"
    # the board's own fault is the other half of a time-out
    expected = by & set(kind.detected_by) or "board_fault" in kind.detected_by
    unexplained = not vents and not seen.told
    if kind.reaction is not Reaction.EITHER and (by or unexplained) and not expected:
        return f"stopped by {why}"
    if vents and seen.after > kind.bound + HOST:
        return f"late, bound {1e3 * (kind.bound + HOST):.0f} ms"
    if vents and by and seen.after < TOO_EARLY * kind.bound:
        return f"stopped by {why} too early"
    return ""


def _begin(chain: Chain, operator: Operator, kind: FaultKind) -> float:
    """Bring the fault about; returns when."""
    if kind.name in INJECTIONS:
        return operator.inject(kind.name)
    if kind.name == "vent_called":
        begin = time.monotonic()
        operator.trigger("pam_driver/vent")
        return begin
    name, _, what = kind.name.partition("_")
    process = chain.processes[name]
    begin = time.monotonic()
    process.send(signal.SIGKILL if what == "killed" else signal.SIGSTOP)
    return begin


def _end(chain: Chain, kind: FaultKind) -> None:
    """Continue or start again what was stopped."""
    if kind.name in INJECTIONS or kind.name == "vent_called":
        return
    name, _, what = kind.name.partition("_")
    if what == "stopped":
        chain.processes[name].send(signal.SIGCONT)
    else:
        chain.processes.pop(name).wait(5.0)
        chain.start(name)


def observe(chain: Chain, operator: Operator, kind: FaultKind) -> Observation:
    """Bring one fault about on a chain in motion, and look."""
    operator.make_move(PATIENCE)
    operator.forget()
    vents = kind.reaction is Reaction.VENT
    begin = _begin(chain, operator, kind)
    deaf = kind.name in UNHEARD or kind.bounds_driver

    def has_stopped() -> bool:
        now = time.monotonic()
        if deaf:
            return now - operator.last_enabled > QUIET
        return now > begin + 0.03 and not operator.moves_air

    stopped = operator.run(kind.bound + 0.5 if vents else 0.8, has_stopped)
    after = (operator.last_enabled if deaf else operator.last_air) - begin
    # one that is stopped says nothing, so that its last word is no news
    silent = kind.name.startswith("driver") and not stopped
    _end(chain, kind)
    said: Callable[[], bool] = lambda: bool(operator.fault or operator.suspicion)  # noqa: E731
    operator.run(1.3, (lambda: bool(operator.fault)) if stopped else said)
    return Observation(stopped, silent, max(after, 0.0), operator.fault or operator.suspicion)


def run_kind(chain: Chain, operator: Operator, kind: FaultKind) -> Row:
    """One fault until the host leaves no doubt: name, reaction, ms, diagnostics, tries, verdict."""
    tries = 0
    verdict = REPEAT
    while verdict == REPEAT and tries < TRIES:
        tries += 1
        seen = observe(chain, operator, kind)
        verdict, why = judge(kind, seen)
        if verdict == REPEAT:
            print(f"{kind.name}: {1e3 * seen.after:.0f} ms, {why}: repeat", flush=True)
    told = seen.told.replace("|", "/")
    shown = KEPT if verdict == KEPT else f"failed: {why}"
    return kind.name, kind.reaction.value, f"{1e3 * seen.after:.0f}", told, str(tries), shown


def run_all(
    rig_path: Path, kinds: Sequence[FaultKind], open_operator: OpenOperator
) -> Iterator[Row]:
    """Every kind in turn on one chain of processes.

    Raises
    ------
    PamError
        If the chain does not come up, or not again.
    """
    environment = private_domain()
    bus = multicast_bus()
    rig = load_rig(rig_path)
    port = open_bus(bus.interface, bus.channel, port=bus.port)
    try:
        with (
            open_operator(rig.joint_names, port, environment) as operator,
            Chain([rig_path], bus, environment) as chain,
        ):
            for name in START:
                chain.start(name)
            if not operator.run(PATIENCE, operator.ready):
                raise PamError(f"no chain within {PATIENCE:g} s")
            for kind in kinds:
                row = run_kind(chain, operator, kind)
                print(f"{row[0]}: {row[2]} ms, {row[-1]}", flush=True)
                yield row
    finally:
        port.close()


def run(given: Arguments, open_operator: OpenOperator) -> Outcome:
    """Inject, print and write the table; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        If a kind is unknown, or not all kinds could be run; what was done until then is written.
    """
    possible = [kind for kind in KINDS if kind.name in {*INJECTIONS, *HOST_FAULTS}]
    kinds = kinds_called(given.kind, possible)
    done: list[Row] = []
    try:
        for row in run_all(chosen_rig(given), kinds, open_operator):
            done.append(row)  # those before one that cannot be run count too
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
