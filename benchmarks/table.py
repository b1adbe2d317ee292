"""All benchmarks as one table, each figure beside its peer of the same run and its goal.

    python benchmarks/table.py [--only chain bag] [--before out/bench.json] [--out out/bench.json]

`make bench` runs it. docs/performance.md explains each row and what limits it. The figures hold for
an idle machine with at least two cores; the ratios are comparable between machines.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command
from pam_model.errors import PamError

HERE = Path(__file__).parent
OUT = HERE.parent / "out/bench.json"
CORE = 100.0  # % of a processor


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table.

    Attributes
    ----------
    work, unit : str
        What is measured.
    value : float
        The figure.
    peer : str
        What it is compared with.
    peer_value : float
        The peer's figure in the same run.
    goal : float or None
        The goal, in the unit of the figure, or of the ratio if `goal_of_ratio`.
    more_is_better : bool
        Direction of the goal.
    goal_of_ratio : bool
        Whether the goal is one of the ratio.
    """

    work: str
    unit: str
    value: float
    peer: str
    peer_value: float
    goal: float | None = None
    more_is_better: bool = False
    goal_of_ratio: bool = False

    @property
    def ratio(self) -> float:
        """The figure over the peer's."""
        return self.value / self.peer_value

    @property
    def met(self) -> bool | None:
        """Whether the goal is met; None if there is none."""
        if self.goal is None:
            return None
        judged = self.ratio if self.goal_of_ratio else self.value
        return judged >= self.goal if self.more_is_better else judged <= self.goal


