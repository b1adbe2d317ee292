"""Share of a processor that each node takes at 500 Hz, by number of joints, and its start.

    python benchmarks/chain_bench.py [--joints 1 2 4 7] [--seconds 8] [--json]

The robot runs in one process and holds the joints, and then driver, model and controller as three.
Beside them, in the same run, a bare node is measured that publishes and takes the same number of
messages of the same size as a driver of its own, and does nothing with them. Its start contains
what every Python node needs. The loops ask for a real-time priority, as the launch files do. The
figures hold for an idle machine with at least two cores. The table of rates takes the share at
500 Hz for a time of a cycle; a cycle at a lower rate takes a little longer, with colder caches.
"""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from arm_of_joints import arm

from pam_demo.chain import Chain, multicast_bus, private_domain
from pam_demo.demo import node_settings
from pam_model.argument_types import count, number
from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command
from pam_model.errors import PamError
from pam_model.rig import save_rig

BARE = Path(__file__).with_name("bare_node.py")
RATE = 500.0  # Hz; the default of driver and controller
NODES = ("robot", "driver", "controller", "model", "rig")
TOGETHER = ("robot", "rig")
"""The processes of a robot in one process; the first is the one that drives."""
APART = ("driver", "controller", "model", "rig")
READY = {
    "robot": "measuring on", "driver": "measuring on", "controller": "worst at", "rig": "simulating"
}  # fmt: skip
SETTLING = 3.0  # s
TIMEOUT = 120.0  # s
CACHED = {"PYTHONDONTWRITEBYTECODE": ""}  # as a user starts nodes: compiled once
TICK = os.sysconf("SC_CLK_TCK")
RATES = (1000.0, 500.0, 250.0, 200.0, 100.0, 50.0)  # Hz
BUSY = 0.7  # of a period; a loop that takes more has late cycles as soon as anything else runs
SPEEDS = (1.0, 2.5, 0.5)
"""Of one core over that of this computer: itself, and by estimate a fast desktop and a small Arm
board. A cycle is Python, whose time follows the speed of one core."""


def processor_seconds(pid: int) -> float:
    """Processor time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICK


def shares(pids: Mapping[str, int], seconds: float) -> dict[str, float]:
    """Share of one processor that each process takes [-]."""
    before = {name: processor_seconds(pid) for name, pid in pids.items()}
    start = time.monotonic()
    time.sleep(seconds)
    passed = time.monotonic() - start
    return {name: (processor_seconds(pid) - before[name]) / passed for name, pid in pids.items()}


@contextmanager
def running_chain(
    joints: int, processes: Sequence[str] = TOGETHER
) -> Iterator[tuple[Chain, dict[str, float]]]:
    """An active chain that holds its joints, and the time from each start to a first cycle [s].

    Parameters
    ----------
    joints : int
        Size of the arm.
    processes : sequence of str
        `TOGETHER` or `APART`.

    Raises
    ------
    PamError
        If the driver stopped meanwhile, since a chain that does nothing costs less.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.yaml"
        save_rig(arm(joints), path)
        starts: dict[str, float] = {}
        with Chain([path], multicast_bus(), {**private_domain(), **CACHED}) as chain:
            settings = node_settings(RATE)
            for name in reversed(processes):
                begin = time.monotonic()
                if name == "robot":
                    process = chain.start_robot(settings)
                else:
                    process = chain.start(name, settings.get(name))
                if name in READY:
                    process.wait_for_output(READY[name], TIMEOUT)
                    starts[name] = time.monotonic() - begin
            first = chain.processes[processes[0]]
            first.wait_for_output("active:", TIMEOUT)
            time.sleep(SETTLING)
            yield chain, starts
            chain.check()
            stopped = [line for line in first.output.splitlines() if "latched until" in line]
            if stopped:
                raise PamError(f"{stopped[0]}; is the machine busy?")


def measured_chain(joints: int, seconds: float) -> tuple[dict[str, float], dict[str, float]]:
    """Share of each process, and the time from its start to its first cycle [s]."""
    found: dict[str, float] = {}
    started: dict[str, float] = {}
    for processes in (APART, TOGETHER):
        with running_chain(joints, processes) as (chain, starts):
            pids = {name: process.pid for name, process in chain.processes.items()}
            found |= shares(pids, seconds)
            started |= starts
    return found, started


