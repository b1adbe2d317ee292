"""The pressures of any number of muscles of one joint, for a torque and a stiffness.

Torque and stiffness are affine in the pressures of muscles that pull affinely (`affine_inverse`).
Two muscles against each other on one pulley have the exact inverse of two equations. For any other
muscles, three questions are answered one after the other, each within the ranges of the pressures:

1. The torque that is nearest to the one asked for.
2. Among the pressures with this torque, the stiffness that is nearest to the one asked for. The
   least and the largest stiffness follow from a greedy choice: the largest torque is reduced to
   the wanted one by the muscles that lose least, or most, stiffness per torque.
3. Among those with both, the least sum of squares of the pressures, by an active-set method: so
   equal muscles share the load equally, and the pressures follow a changing torque continuously.

One muscle reaches a torque only. A muscle has a row, `L_WEAKEST` to `L_HIGH` of its line and
`L_RATIO`, its arm over the radius of the joint; the functions write `L_PRESSURE`. numba compiles
them with whatever calls them, so they allocate nothing and keep what they need in the rows.

Source: J. Nocedal, S. J. Wright, Numerical Optimization, 2nd ed., Springer 2006, section 16.5
(active sets); G. B. Dantzig, Discrete-variable extremum problems, Operations Research 5(2), 1957
(greedy choice).
"""

from __future__ import annotations

import math
from typing import Any, Final

from pam_model.joints.affine_inverse import (
    Line,
    affine_pressures,
    is_limited,
    pressure_for,
)

(L_WEAKEST, L_STRONGEST, L_SCALE, L_PASSIVE, L_RISE, L_OFFSET, L_LOW, L_HIGH, L_RATIO,
 L_PRESSURE) = range(10)  # fmt: skip
(_LEAST, _MOST, _BEGIN, _END, _TORQUE, _STIFFNESS, _ACROSS, _STATE) = range(10, 18)
N_LINE: Final = 18
"""Of a muscle: its line; its arm over the radius of the joint [-]; the pressure that was found
[Pa gauge]; and what the general inverse keeps of it: pressures of the least and of the largest
stiffness, range of the pressure on the line, torque over radius and stiffness over its square per
pressure, the part of the latter that is orthogonal to the former, and whether it is at an end."""

AGAINST_EACH_OTHER: Final = (1.0, -1.0)
"""The ratios of two muscles that have the exact inverse."""
_FREE, _AT_BEGIN, _AT_END = 0.0, -1.0, 1.0
_PARALLEL: Final = 1e-10  # squared sine between the two equations, below which they are one
_EDGE: Final = 1e-9  # of the largest pressure, by which a multiplier may have the wrong sign
_ROUNDS: Final = 8  # per muscle; what is not the least by then still has torque and stiffness


def line_of(row: Any, at: int) -> Line:
    """The line of a muscle, which begins at `at` in its row."""
    return (
        row[at], row[at + L_STRONGEST], row[at + L_SCALE], row[at + L_PASSIVE], row[at + L_RISE],
        row[at + L_OFFSET], row[at + L_LOW], row[at + L_HIGH],
    )  # fmt: skip


def write_line(row: Any, at: int, line: Line, ratio: float) -> None:
    """Write a line and the arm over the radius of the joint [-] into the row of a muscle."""
    row[at], row[at + L_STRONGEST], row[at + L_SCALE], row[at + L_PASSIVE] = line[:4]
    row[at + L_RISE], row[at + L_OFFSET], row[at + L_LOW], row[at + L_HIGH] = line[4:]
    row[at + L_RATIO] = ratio


def muscle_pressures(
    rows: Any, at: int, radius: float, torque: float, stiffness: float
) -> tuple[float, float, bool, bool]:
    """Find the pressures for a torque and a stiffness; write them at `L_PRESSURE`.

    Parameters
    ----------
    rows : rows, one for each muscle
        With its line and ratio from the column `at` on.
    at : int
        That column.
    radius : float
        To which the ratios refer [m].
    torque, stiffness : float
        [N m], [N m/rad].

    Returns
    -------
    torque, stiffness : float
        That are reached [N m], [N m/rad].
    torque_limited, stiffness_limited : bool
        Whether the request was outside the range; torque has priority over stiffness.
    """
    if len(rows) == 2 and rows[0][at + L_RATIO] == 1.0 and rows[1][at + L_RATIO] == -1.0:
        first, second, reached, stiff, cut, soft = affine_pressures(
            line_of(rows[0], at), line_of(rows[1], at), radius, torque, stiffness
        )
        rows[0][at + L_PRESSURE], rows[1][at + L_PRESSURE] = first, second
        return reached, stiff, cut, soft
    return _least_pressures(rows, at, radius, torque, stiffness)


