"""The stages of a control cycle as numba compiles them, each for all joints in one call."""

from __future__ import annotations

from typing import Any

from pam_control.cycle.joint_cycle import K_DELAY, K_STIFFNESS, demand, longest_delay, sense, settle
from pam_control.cycle.valve_stage import command_valves, true_pressures
from pam_model.plant.compiled import entry_point

DEMAND, COMMAND, SETTLE = range(3)
"""The parts of `act`: what the pressure loops have to do, what they do, and the integrals."""


@entry_point
def begin(
    owned: Any, k: Any, v: Any, stiffnesses: Any, stiffness_at: int, delays: Any, delay_at: int
) -> float:
    """Take what the law knows; return the longest learnt delay of a command [s].

    `stiffnesses` and `delays` are rows of joints, which have `K_STIFFNESS` and `K_DELAY` at
    these places.
    """
    for i in range(len(k)):
        k[i][K_STIFFNESS], k[i][K_DELAY] = stiffnesses[i][stiffness_at], delays[i][delay_at]
    return longest_delay(owned, k, v)


@entry_point
def measure(
    time: float, step: float, position_time: float, measured_at: float, measurement_delay: float,
    owners: Any, owned: Any, c: Any, n: Any, v: Any, d: Any, shown: Any, w: Any, x: Any, k: Any,
    u: Any, history: Any, ends: Any, positions: Any,
) -> None:  # fmt: skip
    """Take the measurement: the pressures in the muscles, and what all plans need (`sense`)."""
    true_pressures(owners, c, n, v, d, shown, step)
    sense(
        owned, w, x, k, u, d, v, history, ends, positions, time, position_time, measured_at,
        measurement_delay,
    )  # fmt: skip


@entry_point
def act(
    first: int, last: int, supply: float, age: float, step: float, sinks: bool,
    owners: Any, owned: Any, c: Any, n: Any, e: Any, g: Any, v: Any, d: Any, w: Any, x: Any, k: Any,
    u: Any, z: Any, commands: Any,
) -> tuple[float, bool]:  # fmt: skip
    """Do what was planned, in parts, both included; return what `command_valves` does.

    Nothing comes after the commands if a fit has to be updated or forgotten.
    """
    drawn, is_due = 0.0, False
    if first == DEMAND:
        demand(owned, w, x, k, u, d, step)
    if first <= COMMAND <= last:
        drawn, is_due = command_valves(owners, c, n, e, g, v, d, supply, age, step, commands)
    if last == SETTLE and not is_due:
        settle(owned, w, x, k, u, v, d, z, step, sinks)
    return drawn, is_due
