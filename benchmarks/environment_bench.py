"""How much faster than real time the Gymnasium environments are, in processor time.

    python benchmarks/environment_bench.py [--json]

64 robots at once, and one, with an action every 20 ms, beside the bare simulation of the same
robots in lanes (`simulate`): the ratio does not depend on the machine. The kernels are compiled
before the clock starts; the best of some repeats counts, because other programs only add.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command
from pam_model.plant.constants import derive_constants
from pam_model.plant.lane_choice import lane_kernels
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import simulate, vented_state
from pam_model.rig import Rig, load_rig
from pam_sim.environment import EpisodeTask, PamVectorEnv

ELBOW = Path(__file__).parents[1] / "config/elbow.yaml"
TASK = EpisodeTask(period=0.02, seconds=1e3)
ROBOTS = 64
STEPS = 100
REPEATS = 7
GOAL = 30.0  # times real time, each of 64 robots at once, on one core
RIGS = {
    "rig file": {},
    "dry friction, payload": {
        "coulomb_friction": {"torque": 0.5},
        "payload": {"mass": 0.5, "distance": 0.3},
    },
}


def best(call: Callable[[], object]) -> float:
    """Least processor time of a call [s]."""
    call()
    found = []
    for _ in range(REPEATS):
        began = time.process_time()
        call()
        found.append(time.process_time() - began)
    return min(found)


def measured(rig: Rig, robots: int) -> tuple[float, float]:
    """Times real time of an environment, and of the simulation alone."""
    envs = PamVectorEnv(rig, robots, TASK)
    envs.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-0.3, 0.3, (robots, 2))

    def steps() -> None:
        for _ in range(STEPS):
            envs.step(actions)

    parameters = PlantParameters.from_rig(rig)
    values = np.repeat(parameters.values[None], robots, axis=0)
    kernels = lane_kernels(np.array([derive_constants(row) for row in values]))
    commands = np.repeat(actions[:1], STEPS, axis=0)
    state = vented_state(parameters)

    def alone() -> None:
        simulate(
            parameters, commands, TASK.period, state, values=values,
            kernels=kernels if robots > 1 else (),
        )  # fmt: skip

    simulated = STEPS * TASK.period
    return simulated / best(steps), simulated / best(alone)


def run(_: Arguments) -> Outcome:
    """Measure and print."""
    rig = load_rig(ELBOW)
    found, missed = {}, []
    for name, effects in RIGS.items():
        hidden = rig.with_joint(replace(rig.joints[0], effects=effects))
        for robots in (1, ROBOTS):
            environment, simulation = measured(hidden, robots)
            found[f"{name}, {robots}"] = {"environment": environment, "simulation": simulation}
            print(
                f"{name:24s} {robots:3d} at once: each {environment:6.1f} times real time, the "
                f"simulation alone {simulation:6.1f} (ratio {environment / simulation:.2f})"
            )
            if robots == ROBOTS and environment < GOAL:
                missed.append(f"{name}: {environment:.1f} times real time, expected {GOAL:g}")
    return Outcome({"times_real_time": found, "goal": GOAL}, missed)


def _declare(parser: Parser) -> None:
    """The bench has no options of its own."""


BENCH = Command(
    "environment",
    "times real time of the Gymnasium environments",
    _declare,
    run,
    bad_news="if 64 robots at once are slower than 30 times real time on one core",
)

if __name__ == "__main__":
    sys.exit(run_command(BENCH, "python benchmarks/environment_bench.py"))
