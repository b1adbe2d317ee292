"""What a torque that the model lacks may depend on: functions of the motion of a joint.

1, q, q^3               payload, offsets, muscles that are stronger, weaker or softer than written
qd, qdd                 viscous friction, inertia
z_i, slip elements      friction and hysteresis: dz = (dq/d)(1 - z sign(dq)), for several d
q - low pass of q       creep, with two time constants

A sum of slip elements with different lengths d is a generalised Maxwell-slip model: it approximates
hysteresis that does not depend on the rate, from the dry friction of a bearing to threads that rub
on each other.

Source: F. Al-Bender, V. Lampaert, J. Swevers, "The generalized Maxwell-slip model", IEEE
Transactions on Automatic Control 50 (2005) 1883-1887.
"""

from __future__ import annotations

import math
from typing import Any, Final

from pam_control.rows.plan_rows import N_MEMORY

SLIP_LENGTHS: Final = (0.0015, 0.006, 0.025, 0.1)  # rad
CREEP_TIMES: Final = (0.15, 1.5)  # s
DEVIATIONS: Final = (0.03, 0.1, 0.1, 0.01, 1e-3, *(0.022,) * 6)
"""What is usual for the weight of each function, per torque that the muscles can give at most."""


N_SLIPS: Final = len(SLIP_LENGTHS)
N_ELEMENTS: Final = N_SLIPS + len(CREEP_TIMES)
assert N_MEMORY == 1 + N_ELEMENTS


def begin_memory(row: Any, at: int) -> None:
    """Begin without friction and relaxed; the memory is in a row from a place on."""
    row[at] = math.nan
    for place in range(N_SLIPS):
        row[at + 1 + place] = 0.0


def move_memory(row: Any, at: int, position: float, step: float) -> None:
    """Move to a position [rad] within a time [s]."""
    if math.isnan(row[at]):
        row[at] = position
        for place in range(len(CREEP_TIMES)):
            row[at + 1 + N_SLIPS + place] = position
    moved = position - row[at]
    row[at] = position
    if moved != 0.0:
        sign, back = math.copysign(1.0, moved), -abs(moved)
        for place in range(N_SLIPS):
            z = row[at + 1 + place]
            row[at + 1 + place] = sign - (sign - z) * math.exp(back / SLIP_LENGTHS[place])
    for place in range(len(CREEP_TIMES)):
        relaxed = row[at + 1 + N_SLIPS + place]
        row[at + 1 + N_SLIPS + place] += step / (CREEP_TIMES[place] + step) * (position - relaxed)


def element(row: Any, at: int, number: int) -> float:
    """Value of an element: slip [-], or position minus its relaxed one [rad]."""
    if number < N_SLIPS:
        return float(row[at + 1 + number])
    return float(row[at] - row[at + 1 + number])
