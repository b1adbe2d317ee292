"""What the constants of a joint say about it: functions of one row that a controller compiles.

They are for a round pulley and without dry friction. The braid of both muscles is in closed form
where a function needs their pulls.
"""

from __future__ import annotations

import math
from typing import Any

from pam_model.joints.affine_inverse import Line, affine_line
from pam_model.joints.muscle_inverse import L_RATIO, muscle_pressures, write_line
from pam_model.physics.joint_geometry import length_per_position, muscle_length
from pam_model.plant.composition import joint_torque
from pam_model.plant.layout import (
    C_GRAVITY,
    C_GRAVITY_ANGLE,
    C_INERTIA,
    C_RADIUS,
    C_VISCOUS,
    M_NEUTRAL,
    constants_of,
)
from pam_model.plant.muscle_stage import braid_force


def gravity(c: Any, position: float) -> float:
    """Torque [N m] that holds the limb still at a position [rad]."""
    return float(c[C_GRAVITY] * math.sin(position - c[C_GRAVITY_ANGLE]))


def gravity_rate(c: Any, position: float) -> float:
    """Derivative of `gravity` with respect to the position [N m/rad]."""
    return float(c[C_GRAVITY] * math.cos(position - c[C_GRAVITY_ANGLE]))


def static_torque(c: Any, position: float, velocity: float) -> float:
    """Torque [N m] for a measured motion [rad], [rad/s]: no inertia, no friction."""
    return float(gravity(c, position) - joint_torque(c, position, velocity))


def moving_torque(c: Any, velocity: float, acceleration: float) -> float:
    """Torque [N m] that inertia and viscous friction take of a motion [rad/s], [rad/s^2]."""
    return float(c[C_INERTIA] * acceleration + c[C_VISCOUS] * velocity)


def motion_torque(c: Any, position: float, velocity: float, acceleration: float) -> float:
    """Torque [N m] for a motion [rad], [rad/s], [rad/s^2]."""
    moving = moving_torque(c, velocity, acceleration)
    return float(moving + gravity(c, position) - joint_torque(c, position, velocity))


def length_of(m: int, ratio: float, c: Any, position: float) -> float:
    """Length [m] of the muscle whose constants begin at `m`, at a position [rad].

    `ratio` is its arm over the radius of the joint [-].
    """
    return float(muscle_length(c[m + M_NEUTRAL], ratio, c[C_RADIUS], position))


def length_rate(ratio: float, c: Any, velocity: float) -> float:
    """Rate of a muscle's length [m/s] at a velocity [rad/s]; of a change of the angle, its own."""
    return float(length_per_position(ratio, c[C_RADIUS]) * velocity)


def torque_of(c: Any, pull: float) -> float:
    """Torque [N m] of the sum of the muscles' pulls [N], each times its ratio."""
    return float(c[C_RADIUS] * pull)


def muscles_torques(
    c: Any, table: Any, muscles: Any, line: int, pressure: int, position: float
) -> tuple[float, float]:
    """Torque of the muscles at a position [rad], and the sum of their torques without signs [N m].

    `muscles` are rows, one for each muscle, with its pressure [Pa gauge] in the column `pressure`
    and its arm in those of its line, which begin at `line` (`muscle_inverse`).
    """
    signed, grip = 0.0, 0.0
    for k in range(len(muscles)):
        share = muscles[k][line + L_RATIO] * _pull(c, table, muscles, k, line, pressure, position)
        signed += share
        grip += abs(share)
    return torque_of(c, signed), torque_of(c, grip)


def _pull(
    c: Any, table: Any, muscles: Any, k: int, line: int, pressure: int, position: float
) -> float:
    """Pull of muscle `k` [N], never below 0."""
    m = constants_of(k)
    length = length_of(m, muscles[k][line + L_RATIO], c, position)
    pull, _, _ = braid_force(m, c, table, muscles[k][pressure], length)
    return max(0.0, float(pull))


def _line(m: int, c: Any, table: Any, length: float, low: float, high: float) -> Line:
    """What a muscle does at a length [m], in a range of pressures [Pa gauge]."""
    passive, offset, scale = braid_force(m, c, table, 0.0, length)
    _, slope, _ = braid_force(m, c, table, high, length)
    return affine_line(scale, passive, (slope - offset) / high, offset, low, high)


def pressures_for(
    c: Any, table: Any, muscles: Any, line: int, low: int, high: int,
    position: float, torque: float, stiffness: float,
) -> tuple[float, float, bool, bool]:  # fmt: skip
    """Find the pressures for a torque [N m] and a stiffness [N m/rad], as `muscle_pressures`.

    `muscles` are rows, one for each muscle; `low` and `high` are the columns of the range of its
    pressure [Pa gauge], and the columns of its line begin at `line`.
    """
    for k in range(len(muscles)):
        row, m = muscles[k], constants_of(k)
        ratio = row[line + L_RATIO]
        length = length_of(m, ratio, c, position)
        write_line(row, line, _line(m, c, table, length, row[low], row[high]), ratio)
    return muscle_pressures(muscles, line, c[C_RADIUS], torque, stiffness)
