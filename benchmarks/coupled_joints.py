"""Joints that move each other: time of a step, and of the equation of motion alone.

    python benchmarks/coupled_joints.py [--json]

A chain of links with muscles on each joint, RK4 with 0.25 ms, against as many joints without
links. With a C compiler, the last column is against scalar C of the nominal joint
(benchmarks/limit.c, -O3 -march=native -ffast-math), which has no body, no friction and no effects.
"""

from __future__ import annotations

import sys
import timeit
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from limit import c_rates

from pam_model.body.contact import solve_moving
from pam_model.body.hinge_tree import N_LINK_SCRATCH, mass_and_bias
from pam_model.body.link import Link, link_numbers
from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command
from pam_model.plant.compiled import HAVE_NUMBA, entry_point, for_kernel
from pam_model.plant.default_step import DEFAULT_STEP
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.robot_plant import RobotPlant
from pam_model.plant.simulate import Plant
from pam_model.rig import load_rig

ELBOW = Path(__file__).parents[1] / "config/elbow.yaml"
COUNTS = (1, 2, 4, 7)
DURATION = 0.1  # s
REPEATS = 200
"""Many short calls, as other work on the machine interrupts long ones."""
EFFECTS = {"nominal": {}, "friction": {"coulomb_friction.torque": 0.6}}


@entry_point
def accelerations(
    times: int, links: Any, gravity: Any, q: Any, v: Any, scratch: Any, mass: Any, bias: Any,
    state: Any, factor: Any, x: Any,
) -> None:  # fmt: skip
    """Solve the equation of motion `times` times."""
    for _ in range(times):
        mass_and_bias(links, gravity, q, v, scratch, mass, bias)
        solve_moving(mass, state, bias, factor, x)


def chain(count: int) -> list[Link]:
    """Rods of 0.3 m and 0.3 kg, whose hinges are turned by a right angle from one to the next."""
    turned = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    centre, place = np.array([0.15, 0.0, 0.0]), np.array([0.3, 0.0, 0.0])
    inertia = 0.3 * 0.3**2 / 12.0 * np.diag([0.01, 1.0, 1.0])
    first = Link(mass=0.3, centre=centre, inertia=inertia)
    others = [Link(i, turned, place, 0.3, centre, inertia) for i in range(count - 1)]
    return [first, *others]


def shortest(call: Callable[[], object], repeats: int = REPEATS) -> float:
    """Shortest time of a call [s], without its first one."""
    call()
    return min(timeit.repeat(call, number=1, repeat=repeats if HAVE_NUMBA else 2))


def motion_time(count: int) -> float:
    """Time to solve the equation of motion of a chain [s]."""
    times = 300 if HAVE_NUMBA else 20
    draw = np.random.default_rng(0)
    arrays = [
        link_numbers(chain(count)),
        np.array([0.0, 0.0, -9.81]),
        draw.normal(size=count),
        draw.normal(size=count),
        np.zeros((count, N_LINK_SCRATCH)),
        np.zeros((count, count)),
        np.zeros(count),
        np.zeros(count),
        np.zeros((count, count)),
        np.zeros(count),
    ]
    given = [for_kernel(array) for array in arrays]
    return shortest(lambda: accelerations(times, *given)) / times


def step_time(count: int, effects: dict[str, float], *, links: bool) -> float:
    """Time of one integration step of `count` joints [s]."""
    one = PlantParameters.from_rig(load_rig(ELBOW)).forced({"joint.inertia": 0.02, **effects})
    if count == 1 and not links:
        alone = Plant(one)
        return shortest(lambda: alone.step((0.1, -0.1), DURATION)) / (DURATION / DEFAULT_STEP)
    robot = RobotPlant([one] * count, links=chain(count) if links else ())
    commands = [(0.02, -0.02), (-0.02, 0.02)] * count
    return shortest(lambda: robot.step(commands[:count], DURATION)) / (DURATION / DEFAULT_STEP)


def _declare(parser: Parser) -> None:
    """The bench has no options of its own."""


def _run(given: Arguments) -> Outcome:
    """Measure and print."""
    rate = c_rates().get("scalar")
    limit = None if rate is None else 1e-6 / rate
    rows = []
    for name, effects in EFFECTS.items():
        for count in COUNTS:
            row: dict[str, Any] = {
                "effects": name,
                "joints": count,
                "motion_ns": 1e9 * motion_time(count),
                "alone_ns": 1e9 * step_time(count, effects, links=False),
                "coupled_ns": 1e9 * step_time(count, effects, links=True),
            }
            text = "{effects:9s} {joints} joints: equation of motion {motion_ns:6.0f} ns, step "
            text += "without links {alone_ns:6.0f} ns, with links {coupled_ns:6.0f} ns"
            print(text.format(**row), end="")
            if limit is not None:
                row["per_joint_of_c"] = row["coupled_ns"] * 1e-9 / count / limit
                print(f", {row['per_joint_of_c']:.1f} of scalar C per joint", end="")
            print(flush=True)
            rows.append(row)
    return Outcome({"rows": rows, "scalar_c_ns": None if limit is None else 1e9 * limit})


BENCH = Command("coupled_joints", "time of a step of joints that move each other", _declare, _run)

if __name__ == "__main__":
    sys.exit(run_command(BENCH, "python benchmarks/coupled_joints.py"))