def _least_pressures(
    rows: Any, at: int, radius: float, torque: float, stiffness: float
) -> tuple[float, float, bool, bool]:
    """The general inverse; see `muscle_pressures` and the module."""
    low = high = strongest = still_pull = still_rate = 0.0
    for k in range(len(rows)):
        row, ratio = rows[k], rows[k][at + L_RATIO]
        weakest, most, scale = row[at], row[at + L_STRONGEST], row[at + L_SCALE]
        low += ratio * (weakest if ratio > 0.0 else most)
        high += ratio * (most if ratio > 0.0 else weakest)
        strongest += abs(ratio) * most
        if scale > 0.0:
            row[at + _BEGIN] = (weakest - row[at + L_PASSIVE]) / scale
            row[at + _END] = (most - row[at + L_PASSIVE]) / scale
            still_pull += ratio * row[at + L_PASSIVE]
        else:  # the choice of the pressure has no influence
            row[at + _BEGIN] = row[at + _END] = row[at + L_LOW]
            still_pull += ratio * weakest
        row[at + _TORQUE] = ratio * scale
        row[at + _STIFFNESS] = ratio * ratio * (row[at + L_RISE] if scale > 0.0 else 0.0)
        still_rate += ratio * ratio * row[at + L_OFFSET]
    pull = min(max(torque / radius, low), high)
    _extreme(rows, at, _LEAST, high - pull, -1.0)
    _extreme(rows, at, _MOST, high - pull, 1.0)
    least = still_rate + _total(rows, at, _LEAST, _STIFFNESS)
    most = still_rate + _total(rows, at, _MOST, _STIFFNESS)
    share = 0.0
    if most > least:
        share = min(max((stiffness / (radius * radius) - least) / (most - least), 0.0), 1.0)
    for k in range(len(rows)):
        row = rows[k]
        row[at + L_PRESSURE] = (1.0 - share) * row[at + _LEAST] + share * row[at + _MOST]
    _share_load(rows, at)
    reached = radius * (still_pull + _total(rows, at, L_PRESSURE, _TORQUE))
    stiff = radius * radius * (still_rate + _total(rows, at, L_PRESSURE, _STIFFNESS))
    for k in range(len(rows)):
        row = rows[k]
        force = row[at + L_PASSIVE] + row[at + L_SCALE] * row[at + L_PRESSURE]
        row[at + L_PRESSURE] = pressure_for(line_of(row, at), force)
    cut, soft = is_limited(radius * strongest, reached - torque, stiff - stiffness, stiffness)
    return reached, stiff, cut, soft


def _total(rows: Any, at: int, pressure: int, per_pressure: int) -> float:
    """Sum over the muscles of one column times another one."""
    total = 0.0
    for k in range(len(rows)):
        total += rows[k][at + pressure] * rows[k][at + per_pressure]
    return total


def _extreme(rows: Any, at: int, column: int, excess: float, sign: float) -> None:
    """The pressures with the largest stiffness (sign 1) or the least one (sign -1).

    Their torque is that of the strongest pull in the positive direction less `excess`.
    """
    for k in range(len(rows)):
        row = rows[k]
        row[at + column] = row[at + (_END if row[at + _TORQUE] > 0.0 else _BEGIN)]
        row[at + _STATE] = 0.0
    for _ in range(len(rows)):
        chosen, best = -1, math.inf
        for k in range(len(rows)):
            row = rows[k]
            if row[at + _STATE] == 0.0 and row[at + _TORQUE] != 0.0:
                lost = sign * row[at + _STIFFNESS] / row[at + _TORQUE]
                if chosen < 0 or lost < best:
                    chosen, best = k, lost
        if chosen < 0:
            return
        row = rows[chosen]
        row[at + _STATE] = 1.0
        taken = min(excess, abs(row[at + _TORQUE]) * (row[at + _END] - row[at + _BEGIN]))
        row[at + column] -= taken / row[at + _TORQUE]
        excess -= taken


