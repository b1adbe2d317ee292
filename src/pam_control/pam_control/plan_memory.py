"""The pressures that a feedforward has planned, and those planned for any time near the present.

The measured pressures are compared with the plan for the time at which they were true, and the
valves follow the plan for the time at which they act.
"""

from __future__ import annotations

from dataclasses import dataclass

Pair = tuple[float, float]

# Plans are kept until they are this much older than the last measurement [s]: a rate is computed
# over one control cycle (20 ms at the slowest rate), and measurements may arrive out of order.
KEPT_BEFORE_MEASUREMENT = 0.1


@dataclass(slots=True)
class Plan:
    """Desired pressures of the feedforward at one time.

    Attributes
    ----------
    time : float
        Time when the later valve acts [s].
    pressures : (float, float)
        Gauge pressures of agonist and antagonist [Pa].
    stiffness : float
        [N m/rad].
    memory_torque : float
        Joint torque of `known`, without what was learnt [N m].
    known : float
        Joint torque due to hysteresis and creep of the muscles and to dry friction [N m].
    """

    time: float
    pressures: Pair
    stiffness: float
    memory_torque: float
    known: float


Plans = tuple[Plan, ...]
"""The oldest first."""


def remember(plans: Plans, plan: Plan, measured_at: float) -> Plans:
    """The plans with one more, and without those too much older than the last measurement [s].

    Plans are deleted by age, not by number, because the delays of sensors and valves are given
    in seconds and the control cycle may be as short as 0.5 ms.
    """
    first, oldest = 0, measured_at - KEPT_BEFORE_MEASUREMENT
    while len(plans) - first > 1 and plans[first + 1].time < oldest:
        first += 1
    return (*plans[first:], plan)


def planned_rates(plans: Plans, times: Pair) -> Pair:
    """Rates [Pa/s] of the planned pressures at the time [s] at which each valve acts.

    The rate is the backward difference over the last control cycle. It is 0 if there are fewer
    than two plans or if the last plan is not later than the one before it.
    """
    if len(plans) < 2:
        return 0.0, 0.0
    span = plans[-1].time - plans[-2].time
    if span <= 0.0:
        return 0.0, 0.0
    now = pressures_at(plans, times)
    before = pressures_at(plans, (times[0] - span, times[1] - span))
    return (now[0] - before[0]) / span, (now[1] - before[1]) / span


def pressures_at(plans: Plans, times: Pair) -> Pair:
    """Planned pressures [Pa] at the time [s] of each muscle."""
    first, second = times
    pressures = plan_at(plans, first).pressures
    if second == first:
        return pressures
    return pressures[0], plan_at(plans, second).pressures[1]


def shown_pressures(plans: Plans, shown: Pair, time: float, lag: float, step: float) -> Pair:
    """Planned pressures [Pa] as sensors with a lag [s] show them at a time [s].

    Parameters
    ----------
    plans : tuple of Plan
        At least one.
    shown : (float, float)
        What they showed a step before [Pa].
    time : float
        The lag before the time of measurement [s].
    lag, step : float
        Of the sensors, and since the last cycle [s].
    """
    if lag == 0.0:
        return plan_at(plans, time).pressures
    weight = step / (lag + step)
    first, second = plan_at(plans, time + lag).pressures
    return shown[0] + weight * (first - shown[0]), shown[1] + weight * (second - shown[1])


def plan_at(plans: Plans, time: float) -> Plan:
    """Plan for `time` [s]: linear interpolation between the plans, constant outside them.

    After the last plan it is that plan itself, with its own time.
    """
    later = plans[-1]
    if later.time <= time:
        return later
    for earlier in reversed(plans):
        if earlier.time <= time:
            span = later.time - earlier.time
            part = min((time - earlier.time) / span, 1.0) if span > 0.0 else 0.0
            (a, b), (next_a, next_b) = earlier.pressures, later.pressures
            return Plan(
                time,
                (a + part * (next_a - a), b + part * (next_b - b)),
                earlier.stiffness + part * (later.stiffness - earlier.stiffness),
                earlier.memory_torque + part * (later.memory_torque - earlier.memory_torque),
                earlier.known + part * (later.known - earlier.known),
            )
        later = earlier
    return later
