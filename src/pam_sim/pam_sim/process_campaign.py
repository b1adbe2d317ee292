"""The rig's faults once each on real processes: rig, driver and controller over a bus and ROS.

`python -m pam_sim.process_campaign --out out/faults/processes.md` complements
`pam_sim.fault_campaign`, which has the numbers: here sockets, ROS, threads and the host's
scheduler take part. Exit code 1 if a fault that must vent does not do so within its bound and
`HOST`, or one that must be ridden through stops the joint.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import rclpy

from pam_driver.bus import open_bus
from pam_model.errors import PamError
from pam_model.rig import load_rig
from pam_sim.demo.chain import Chain, multicast_bus, private_domain
from pam_sim.fault_injection import INJECTIONS
from pam_sim.fault_kinds import KINDS, FaultKind, Reaction
from pam_sim.fault_operator_node import FaultOperator

HOST = 0.06  # s, for the way of the injection, a status of the board and a host that is busy
PATIENCE = 30.0  # s
HOST_FAULTS = (
    "driver_stopped", "driver_killed", "controller_stopped", "controller_killed", "vent_called"
)  # fmt: skip
START = ("rig", "driver", "controller")

# Boards that are not heard cannot say that they have vented; the driver's commands can.
UNHEARD = ("all_frames_lost_up", "frames_very_late_up")
QUIET = 0.05  # s, without a command that lets air move

Row = tuple[str, str, str, str, str]


def _begin(chain: Chain, operator: FaultOperator, kind: FaultKind) -> float:
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


def run_kind(chain: Chain, operator: FaultOperator, kind: FaultKind) -> Row:
    """One fault: name, reaction, milliseconds to vented boards, what diagnostics said, verdict."""
    operator.make_move(PATIENCE)
    operator.forget()
    vents = kind.reaction is Reaction.VENT
    begin = _begin(chain, operator, kind)
    deaf = kind.name in UNHEARD

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
    operator.run(1.3, said)
    told = (operator.fault or operator.suspicion).replace("|", "/")
    verdict = "kept"
    if vents and (silent or not stopped):
        verdict = "not vented"
    elif vents and after > kind.bound + HOST:
        verdict = f"late, bound {1e3 * (kind.bound + HOST):.0f} ms"
    elif kind.reaction in {Reaction.RIDE, Reaction.WARN} and stopped:
        verdict = "stopped"
    return kind.name, kind.reaction.value, f"{1e3 * max(after, 0.0):.0f}", told, verdict


def run_all(rig_path: Path, kinds: Sequence[FaultKind]) -> list[Row]:
    """Every kind in turn on one chain of processes.

    Raises
    ------
    PamError
        If the chain does not come up, or not again.
    """
    environment = private_domain()
    os.environ.update(environment)
    bus = multicast_bus()
    rig = load_rig(rig_path)
    done: list[Row] = []
    port = open_bus(bus.interface, bus.channel, port=bus.port)
    rclpy.init(args=[])
    operator = FaultOperator(rig.joint_names, port)
    try:
        with Chain([rig_path], bus, environment) as chain:
            for name in START:
                chain.start(name)
            if not operator.run(PATIENCE, operator.ready):
                raise PamError(f"no chain within {PATIENCE:g} s")
            for kind in kinds:
                row = run_kind(chain, operator, kind)
                print(f"{row[0]}: {row[2]} ms, {row[4]}", flush=True)
                done.append(row)
    finally:
        operator.destroy_node()
        rclpy.try_shutdown()
        port.close()
    return done


def main(arguments: Sequence[str] | None = None) -> int:
    """Run it; 0 if all is inside the bounds, 1 if not, 2 if it cannot run."""
    parser = argparse.ArgumentParser(prog="python -m pam_sim.process_campaign", description=__doc__)
    parser.add_argument("--rig", type=Path, default=Path("config/elbow.yaml"))
    parser.add_argument("--kind", action="append", help="only this kind; may be repeated")
    parser.add_argument("--out", type=Path, default=Path("out/faults/processes.md"))
    parsed = parser.parse_args(arguments)
    possible = [kind for kind in KINDS if kind.name in {*INJECTIONS, *HOST_FAULTS}]
    kinds = [kind for kind in possible if not parsed.kind or kind.name in parsed.kind]
    try:
        done = run_all(parsed.rig, kinds)
    except PamError as error:
        print(error, file=sys.stderr)
        return 2
    lines = [
        "| fault | must follow | vented after [ms] | diagnostics | verdict |",
        "|---" * 5 + "|",
    ]
    lines += ["| " + " | ".join(row) + " |" for row in done]
    parsed.out.parent.mkdir(parents=True, exist_ok=True)
    parsed.out.write_text("\n".join(lines) + "\n", encoding="utf-8")
    bad = [row for row in done if row[4] != "kept"]
    print(f"{len(done)} kinds on processes, {len(bad)} out of bounds: {parsed.out}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
