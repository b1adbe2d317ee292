"""Time integration of several joints side by side: kernel.py for a block of lanes.

Every function below with lane arrays (lane_twins.py) is written for one lane, and is called in a
loop over the lanes. The scheme is that of kernel.py: RK4 with held commands, and a contact that is
decided once per step. Motion and pressures are not prescribed here.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from inspect import signature
from types import FunctionType
from typing import Any, Final

from pam_model.plant.compiled import compiled, compiled_loop
from pam_model.plant.composition import dry_friction
from pam_model.plant.joint_stage import joint_rates
from pam_model.plant.kernel import (
    AT_REST,
    LOCKED,
    LOWEST_PRESSURE,
    contact_at_rest,
    finish,
    held_command,
    move,
    moving_contact,
    settle_contact,
)
from pam_model.plant.lane_twins import (
    LANES,
    SINGLE,
    LaneVariant,
    Variant,
    kernel_name,
    lane_loop,
)
from pam_model.plant.layout import (
    C_MUSCLES,
    C_PER_INERTIA,
    M_DELAY,
    N_MUSCLE_CONSTANTS,
    N_MUSCLE_STATES,
    S_PRESSURE,
    Y_MUSCLES,
    Y_VELOCITY,
)


@compiled
def hold(c: Any, held: Any, commands: Any, now: float, step: float, sample_time: float) -> None:
    """Write the commands that hold within a step, of all muscles."""
    for i in range(len(held)):
        delay = c[C_MUSCLES + i * N_MUSCLE_CONSTANTS + M_DELAY]
        held[i] = held_command(commands, i, now, step, sample_time, delay)


def hold_own(
    active: int, c: Any, held: Any, commands: Any, now: float, step: float, sample_time: float
) -> None:
    """As `hold`, for all lanes, of which each has commands of its own: `commands[lane]`."""
    if commands.shape[1] == 1:  # no past, so that none of the lanes has a delay
        for i in range(commands.shape[2]):
            for lane in range(min(active, LANES)):
                held[i * LANES + lane] = commands[lane, 0, i]
        return
    for lane in range(active):
        for i in range(commands.shape[2]):
            delay = c[(C_MUSCLES + i * N_MUSCLE_CONSTANTS + M_DELAY) * LANES + lane]
            held[i * LANES + lane] = held_command(commands[lane], i, now, step, sample_time, delay)


@compiled
def find_delay(c: Any, held: Any, contact: Any) -> None:
    """Write whether a valve is delayed, so that its command changes within a sample."""
    contact[0] = 0.0
    for i in range(len(held)):
        contact[0] = max(contact[0], c[C_MUSCLES + i * N_MUSCLE_CONSTANTS + M_DELAY])


@compiled
def judge_contact(c: Any, y: Any, contact: Any) -> None:
    """Write the contact, or AT_REST, and the speed with which the step begins."""
    contact[0] = moving_contact(c, y)
    contact[1] = y[Y_VELOCITY]


@compiled
def judge_rest(c: Any, y: Any, dy: Any, contact: Any, torque: Any) -> None:
    """Decide the contact of a joint at rest by the torque of its muscles.

    The rates `dy` are those without contact. At rest, it changes the acceleration alone.
    """
    if contact[0] == AT_REST:
        contact[0] = contact_at_rest(c, y, torque[0])
        if contact[0] == LOCKED:
            dy[Y_VELOCITY] = 0.0
        else:  # the sign of the motion that friction opposes, or 0
            dy[Y_VELOCITY] -= contact[0] * dry_friction(c, 0.0) * c[C_PER_INERTIA]


@compiled
def rates(
    c: Any,
    tables: Any,
    y: Any,
    dy: Any,
    held: Any,
    contact: Any,
    torque: Any,
    drive: Any,
    shut: bool,
    h: float,
) -> None:
    """Write the rates of all states under the contact of this step, and the muscles' torque."""
    free = contact[0] != LOCKED
    sliding = contact[0] if abs(contact[0]) == 1.0 else 0.0
    torque[0] = joint_rates(c, tables, y, dy, held, drive, sliding, free, (False, False), shut, h)


