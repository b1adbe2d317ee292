"""Where the processor time of a running node goes, by part of the program.

    python benchmarks/node_profile.py [--node robot] [--joints 4] [--seconds 30] [--json]

Rig and robot, or driver, model and controller, run as processes and hold the joints, as in
`chain_bench.py`.
The kernel counts the time of each thread: the loop, the executor in the main thread, and those of
the middleware, which receive what others send. py-spy (`pip install py-spy`) then samples the
Python of the node from outside, without stopping it. It needs the right to trace other processes:
root, or the kernel setting `kernel.yama.ptrace_scope = 0`. A sample belongs to the innermost
function of the suite or of rclpy on its stack, so that numpy, and the middleware while it sends,
count for whoever called them. Some samples hit a thread that waits and call it running; those at
the two places where a node waits are left out, so that the time in which the kernel puts a thread
to sleep and wakes it is in the first table alone.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from chain_bench import APART, NODES, TICK, TOGETHER, running_chain

from pam_model.argument_types import count, number
from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command
from pam_model.errors import PamError

SAMPLING = 250  # Hz
OURS = ("pam_", "rclpy/")
WAITING = ("pam_ros/periodic.py", "pam_ros/steady_timers.py")
SHOWN = 12


def place_of(stack: str) -> str:
    """The module of the innermost function of the suite or of rclpy; the innermost one without."""
    frames = stack.split(";")
    for frame in reversed(frames):
        function, _, file = frame.rstrip(")").rpartition(" (")
        path = file.rpartition(":")[0]
        if path.startswith(OURS) and function:
            return path
    return frames[-1].rpartition(" (")[2].rstrip(")").rpartition(":")[0] or "other"


def part_of(place: str) -> str:
    """The part of a package to which a module belongs: its folder there, or the package."""
    package, *rest = place.split("/")
    return f"{package}/{rest[0]}" if len(rest) > 1 else package


def counted(lines: Iterable[str]) -> Counter[str]:
    """Samples of each module, from py-spy's raw format: a stack and its number of samples."""
    found: Counter[str] = Counter()
    for line in lines:
        stack, _, samples = line.rpartition(" ")
        place = place_of(stack)
        if stack and place not in WAITING:
            found[place] += int(samples)
    return found


def thread_kind(pid: int, thread: Path) -> str:
    """Whose thread it is, from its number and name."""
    if int(thread.name) == pid:
        return "main thread"
    name = (thread / "comm").read_text().strip()
    return "middleware" if name.startswith("dds.") else "loop and others"


def thread_ticks(pid: int) -> Counter[str]:
    """Processor time of the threads of a process so far, by kind [ticks]."""
    found: Counter[str] = Counter()
    for thread in Path(f"/proc/{pid}/task").iterdir():
        ticks = (thread / "stat").read_text().rpartition(")")[2].split()[11:13]
        found[thread_kind(pid, thread)] += sum(map(int, ticks))
    return found


def thread_shares(pid: int, seconds: float) -> dict[str, float]:
    """Share of one processor that each kind of thread takes [-]."""
    before, start = thread_ticks(pid), time.monotonic()
    time.sleep(seconds)
    after, passed = thread_ticks(pid), time.monotonic() - start
    return {kind: (after[kind] - before[kind]) / TICK / passed for kind in after}


def sampled(pid: int, seconds: int) -> Counter[str]:
    """Samples of each module of a running process.

    Raises
    ------
    PamError
        If py-spy is missing or may not trace the process.
    """
    program = shutil.which("py-spy") or shutil.which(
        "py-spy", path=str(Path(sys.executable).parent)
    )
    if program is None:
        raise PamError("py-spy is missing; install it with `pip install py-spy`")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "stacks"
        done = subprocess.run(
            [program, "record", "--format", "raw", "--output", str(out), "--rate", str(SAMPLING),
             "--duration", str(seconds), "--pid", str(pid)],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode:
            raise PamError(f"py-spy could not trace process {pid}: {done.stderr.strip()[-300:]}")
        return counted(out.read_text().splitlines())


def _declare(parser: Parser) -> None:
    parser.add_argument(
        "--node", choices=NODES, default="robot", help="which node (default: %(default)s)"
    )
    parser.add_argument(
        "--joints", type=count(1, 7), default=4, help="size of the arm (default: %(default)s)"
    )
    parser.add_argument(
        "--seconds",
        type=number("s", least=2.0, most=600.0),
        default=30.0,
        help="time of the measurement (default: %(default)s)",
    )


def _run(given: Arguments) -> Outcome:
    """Measure and print a table."""
    processes = TOGETHER if given.node == "robot" else APART
    with running_chain(given.joints, processes) as (chain, _):
        pid = chain.processes[given.node].pid
        shares = thread_shares(pid, given.seconds)
        samples = sampled(pid, round(given.seconds))
    total = sum(samples.values())
    if not total:
        raise PamError("py-spy saw no running function; is the node idle?")
    parts: Counter[str] = Counter()
    for name, hits in samples.items():
        parts[part_of(name)] += hits
    share = sum(shares.values())
    print(f"{given.node}, joints: {given.joints}: {100 * share:.1f} % of a processor")
    for kind, own in shares.items():
        print(f"{100 * own:15.1f} %   {kind}")
    tables = {"part": parts, "module": samples}
    for title, found in tables.items():
        print(f"share of its Python   {title}")
        for name, hits in found.most_common(SHOWN):
            print(f"{100 * hits / total:15.1f} %   {name}")
    return Outcome(
        {"node": given.node, "joints": given.joints, "processor": share, "threads": shares,
         "samples": {title: dict(found) for title, found in tables.items()}}
    )  # fmt: skip


BENCH = Command("profile", "where the processor time of a node goes", _declare, _run)

if __name__ == "__main__":
    sys.exit(run_command(BENCH, "python benchmarks/node_profile.py"))