def result_of(script: str, *options: str) -> Any:
    """The JSON document of one benchmark.

    Raises
    ------
    PamError
        If it fails.
    """
    command = [sys.executable, str(HERE / script), *options, "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise PamError(f"{script} failed: {done.stderr.strip()[-400:]}")
    return json.loads(done.stdout)


def simulation() -> Iterator[Row]:
    """Steps of the plant."""
    rates = result_of("simulation_bench.py")["steps_per_second"]
    unit, threads = "million steps/s", "two threads"
    for work, name in (
        ("batch of 64", "batch"),
        ("batch of a diagnosis, side by side", "diagnosis, side by side"),
    ):
        alone = f"{name.removesuffix(', side by side')}, one after the other"
        each, lanes, both = (1e-6 * rates[key] for key in (alone, name, f"{name}, {threads}"))
        yield Row(f"{work}, one thread", unit, lanes, "one after the other", each, 20.0, True)
        yield Row(f"{work}, {threads}", unit, both, "one thread", lanes, 1.8, True, True)


def control() -> Iterator[Row]:
    """One step of the controller."""
    for row in result_of("control_bench.py"):
        work = f"control step, {row['joints']} joints"
        peer = "inverse model alone"
        yield Row(work, "us", row["p50_us"], peer, row["bare_us"], row["goal_us"])


def chain() -> Iterator[Row]:
    """Processor time and start of the nodes."""
    found = result_of("chain_bench.py", "--joints", "1", "4", "7", "--seconds", "6")
    goals = {"1": 1.6, "4": 2.2, "7": 3.0}  # of the robot in one process
    for joints, shares in found["shares"].items():
        for node in ("robot", "driver", "controller", "model", "rig"):
            work = f"{node} at 500 Hz, joints: {joints}"
            goal = goals[joints] if node == "robot" else None
            share, bare = CORE * shares[node], CORE * shares["bare node"]
            yield Row(work, "% of a processor", share, "bare node", bare, goal, goal_of_ratio=True)
    for node in ("robot", "driver", "controller"):
        seconds = found["start_seconds"]["1"][node]
        bare = found["bare_start_seconds"]
        yield Row(f"start of the {node}", "s", seconds, "bare node", bare, bare + 0.2)


def latency() -> Iterator[Row]:
    """From a measurement frame to the command frame."""
    found = result_of("latency_bench.py")
    for which, goal in (("p50", 0.25), ("p99", 0.33)):
        for name in ("one process", "one process, aligned"):
            value, peer = found[name], found[name.replace("one process", "three processes")]
            work = f"measurement to command frame, {name}, {which}"
            key = f"{which}_ms"
            yield Row(
                work, "ms", value[key], "three processes", peer[key], goal, goal_of_ratio=True
            )
        for name in ("three processes", "three processes, aligned"):
            value, peer = (found[one][f"{which}_ms"] for one in (name, "bare echo"))
            work = f"measurement to command frame, {name}, {which}"
            yield Row(work, "ms", value, "echo and two hops", peer)


def disturbances() -> Iterator[Row]:
    """How far a joint yields; see docs/controller.md."""
    found = result_of("disturbance_bench.py")
    default, alone, muscles = found["default"], found["without adaptation"], found["muscles alone"]
    for index, (hertz, goal) in enumerate(((0.5, 12.8), (1.0, 24.0))):  # half of one set of gains
        work, unit = f"compliance at {hertz:g} Hz", "mrad/(N m)"
        values = (1e3 * each["compliance"][index] for each in (default, muscles))
        yield Row(work, unit, next(values), "muscles alone", next(values), goal)
    for work, key in (("largest error", "peak"), ("error after 1 s", "left")):
        one, other = (1e3 * each[key] for each in (default, alone))
        yield Row(f"{work}, load of 1 N m put on", "mrad", one, "without adaptation", other)
    for index, motion in enumerate(("arm", "chirp")):
        one, other = (1e3 * each["sag"][index] for each in (default, alone))
        work = f"{motion} while the supply sags by 2 bar"
        yield Row(work, "mrad RMS", one, "without adaptation", other)


def bag() -> Iterator[Row]:
    """Import of a bag."""
    found = result_of("bag_bench.py")
    rate, bare = found["import_per_second"], found["decoding_per_second"]
    yield Row("import of a bag", "messages/s", rate, "decoding alone", bare, 0.8, True, True)


def help_text() -> Iterator[Row]:
    """How long the help of the diagnosis takes."""

    def seconds(*words: str) -> float:
        call = [sys.executable, *words]
        times = []
        for _ in range(5):
            start = time.perf_counter()
            subprocess.run(call, check=True, stdout=subprocess.DEVNULL)
            times.append(time.perf_counter() - start)
        return min(times)

    value, peer = seconds("-m", "pam_gap", "--help"), seconds("-c", "pass")
    yield Row("pam gap --help", "s", value, "python -c pass", peer, 0.3)


def diagnosis() -> Iterator[Row]:
    """Diagnoses with one and two hidden effects, and the first looks at the same recordings."""
    for hidden, goal in (("one", 5.0), ("two", 8.0)):
        (found,) = result_of("diagnosis_bench.py", "--cases", "1", "--hidden", hidden)
        work, once = f"40 s at 500 Hz, {hidden} hidden", found["simulation"]
        yield Row(f"diagnosis of {work}", "s", found["seconds"], "one simulation", once, goal)
        yield Row(f"first look at {work}", "s", found["first_look"], "one simulation", once, 2.0)


PARTS: Mapping[str, Callable[[], Iterator[Row]]] = {
    "simulation": simulation,
    "control": control,
    "chain": chain,
    "latency": latency,
    "disturbances": disturbances,
    "bag": bag,
    "help": help_text,
    "diagnosis": diagnosis,
}


def _declare(parser: Parser) -> None:
    parser.add_argument(
        "--only", nargs="+", choices=list(PARTS), default=list(PARTS), help="parts of the table"
    )
    parser.add_argument("--before", type=Path, help="earlier result, for the column `before`")
    parser.add_argument(
        "--out", type=Path, default=OUT, help="where the result is kept (default: %(default)s)"
    )


def _line(row: Row, before: float | None) -> str:
    goal = "-"
    if row.goal is not None:
        sign, of = (">=" if row.more_is_better else "<="), (" of it" if row.goal_of_ratio else "")
        goal = f"{sign} {row.goal:g}{of}"
    met = {True: "met", False: "missed", None: ""}[row.met]
    earlier = "" if before is None else f"{before:12.4g}"
    return (
        f"{row.work:44s} {row.value:10.4g} {row.unit:17s} {row.peer:30s} {row.peer_value:10.4g}"
        f" {row.ratio:8.2f}  {goal:14s} {met:7s}{earlier}"
    )


def _run(given: Arguments) -> Outcome:
    """Measure and print the table."""
    before: dict[str, float] = {}
    if given.before is not None:
        before = {row["work"]: row["value"] for row in json.loads(given.before.read_text())}
    print(f"{'work':44s} {'figure':>10s} {'':17s} {'peer':30s} {'figure':>10s} {'ratio':>8s}"
          f"  {'goal':14s} {'':7s}{'before' if before else ''}")  # fmt: skip
    rows: list[Row] = []
    failed = []
    for name in given.only:
        try:
            for row in PARTS[name]():
                rows.append(row)
                print(_line(row, before.get(row.work)), flush=True)
        except PamError as error:  # the others are still measured
            failed.append(f"{name}: {error}")
            print(failed[-1], flush=True)
    document = [{**asdict(row), "ratio": row.ratio, "met": row.met} for row in rows]
    given.out.parent.mkdir(parents=True, exist_ok=True)
    given.out.write_text(json.dumps(document, indent=1) + os.linesep)
    missed = [f"{row.work}: {row.value:.4g} {row.unit}" for row in rows if row.met is False]
    return Outcome(document, failed + missed)


BENCH = Command("bench", "all benchmarks as one table", _declare, _run, "if a goal is missed")

if __name__ == "__main__":
    sys.exit(run_command(BENCH, "python benchmarks/table.py"))
