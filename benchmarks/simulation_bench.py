"""Steps per second of the simulated joint: one trajectory, a batch, and a batch on two threads.

    python benchmarks/simulation_bench.py [--json]

RK4 with 0.25 ms. The batch has 64 parameter vectors. Without numba, the figures are those of plain
Python.
"""

from __future__ import annotations

import sys
import timeit
from collections.abc import Callable
from pathlib import Path

import numpy as np

from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import DEFAULT_STEP, simulate
from pam_model.rig import load_rig

ELBOW = Path(__file__).parents[1] / "config/elbow.yaml"
PERIOD = 0.002  # s
SECONDS = 4.0
BATCH = 64
REPEATS = 5


def _declare(parser: Parser) -> None:
    """The bench has no options of its own."""


def _run(given: Arguments) -> Outcome:
    """Measure and print."""
    parameters = PlantParameters.from_rig(load_rig(ELBOW))
    samples = round(SECONDS / PERIOD)
    swing = 0.05 * np.sin(2.0 * np.pi * np.arange(samples) * PERIOD)
    commands = np.column_stack((swing, -swing))
    values = np.repeat(parameters.values[None], BATCH, axis=0)
    steps = SECONDS / min(DEFAULT_STEP, PERIOD)
    calls: dict[str, tuple[int, Callable[[], object]]] = {
        "one trajectory": (1, lambda: simulate(parameters, commands, PERIOD)),
        "batch": (BATCH, lambda: simulate(parameters, commands, PERIOD, values=values)),
        "batch, two threads": (
            BATCH,
            lambda: simulate(parameters, commands, PERIOD, values=values, threads=2),
        ),
    }
    rates = {}
    for name, (lanes, call) in calls.items():
        call()  # compiles
        rates[name] = lanes * steps / min(timeit.repeat(call, number=1, repeat=REPEATS))
        print(f"{name:20s} {1e-6 * rates[name]:7.2f} million steps/s")
    return Outcome({"steps_per_second": rates})


BENCH = Command("simulation", "steps per second of the simulated joint", _declare, _run)

if __name__ == "__main__":
    sys.exit(run_command(BENCH, "python benchmarks/simulation_bench.py"))
