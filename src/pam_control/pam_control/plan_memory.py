"""Rows at increasing times: what a feedforward has planned, or what the sensors have measured.

The measured pressures are compared with the plan for the time at which they were true, and the
valves follow the plan for the time at which they act. Rows are kept by age, not by number, because
the delays of sensors and valves are given in seconds and the control cycle may be as short as
0.5 ms. They lie in a ring, which is made larger when it is full.

A row begins with its time [s]. `ends` are the first row of the ring and how many there are.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from pam_control.rows.plan_rows import (
    P_KNOWN,
    P_MEASURED,
    P_MEMORY,
    P_PRESSURES,
    P_STIFFNESS,
    P_TIME,
)
from pam_model.plant.compiled import for_kernel

# Plans are kept until they are this much older than the last measurement [s]: a rate is computed
# over one control cycle (20 ms at the slowest rate), and measurements may arrive out of order.
KEPT_BEFORE_MEASUREMENT: Final = 0.1
FIRST_SIZE: Final = 128


def row_of(ring: Any, ends: Any, number: int) -> int:
    """The index of a row by its number; the oldest has 0."""
    return int((ends[0] + number) % len(ring))


def newest(ring: Any, ends: Any) -> int:
    """The index of the newest row."""
    return int((ends[0] + ends[1] - 1) % len(ring))


def forget_before(ring: Any, ends: Any, oldest: float, kept: int) -> None:
    """Forget what is older than a time [s], but for this many rows and one before the time."""
    while ends[1] > kept and ring[row_of(ring, ends, 1)][P_TIME] < oldest:
        ends[0] = (ends[0] + 1) % len(ring)
        ends[1] -= 1


def remember(
    plans: Any, ends: Any, measured_at: float, time: float, muscles: Any, pressure: int,
    stiffness: float, memory: float, known: float,
) -> None:  # fmt: skip
    """Add a plan, and forget those too much older than the last measurement [s].

    Parameters
    ----------
    measured_at : float
        [s].
    time : float
        When the later valve acts [s].
    muscles, pressure : rows, int
        Of the muscles of the joint, and where their pressures are [Pa gauge].
    stiffness : float
        [N m/rad].
    memory, known : float
        Joint torque of `known` without what was learnt, and due to hysteresis and creep of the
        muscles and to dry friction [N m].
    """
    if ends[1] > 1:
        forget_before(plans, ends, measured_at - KEPT_BEFORE_MEASUREMENT, 1)
    ends[1] += 1
    row = plans[newest(plans, ends)]
    row[P_TIME], row[P_STIFFNESS], row[P_MEMORY], row[P_KNOWN] = time, stiffness, memory, known
    for k in range(len(muscles)):
        row[P_PRESSURES + k] = muscles[k][pressure]


def value_at(ring: Any, ends: Any, time: float, field: int, before: float) -> float:
    """A field of the rows at a time [s]: linear between two of them, constant outside them.

    `before` is the part of the way to the later one at which a pair of equal times counts.
    """
    later = ring[newest(ring, ends)]
    if later[P_TIME] <= time:
        return float(later[field])
    for number in range(ends[1] - 1, -1, -1):
        earlier = ring[row_of(ring, ends, number)]
        if earlier[P_TIME] <= time:
            span = later[P_TIME] - earlier[P_TIME]
            part = min((time - earlier[P_TIME]) / span, 1.0) if span > 0.0 else before
            return float(earlier[field] + part * (later[field] - earlier[field]))
        later = earlier
    return float(later[field])


def planned_at(plans: Any, ends: Any, time: float, field: int) -> float:
    """A field of the plan for a time [s]."""
    return value_at(plans, ends, time, field, 0.0)


def planned_rate(plans: Any, ends: Any, time: float, field: int) -> float:
    """Rate [Pa/s] of a planned pressure at the time [s] at which its valve acts.

    The rate is the backward difference over the last control cycle. It is 0 if there are fewer
    than two plans or if the last plan is not later than the one before it.
    """
    if ends[1] < 2:
        return 0.0
    now_planned, before = plans[newest(plans, ends)], plans[row_of(plans, ends, ends[1] - 2)]
    span = now_planned[P_TIME] - before[P_TIME]
    if span <= 0.0:
        return 0.0
    now = planned_at(plans, ends, time, field)
    return float((now - planned_at(plans, ends, time - span, field)) / span)


def shown_pressure(
    plans: Any, ends: Any, shown: float, time: float, lag: float, step: float, field: int
) -> float:
    """A planned pressure [Pa] as a sensor with a lag [s] shows it at a time [s].

    Parameters
    ----------
    plans, ends : rows, (int, int)
        At least one plan.
    shown : float
        What it showed a step before [Pa].
    time : float
        The lag before the time of measurement [s].
    lag, step : float
        Of the sensors, and since the last cycle [s].
    field : int
        Of the pressure.
    """
    if lag == 0.0:
        return planned_at(plans, ends, time, field)
    ahead = planned_at(plans, ends, time + lag, field)
    return float(shown + step / (lag + step) * (ahead - shown))


def measure(samples: Any, ends: Any, time: float, muscles: Any, pressure: int, kept: float) -> None:
    """Add measured pressures of muscles, as for `remember`, and keep them for a while [s].

    A time [s] that is not later than the last is ignored.
    """
    if ends[1] > 0 and time <= samples[newest(samples, ends)][P_TIME]:
        return
    ends[1] += 1
    row = samples[newest(samples, ends)]
    row[P_TIME] = time
    for k in range(len(muscles)):
        row[P_MEASURED + k] = muscles[k][pressure]
    forget_before(samples, ends, time - kept, 2)


class Rings:
    """A ring for each joint, with room for at least one row more.

    Parameters
    ----------
    joints, fields : int
        How many rings, and numbers in a row.
    size : int, optional
        Rows for which there is room at first.

    Attributes
    ----------
    rows, ends
        What the compiled functions take: (joints, size, fields) and (joints, 2).
    """

    def __init__(self, joints: int, fields: int, size: int = FIRST_SIZE) -> None:
        self.rows = for_kernel(np.zeros((joints, size, fields)))
        self.ends = for_kernel(np.zeros((joints, 2), dtype=np.int64))
        self._room = 0  # rows for which there is room in each ring, at least

    def clear(self, joint: int) -> None:
        """Forget all rows of a joint."""
        self.ends[joint][0] = self.ends[joint][1] = 0

    def make_room(self) -> None:
        """Let there be room for one row more."""
        self._room -= 1
        if self._room > 0:
            return
        size, most = len(self.rows[0]), max(int(ends[1]) for ends in self.ends)
        self._room = size - most
        if self._room > 0:
            return
        self._room = size
        old, ends = np.array(self.rows), np.array(self.ends)
        for joint, (first, _) in enumerate(ends.tolist()):
            old[joint] = np.roll(old[joint], -first, axis=0)
        ends[:, 0] = 0
        self.rows = for_kernel(np.concatenate((old, np.zeros_like(old)), axis=1))
        self.ends = for_kernel(ends)
