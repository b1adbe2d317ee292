"""Time per tick for force and stiffness of 16 muscles, compared with the bare arithmetic.

    python benchmarks/force_bench.py [--json] [--check]

The times depend on the machine and its load. The smallest of many short runs is disturbed least,
and its ratio to the bare arithmetic of the same run is comparable between machines. The goals are
3 us in plain Python and 0.5 us compiled.
"""

from __future__ import annotations

import sys
import timeit
from collections.abc import Callable

import numpy as np

from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command
from pam_model.muscles.force_model import MuscleGeometry, create_force_model
from pam_model.muscles.muscle_bank import MuscleBank

MUSCLES = 16
BARE = "bare arithmetic, plain Python"
GOALS_US = {"bank, plain Python": 3.0, "bank, compiled": 0.5}


def per_call_us(
    call: Callable[[], object], number: int = 1_000, repeats: int = 200
) -> tuple[float, float]:
    """Smallest and median time per call over many short runs [us]."""
    call()
    runs = sorted(timeit.repeat(call, number=number, repeat=repeats))
    return 1e6 * runs[0] / number, 1e6 * runs[repeats // 2] / number


def _declare(parser: Parser) -> None:
    """The bench has no options of its own."""


def _run(given: Arguments) -> Outcome:
    """Measure and print a table."""
    models = [
        create_force_model("gaylord", MuscleGeometry(0.25 + 0.001 * i, 2.0, 0.23))
        for i in range(MUSCLES)
    ]
    bank = MuscleBank(models)
    pressures = [1e5 + 1e4 * i for i in range(MUSCLES)]
    lengths = [0.19 + 0.001 * i for i in range(MUSCLES)]
    start, square = float(bank.coefficients[0, 0]), float(bank.coefficients[0, 2])
    doubled = 2.0 * square

    def arithmetic() -> None:
        for pressure, length in zip(pressures, lengths, strict=True):
            pressure * (start + length * length * square)
            pressure * length * doubled

    def one_by_one() -> None:
        for model, pressure, length in zip(models, pressures, lengths, strict=True):
            model.force(pressure, length)
            model.stiffness(pressure, length)

    times = {
        BARE: per_call_us(arithmetic),
        "bank, plain Python": per_call_us(lambda: bank.evaluate(pressures, lengths)),
        "models one by one": per_call_us(one_by_one, number=200),
    }
    try:
        tick = bank.compile()
    except ImportError:
        print("numba is not installed: the compiled bank is not measured")
    else:
        tick.inputs[:] = pressures, lengths
        times["bank, compiled"] = per_call_us(tick.run)
        if not np.allclose(tick.outputs, bank.evaluate(pressures, lengths), rtol=1e-13):
            raise SystemExit("error: compiled and plain bank disagree")

    bare = times[BARE][0]
    print(f"{MUSCLES} muscles, force and stiffness, 200 runs; medians show the machine's load")
    print(f"  {'':30s} least [us]  median [us]  least / bare")
    for name, (least, median) in times.items():
        goal = ""
        if name in GOALS_US:
            goal = (
                f"   goal {GOALS_US[name]:g} us: {'met' if least <= GOALS_US[name] else 'missed'}"
            )
        print(f"  {name:30s} {least:10.3f}  {median:11.3f}  {least / bare:12.2f}{goal}")
    return Outcome(
        {
            "least_microseconds": {name: least for name, (least, _) in times.items()},
            "median_microseconds": {name: median for name, (_, median) in times.items()},
            "ratios": {name: least / bare for name, (least, _) in times.items()},
        },
        [
            f"{name}: {times[name][0]:.3f} us, goal {goal:g} us"
            for name, goal in GOALS_US.items()
            if name in times and times[name][0] > goal
        ],
    )


BENCH = Command(
    "force", "time of 16 muscles' force and stiffness", _declare, _run, "if a goal is missed"
)

if __name__ == "__main__":
    sys.exit(run_command(BENCH, "python benchmarks/force_bench.py"))
