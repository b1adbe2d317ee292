"""The inverse of a joint whose muscles do not pull affinely in pressure: their lines are iterated.

The line of each muscle (`affine_inverse.Line`) passes through its last two points, a secant, until
the pressures of the lines converge.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from pam_model.joints.affine_inverse import (
    Line,
    Point,
    affine_line,
    affine_pressures,
    shifted,
    through,
)
from pam_model.joints.joint_muscle import JointMuscle
from pam_model.joints.muscle_inverse import (
    AGAINST_EACH_OTHER,
    L_PRESSURE,
    N_LINE,
    muscle_pressures,
    write_line,
)

_ROUNDS: Final = 20
_PRESSURE_TOLERANCE: Final = 0.1  # Pa
_PULL_TOLERANCE: Final = 1e-6  # N


def line_of_muscle(muscle: JointMuscle, length: float) -> Line:
    """What a muscle does at a length [m], in the range of its pressures."""
    model, low, high = muscle.model, muscle.low_pressure, muscle.high_pressure
    affine = muscle.affine_model
    if affine is not None:
        scale, passive = affine.coefficients(length)
        rise, offset = affine.coefficient_slopes(length)
        return affine_line(scale, passive, rise, offset, low, high)
    ends = [
        (each, float(model.force(each, length)), float(model.stiffness(each, length)))
        for each in (low, high)
    ]
    weakest, strongest = (max(0.0, pull) for _, pull, _ in ends)
    if strongest <= weakest:
        # The muscle is too short to pull at any pressure, so the choice has no influence.
        rate = ends[0][2] if weakest > 0.0 else 0.0
        return weakest, weakest, 0.0, weakest, 0.0, rate, low, high
    return through((weakest, strongest, 0.0, 0.0, 0.0, 0.0, low, high), *ends)


def pressures_of_lines(
    lines: Sequence[Line],
    ratios: Sequence[float],
    radius: float,
    torque: float,
    stiffness: float,
) -> tuple[tuple[float, ...], float, float, bool, bool]:
    """The pressures, and what `muscle_pressures` returns."""
    if tuple(ratios) == AGAINST_EACH_OTHER:  # what the rows say too, but more slowly
        both = affine_pressures(lines[0], lines[1], radius, torque, stiffness)
        return both[:2], *both[2:]
    rows = [[0.0] * N_LINE for _ in lines]
    for row, line, ratio in zip(rows, lines, ratios, strict=True):
        write_line(row, 0, line, ratio)
    found = muscle_pressures(rows, 0, radius, torque, stiffness)
    return tuple(row[L_PRESSURE] for row in rows), *found


def iterated_pressures(
    muscles: Sequence[JointMuscle],
    ratios: Sequence[float],
    radius: float,
    lines: Sequence[Line],
    lengths: Sequence[float],
    torque: float,
    stiffness: float,
) -> tuple[float, ...]:
    """The pressures for a torque and a stiffness [Pa gauge].

    Parameters
    ----------
    ratios : sequence of float
        Their arms over the radius [-].
    radius : float
        To which the ratios refer [m].
    lines : sequence of tuple
        To begin with.
    lengths : sequence of float
        Of the muscles [m].
    torque, stiffness : float
        [N m], [N m/rad].
    """
    lines = list(lines)
    last: list[Point | None] = [None] * len(lines)
    pressures: tuple[float, ...] = ()
    for _ in range(_ROUNDS):
        pressures = pressures_of_lines(lines, ratios, radius, torque, stiffness)[0]
        step = 0.0
        for index, (muscle, length) in enumerate(zip(muscles, lengths, strict=True)):
            before, pressure = last[index], pressures[index]
            point = (
                pressure,
                float(muscle.model.force(pressure, length)),
                float(muscle.model.stiffness(pressure, length)),
            )
            moved = math.inf if before is None else abs(pressure - before[0])
            step = max(step, moved)
            if before is None or moved <= _PRESSURE_TOLERANCE:
                lines[index] = shifted(lines[index], point)
            else:
                lines[index] = through(lines[index], before, point)
            last[index] = point
        if step < _PRESSURE_TOLERANCE:
            return pressures
    per_pressure = [ratio * line[2] for ratio, line in zip(ratios, lines, strict=True)]
    return _with_pull(muscles, ratios, lengths, per_pressure, list(pressures), torque / radius)


def _with_pull(
    muscles: Sequence[JointMuscle],
    ratios: Sequence[float],
    lengths: Sequence[float],
    per_pressure: Sequence[float],
    pressures: list[float],
    wanted: float,
) -> tuple[float, ...]:
    """Pressures that did not converge, with the least change that gives the pull [N], if any does.

    It may happen at the ends of the range of the stiffness, and the torque has priority.
    """
    for _ in range(_ROUNDS):
        missed, slopes = wanted, list(per_pressure)
        for k, (muscle, ratio, length) in enumerate(zip(muscles, ratios, lengths, strict=True)):
            missed -= ratio * max(0.0, float(muscle.model.force(pressures[k], length)))
        for k, muscle in enumerate(muscles):
            up = slopes[k] * missed > 0.0
            if pressures[k] == (muscle.high_pressure if up else muscle.low_pressure):
                slopes[k] = 0.0
        square = sum(slope * slope for slope in slopes)
        if square == 0.0 or abs(missed) < _PULL_TOLERANCE:
            break
        for k, muscle in enumerate(muscles):
            moved = pressures[k] + slopes[k] * missed / square
            pressures[k] = min(max(moved, muscle.low_pressure), muscle.high_pressure)
    return tuple(pressures)
