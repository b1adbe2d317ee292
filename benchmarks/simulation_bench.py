"""Steps per second of the simulated joint: one trajectory, batches, and batches on two threads.

    python benchmarks/simulation_bench.py [--json]

RK4 with 0.25 ms; in a diagnosis with 2 ms, and with its corrections and comparisons in each step.
The batches have 64 parameter vectors that differ in every number of the rig file, as those of a fit
do. They are simulated one after the other, or side by side in the vectors of the processor. Two
processes that share nothing show what two threads can reach at most on this machine; what is left
of a batch in Python, where two threads take turns, is the derivation of its constants.
Without numba, the figures are those of plain Python.
"""

from __future__ import annotations

import multiprocessing
import sys
import timeit
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pam_gap.prediction.channel_order import N_CHANNELS, POSITION
from pam_gap.prediction.observer import observe
from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command
from pam_model.plant.compiled import HAVE_NUMBA, for_kernel
from pam_model.plant.constants import derive_constants
from pam_model.plant.default_step import DEFAULT_STEP
from pam_model.plant.lane_choice import lane_kernels
from pam_model.plant.parameters import RIG_PLACES, PlantParameters
from pam_model.plant.sensors import sensor_constants
from pam_model.plant.simulate import initial_state, simulate
from pam_model.rig import load_rig

Array = npt.NDArray[np.float64]

ELBOW = Path(__file__).parents[1] / "config/elbow.yaml"
PERIOD = 0.002  # s
SECONDS = 4.0
RECORDED = 20.0  # s, of the batches of a diagnosis; shorter ones are mostly overhead
BATCH = 64
REPEATS = 5
STEPS_PER_SAMPLE = PERIOD / min(DEFAULT_STEP, PERIOD)


def different(parameters: PlantParameters) -> Array:
    """Vectors (BATCH, n_parameters) around these: each number of the rig file within 0.1 %."""
    values = np.repeat(parameters.values[None], BATCH, axis=0)
    stated = [k for k, place in enumerate(RIG_PLACES.values()) if place.section != "effect"]
    draws = np.random.default_rng(1).uniform(-1e-3, 1e-3, (BATCH, len(stated)))
    values[:, stated] *= 1.0 + draws
    return values


def diagnosis_batches(
    parameters: PlantParameters, values: Array, commands: Array
) -> dict[str, Callable[[], object]]:
    """Calls that compare a batch with a recording, as fits of a diagnosis do."""
    constants, sensors = derive_constants(values), sensor_constants(values)
    measured = np.zeros((len(commands), N_CHANNELS))
    known = np.zeros(measured.shape, dtype=bool)
    known[:, : POSITION + 1] = True
    state = np.repeat(initial_state(parameters)[None], len(values), axis=0)
    tables = tuple(for_kernel(table) for table in parameters.tables)
    lanes = partial(
        observe, constants, sensors, tables, commands, measured, known, state,
        sample_time=PERIOD, step=PERIOD, horizon=0.3,
    )  # fmt: skip
    side_by_side = lane_kernels(constants)[:1] if HAVE_NUMBA else ()
    return {
        "diagnosis, one after the other": partial(lanes, kernels=()),
        "diagnosis, side by side": partial(lanes, kernels=side_by_side),
        "diagnosis, side by side, two threads": partial(lanes, kernels=side_by_side, threads=2),
    }


def seconds_of(call: Callable[[], object], repeats: int = REPEATS) -> float:
    """Shortest time of a call [s], without its first one, which compiles."""
    call()
    return min(timeit.repeat(call, number=1, repeat=repeats))


def seconds_in_two_processes(call: Callable[[], object]) -> float:
    """The same while another process does the same work [s], mean of both processes."""
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(2, mp_context=spawn) as pool:
        list(pool.map(seconds_of, [call, call]))  # both are started, and their kernels loaded
        return float(np.mean(list(pool.map(seconds_of, [call, call], [3 * REPEATS] * 2))))


def _declare(parser: Parser) -> None:
    """The bench has no options of its own."""


def _run(given: Arguments) -> Outcome:
    """Measure and print."""
    parameters = PlantParameters.from_rig(load_rig(ELBOW))
    swing = 0.05 * np.sin(2.0 * np.pi * np.arange(round(RECORDED / PERIOD)) * PERIOD)
    recorded = np.column_stack((swing, -swing))
    commands = recorded[: round(SECONDS / PERIOD)]
    values = different(parameters)
    steps = SECONDS / min(DEFAULT_STEP, PERIOD)
    batch = partial(simulate, parameters, commands, PERIOD, values=values)
    kernels = lane_kernels(derive_constants(values))[:1]
    own = [kernel.for_all(1) for kernel in kernels]
    calls: dict[str, tuple[float, Callable[[], object]]] = {
        "one trajectory": (1, partial(simulate, parameters, commands, PERIOD, kernels=own)),
        "batch, one after the other": (BATCH, partial(batch, kernels=())),
        "batch": (BATCH, partial(batch, kernels=kernels)),
        "batch, two threads": (BATCH, partial(batch, kernels=kernels, threads=2)),
    }
    for name, options in diagnosis_batches(parameters, values, recorded).items():
        calls[name] = (BATCH / STEPS_PER_SAMPLE * RECORDED / SECONDS, options)
    rates = {}
    for name, (lanes, call) in calls.items():
        rates[name] = lanes * steps / seconds_of(call)
        print(f"{name:40s} {1e-6 * rates[name]:7.2f} million steps/s", flush=True)
    for name in ("batch", "diagnosis, side by side"):
        lanes, call = calls[name]
        both = f"{name}, two processes"
        rates[both] = 2 * lanes * steps / seconds_in_two_processes(call)
        print(f"{both:40s} {1e-6 * rates[both]:7.2f} million steps/s", flush=True)
    share = seconds_of(lambda: derive_constants(values)) / seconds_of(calls["batch"][1])
    print(f"share of a batch in Python, where threads wait for each other: {share:.0%}")
    print(f"two threads can therefore reach {2.0 / (1.0 + share):.2f} times one at most")
    return Outcome({"steps_per_second": rates, "share_of_constants": share})


BENCH = Command("simulation", "steps per second of the simulated joint", _declare, _run)

if __name__ == "__main__":
    sys.exit(run_command(BENCH, "python benchmarks/simulation_bench.py"))
