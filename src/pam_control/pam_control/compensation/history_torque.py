"""Joint torque that depends on the motion before, predicted along the joint's reference.

That of hysteresis, creep and every other effect of a muscle with a state and an exact step, and of
the dry friction of the joint. The states are computed along the reference, ahead of time, so that
they do not change the feedback loop.
"""

from __future__ import annotations

import math
from typing import Any

from pam_control.compensation.dry_friction import slipped
from pam_control.rows.plan_rows import (
    J_HAS_HISTORY,
    J_PRESLIDING,
    W_LINE,
    W_PLANNED,
    Y_HISTORY_POSITION,
    Y_HISTORY_TIME,
    Y_SLIP,
)
from pam_model.joints.muscle_inverse import L_RATIO
from pam_model.plant.composition import dry_friction, memory_pull
from pam_model.plant.control_laws import memory_advance
from pam_model.plant.layout import N_MUSCLE_STATES, constants_of
from pam_model.views.joint_rows import length_rate, torque_of


def begin_history(y: Any, memory: Any) -> None:
    """Nothing has moved: all states are 0, because those of the muscles are unknown."""
    y[Y_HISTORY_POSITION] = y[Y_HISTORY_TIME] = math.nan
    y[Y_SLIP] = 0.0
    for place in range(len(memory)):
        memory[place] = 0.0


def history_torque(
    c: Any, j: Any, w: Any, y: Any, memory: Any, time: float, position: float, velocity: float,
    acceleration: float,
) -> float:  # fmt: skip
    """Advance the states along the reference to a time and return their torque on the joint [N m].

    Parameters
    ----------
    c, j, w, y, memory : rows
        Constants of the joint, its numbers, its muscles, whose approximate pressures at that time
        are `W_PLANNED`, state of the plan (`plan_rows`) and of the muscles.
    time : float
        Not earlier than in the last call [s].
    position, velocity, acceleration : float
        Of the reference at that time.
    """
    if j[J_HAS_HISTORY] == 0.0:
        return 0.0
    if not math.isnan(y[Y_HISTORY_POSITION]):
        travel = position - y[Y_HISTORY_POSITION]
        y[Y_SLIP] = slipped(y[Y_SLIP], travel, velocity, acceleration, j[J_PRESLIDING])
        duration = max(time - y[Y_HISTORY_TIME], 0.0)
        for k in range(len(w)):
            stroke = length_rate(w[k][W_LINE + L_RATIO], c, travel)
            memory_advance(constants_of(k), c, memory, k * N_MUSCLE_STATES, stroke, duration)
    y[Y_HISTORY_POSITION], y[Y_HISTORY_TIME] = position, time
    pull = 0.0
    for k in range(len(w)):
        own, _ = memory_pull(constants_of(k), c, memory, k * N_MUSCLE_STATES, w[k][W_PLANNED])
        pull += w[k][W_LINE + L_RATIO] * own
    return float(torque_of(c, pull) - y[Y_SLIP] * dry_friction(c, velocity))