def highest_rate(share: float, speed: float) -> float:
    """The highest usual rate [Hz] at which the cycles fit; 0 if none does.

    Parameters
    ----------
    share : float
        Of this computer's core at `RATE` [-].
    speed : float
        Of the other core over this one [-].
    """
    cycle = share / RATE / speed
    return next((rate for rate in RATES if rate * cycle <= BUSY), 0.0)


def bare_node(
    rate: float, joints: int, topics: tuple[str, str], domain: Mapping[str, str]
) -> subprocess.Popen[bytes]:
    """A node that publishes and hears the topics of two comma-separated lists."""
    words = [sys.executable, str(BARE), f"{rate:g}", str(joints), *topics]
    return subprocess.Popen(words, env={**os.environ, **domain, **CACHED}, stderr=subprocess.PIPE)


def measured_bare(joints: int, seconds: float) -> float:
    """Share of a bare node that exchanges the driver's messages with two others [-]."""
    domain = private_domain()
    driver = bare_node(RATE, joints, ("joint_states,pressure_states", "valve_commands"), domain)
    controller = bare_node(RATE, joints, ("valve_commands", "joint_states,pressure_states"), domain)
    model = bare_node(RATE, joints, ("", "joint_states,pressure_states"), domain)
    return _share_of_first([driver, controller, model], seconds)


def measured_loop(seconds: float) -> tuple[float, float]:
    """A bare loop that publishes 16 joints at 1 kHz, heard by nobody.

    Returns
    -------
    share : float
        Share of a processor [-].
    start : float
        From the start of the process to its first cycle [s].
    """
    begin = time.monotonic()
    node = bare_node(1000.0, 16, ("joint_states", ""), private_domain())
    assert node.stderr is not None
    node.stderr.readline()
    start = time.monotonic() - begin
    return _share_of_first([node], seconds), start


def _share_of_first(processes: Sequence[subprocess.Popen[bytes]], seconds: float) -> float:
    try:
        time.sleep(SETTLING)
        return shares({"bare": processes[0].pid}, seconds)["bare"]
    finally:
        for process in processes:
            process.send_signal(signal.SIGINT)
        for process in processes:
            process.wait(TIMEOUT)


def _declare(parser: Parser) -> None:
    parser.add_argument(
        "--joints", type=count(1, 7), nargs="+", default=[1, 2, 4, 7], help="sizes of the arm"
    )
    parser.add_argument(
        "--seconds",
        type=number("s", least=1.0, most=600.0),
        default=8.0,
        help="time of each measurement",
    )


def _run(given: Arguments) -> Outcome:
    """Measure and print a table."""
    loop, bare_start = measured_loop(given.seconds)
    print(f"a bare loop that publishes 16 joints at 1 kHz: {100 * loop:.1f} % of a processor")
    print("% of a processor       " + "".join(f"{name:>12s}" for name in (*NODES, "bare node")))
    rows, starts = {}, {}
    for joints in given.joints:
        found, starts[joints] = measured_chain(joints, given.seconds)
        rows[joints] = {**found, "bare node": measured_bare(joints, given.seconds)}
        cells = "".join(f"{100 * rows[joints][name]:12.1f}" for name in (*NODES, "bare node"))
        print(f"{joints} joint{'s' if joints > 1 else ' '}, {RATE:g} Hz       {cells}")
    print(f"highest rate [Hz] at which one process takes at most {100 * BUSY:.0f} % of a core")
    print("speed of the core       " + "".join(f"{joints:6d} joints" for joints in given.joints))
    for speed in SPEEDS:
        rates = (highest_rate(rows[joints]["robot"], speed) for joints in given.joints)
        told = "this one" if speed == 1.0 else f"{speed:g} times, estimated"
        print(f"{told:24s}" + "".join(f"{rate:13.0f}" for rate in rates))
    print(f"start to first cycle, gains designed before; a bare node: {bare_start:.2f} s")
    for name, joints in itertools.product(READY, given.joints):
        print(f"  {name:12s} {joints} joints  {starts[joints][name]:6.2f} s")
    return Outcome(
        {
            "bare_loop": loop,
            "highest_rates": {
                joints: {speed: highest_rate(rows[joints]["robot"], speed) for speed in SPEEDS}
                for joints in given.joints
            },
            "shares": rows,
            "start_seconds": starts,
            "bare_start_seconds": bare_start,
        }
    )


BENCH = Command("chain", "share of a processor of each node, and its start", _declare, _run)

if __name__ == "__main__":
    sys.exit(run_command(BENCH, "python benchmarks/chain_bench.py"))
