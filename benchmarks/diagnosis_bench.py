"""Time and memory of a diagnosis of 40 s at 500 Hz, compared with one simulation of the recording.

    python benchmarks/diagnosis_bench.py [--hidden one] [--cases N] [--seed S] [--json] [--check]

Each rig contains two hidden effects by default, since such diagnoses take longest. The times
depend on the machine and its load; the ratio to the simulation is comparable between machines.
The goals are 60 s on two cores and 2 GiB.
"""

from __future__ import annotations

import itertools
import subprocess
import sys
import tempfile
import time
import timeit
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from pam_check.blind.cases import Label, make_case
from pam_model.argument_types import count
from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command
from pam_model.errors import PamError
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import simulate
from pam_model.rig import load_rig

SAMPLE_TIME = 0.002  # s
GOAL_S, GOAL_GIB = 60.0, 2.0

MEASURED = """
import resource, sys, time
from pam_gap.__main__ import main
started = time.monotonic()
code = main(sys.argv[1:])
print(time.monotonic() - started, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20)
raise SystemExit(code)
"""


def diagnose(case: Path, out: Path, *options: str) -> tuple[float, float]:
    """Wall time [s] and peak memory [GiB] of a process that runs the diagnosis."""
    started = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-c", MEASURED, "diagnose", str(case / "recording.csv.gz"),
         "--rig", str(case / "rig.yaml"), "--out", str(out), "--no-progress", *options],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        raise PamError(f"the diagnosis failed: {done.stderr}")
    return time.monotonic() - started, float(done.stdout.split()[-1])


def draw_cases(
    hidden: str, seed: int, cases: Path, sealed: Path
) -> Iterator[tuple[str, Label, int]]:
    """Endless rigs that were recorded at 500 Hz: name, label and number of samples."""
    random = np.random.default_rng(seed)
    drawn = 0
    while True:
        name = f"{drawn:03d}-{random.integers(1_000_000)}"
        label = make_case(name, hidden, cases, sealed, random)
        time = pd.read_csv(cases / name / "recording.csv.gz", usecols=["time"])["time"]
        if abs(time.iloc[1] - time.iloc[0] - SAMPLE_TIME) <= 1e-6:
            yield name, label, len(time)
            drawn += 1


def simulation_time(case: Path) -> float:
    """Time of one compiled simulation of the case's commands [s], the smallest of five runs."""
    rig = load_rig(case / "rig.yaml")
    table = pd.read_csv(case / "recording.csv.gz")
    commands = np.column_stack([table[f"valve_commands.{name}"] for name in rig.joints[0].muscles])
    step = float(table["time"].iloc[1] - table["time"].iloc[0])
    parameters = PlantParameters.from_rig(rig)
    simulate(parameters, commands[:10], step)
    return min(timeit.repeat(lambda: simulate(parameters, commands, step), number=1, repeat=5))


def _declare(parser: Parser) -> None:
    parser.add_argument(
        "--cases", type=count(), default=2, help="number of rigs (default: %(default)s)"
    )
    declare_rigs(parser, hidden="two")


def declare_rigs(parser: Parser, *, hidden: str) -> None:
    """Declare what chooses the drawn rigs."""
    parser.add_argument(
        "--hidden", choices=("one", "two"), default=hidden,
        help="effects of each rig (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--seed", type=count(0), default=0, help="of the random rigs (default: %(default)s)"
    )


def _run(chosen: Arguments) -> Outcome:
    """Measure and print a table."""
    rows: list[dict[str, float | str]] = []
    with tempfile.TemporaryDirectory() as folder:
        cases, sealed = Path(folder) / "cases", Path(folder) / "sealed"
        drawn = draw_cases(chosen.hidden, chosen.seed, cases, sealed)
        for name, label, samples in itertools.islice(drawn, chosen.cases):
            seconds, gib = diagnose(cases / name, Path(folder) / "out" / name)
            look, _ = diagnose(cases / name, Path(folder) / "look" / name, "--quick")
            once = simulation_time(cases / name)
            rows.append({"hidden": " + ".join(label.effects), "samples": samples,
                         "seconds": seconds, "gib": gib, "first_look": look,
                         "simulation": once})  # fmt: skip
    print(f"  {'hidden':44s} samples   wall [s]  memory [GiB]  first look [s]"
          "  one simulation [s]  ratio")  # fmt: skip
    for row in rows:
        print(
            f"  {row['hidden']:44s} {row['samples']:7d}  {row['seconds']:9.1f}  {row['gib']:12.2f}"
            f"  {row['first_look']:14.1f}"
            f"  {row['simulation']:18.3f}  {float(row['seconds']) / float(row['simulation']):5.0f}"
        )
    worst, most = max(float(r["seconds"]) for r in rows), max(float(r["gib"]) for r in rows)
    print(f"  goal {GOAL_S:g} s on two cores: {'met' if worst <= GOAL_S else 'missed'}")
    print(f"  goal {GOAL_GIB:g} GiB: {'met' if most <= GOAL_GIB else 'missed'}")
    missed = [f"{worst:.1f} s, goal {GOAL_S:g} s"] if worst > GOAL_S else []
    missed += [f"{most:.2f} GiB, goal {GOAL_GIB:g} GiB"] if most > GOAL_GIB else []
    return Outcome(rows, missed)


BENCH = Command(
    "diagnosis", "time and memory of a diagnosis", _declare, _run, "if a goal is missed"
)

if __name__ == "__main__":
    sys.exit(run_command(BENCH, "python benchmarks/diagnosis_bench.py"))