@compiled
def settle(c: Any, tables: Any, y: Any, contact: Any, step: float) -> None:
    """Correct the state after a step."""
    for i in range(len(tables)):
        o = Y_MUSCLES + i * N_MUSCLE_STATES
        y[o + S_PRESSURE] = max(y[o + S_PRESSURE], LOWEST_PRESSURE)
    settle_contact(c, y, contact[0], contact[1], step)


# Loops over the lanes, which `with_loops` defines for each kernel.
find_delay_lanes: Any = None
hold_lanes: Any = None
judge_contact_lanes: Any = None
judge_rest_lanes: Any = None
rates_lanes: Any = None
move_lanes: Any = None
finish_lanes: Any = None
settle_lanes: Any = None


def advance(
    active: int,
    c: Any,
    tables: Any,
    y: Any,
    k1: Any,
    k2: Any,
    k3: Any,
    k4: Any,
    ys: Any,
    held: Any,
    contact: Any,
    torque: Any,
    drive: Any,
    commands: Any,
    sample: int,
    shut: bool,
    sample_time: float,
    steps: int,
) -> None:
    """Simulate one sample of the first `active` lanes; the arrays hold LANES lanes."""
    h = sample_time / steps
    for i in range(len(y)):  # the states that do not change are never written again
        ys[i] = y[i]
    find_delay_lanes(active, c, held, contact)
    delayed = False
    for lane in range(active):
        delayed = delayed or contact[lane] > 0.0
    for j in range(steps):
        now = sample * sample_time + j * h
        if delayed or j == 0:
            hold_lanes(active, c, held, commands, now, h, sample_time)
        judge_contact_lanes(active, c, y, contact)
        at_rest = False
        for lane in range(active):
            at_rest = at_rest or contact[lane] == AT_REST
        rates_lanes(active, c, tables, y, k1, held, contact, torque, drive, shut, h)
        if at_rest:
            judge_rest_lanes(active, c, y, k1, contact, torque)
        move_lanes(active, c, tables, y, k1, ys, 0.5 * h)
        rates_lanes(active, c, tables, ys, k2, held, contact, torque, drive, shut, h)
        move_lanes(active, c, tables, y, k2, ys, 0.5 * h)
        rates_lanes(active, c, tables, ys, k3, held, contact, torque, drive, shut, h)
        move_lanes(active, c, tables, y, k3, ys, h)
        rates_lanes(active, c, tables, ys, k4, held, contact, torque, drive, shut, h)
        finish_lanes(active, c, tables, y, k1, k2, k3, k4, h)
        settle_lanes(active, c, tables, y, contact, h)


@cache
def advance_lanes(variant: Variant, *, own_commands: bool = False) -> Callable[..., None]:
    """`advance` compiled for a variant of the plant.

    With `own_commands`, each lane has commands of its own, see `hold_own`.
    """
    loops = (
        find_delay,
        hold,
        judge_contact,
        judge_rest,
        rates,
        move,
        finish,
        settle,
    )
    made = with_loops(advance, loops, variant)
    if own_commands:
        made.__globals__["hold_lanes"] = compiled_loop(hold_own)
        made.__qualname__ += "_own"
    return compiled(made) if variant is SINGLE else compiled_loop(made)


ALL_ON: Final[frozenset[str]] = frozenset()
"""For loops that do not depend on the laws that are off: one version serves all kernels.

Those that take the force tables do, as they have to do with the muscles.
"""


def with_loops(
    function: FunctionType | Callable[..., Any], loops: tuple[Any, ...], variant: Variant
) -> FunctionType:
    """A copy of a function in which `<name>_lanes` is the loop over lanes of a function."""
    assert isinstance(function, FunctionType)
    common = variant and LaneVariant(ALL_ON, variant.muscles)
    made = {
        f"{loop.__name__}_lanes": lane_loop(
            loop,
            variant if "tables" in signature(loop).parameters else common,
        )
        for loop in loops
    }
    copied = FunctionType(function.__code__, {**function.__globals__, **made}, function.__name__)
    copied.__qualname__ = f"{function.__qualname__}_{kernel_name(variant)}"
    copied.__module__ = function.__module__
    return copied