def _share_load(rows: Any, at: int) -> None:
    """Reduce the sum of squares of the pressures; torque and stiffness stay as they are."""
    largest = 0.0
    for k in range(len(rows)):
        row = rows[k]
        begin, end = row[at + _BEGIN], row[at + _END]
        row[at + L_PRESSURE] = min(max(row[at + L_PRESSURE], begin), end)
        row[at + _STATE] = _AT_BEGIN if row[at + L_PRESSURE] <= begin else _FREE
        if row[at + L_PRESSURE] >= end:
            row[at + _STATE] = _AT_END
        largest = max(largest, abs(end), abs(begin))
    edge = _EDGE * largest
    for _ in range(_ROUNDS * len(rows)):
        per_torque, per_stiffness = _multipliers(rows, at)
        blocking, step = -1, 1.0
        for k in range(len(rows)):
            row = rows[k]
            if row[at + _STATE] != _FREE:
                continue
            change = _least(row, at, per_torque, per_stiffness) - row[at + L_PRESSURE]
            room = row[at + (_BEGIN if change < 0.0 else _END)] - row[at + L_PRESSURE]
            # by rounding, a muscle at an end must not seem to be pressed against it
            if abs(change) > max(abs(room), edge) and abs(room) < step * abs(change):
                blocking, step = k, room / change
        for k in range(len(rows)):
            row = rows[k]
            if row[at + _STATE] == _FREE:
                change = _least(row, at, per_torque, per_stiffness) - row[at + L_PRESSURE]
                if k == blocking:
                    row[at + _STATE] = _AT_BEGIN if change < 0.0 else _AT_END
                    row[at + L_PRESSURE] = row[at + (_BEGIN if change < 0.0 else _END)]
                else:
                    row[at + L_PRESSURE] += step * change
        if blocking < 0 and not _is_released(rows, at, per_torque, per_stiffness, edge):
            return


def _least(row: Any, at: int, per_torque: float, per_stiffness: float) -> float:
    """The pressure of a muscle that the multipliers of torque and stiffness give."""
    return float(per_torque * row[at + _TORQUE] + per_stiffness * row[at + _STIFFNESS])


def _multipliers(rows: Any, at: int) -> tuple[float, float]:
    """The multipliers of torque and stiffness for the least pressures of the free muscles."""
    square = product = along = 0.0
    for k in range(len(rows)):
        row = rows[k]
        if row[at + _STATE] == _FREE:
            square += row[at + _TORQUE] * row[at + _TORQUE]
            product += row[at + _TORQUE] * row[at + _STIFFNESS]
            along += row[at + _TORQUE] * row[at + L_PRESSURE]
    if square == 0.0:
        return 0.0, 0.0
    ratio = product / square
    # orthogonalised twice, because nearly parallel equations lose digits
    slip = 0.0
    for k in range(len(rows)):
        row = rows[k]
        row[at + _ACROSS] = row[at + _STIFFNESS] - ratio * row[at + _TORQUE]
        if row[at + _STATE] == _FREE:
            slip += row[at + _TORQUE] * row[at + _ACROSS]
    across = whole = found = 0.0
    for k in range(len(rows)):
        row = rows[k]
        if row[at + _STATE] == _FREE:
            row[at + _ACROSS] -= slip / square * row[at + _TORQUE]
            across += row[at + _ACROSS] * row[at + _ACROSS]
            whole += row[at + _STIFFNESS] * row[at + _STIFFNESS]
            found += row[at + _ACROSS] * row[at + L_PRESSURE]
    if across <= _PARALLEL * whole:
        return along / square, 0.0
    per_stiffness = found / across
    return along / square - per_stiffness * (ratio + slip / square), per_stiffness


def _is_released(
    rows: Any, at: int, per_torque: float, per_stiffness: float, tolerance: float
) -> bool:
    """Whether a muscle at an end of its range has to leave it; the first one is set free."""
    for k in range(len(rows)):
        row = rows[k]
        if row[at + _STATE] == _FREE or row[at + _BEGIN] == row[at + _END]:
            continue
        rise = row[at + L_PRESSURE] - _least(row, at, per_torque, per_stiffness)
        if rise * row[at + _STATE] > tolerance:
            row[at + _STATE] = _FREE
            return True
    return False
