"""The inverse of a joint of two muscles that pull affinely in pressure, as functions of floats.

A line is what a muscle does at one length: its weakest and strongest pull [N] in the range of its
pressures, scale [m^2] and passive pull [N], rise [m] and offset [N/m] of its dF/dL, and the range
[Pa gauge]. The scale is 0 if the muscle is too short to pull at any pressure. The torque is
constant along a straight line in the plane of the two pressures, and the stiffness is linear
along it. For a muscle that is not affine in pressure, the line is a local approximation.

numba compiles these functions with whatever calls them.
"""

from __future__ import annotations

from typing import Final

Line = tuple[float, float, float, float, float, float, float, float]
Point = tuple[float, float, float]
"""Pressure [Pa gauge], pull [N], dF/dL [N/m]."""
CLIPPED: Final = 1e-6
"""Difference of a torque that counts as limited, relative to the strongest."""
STIFFNESS_CLIPPED: Final = 1e-5


def affine_line(
    scale: float, passive: float, rise: float, offset: float, low: float, high: float
) -> Line:
    """The line of a muscle with these coefficients at its present length."""
    weakest, strongest = low * scale + passive, high * scale + passive
    weakest = weakest if weakest > 0.0 else 0.0
    strongest = strongest if strongest > 0.0 else 0.0
    if strongest <= weakest:
        # the choice of the pressure has no influence
        rate = low * rise + offset if weakest > 0.0 else 0.0
        return weakest, weakest, 0.0, weakest, 0.0, rate, low, high
    return weakest, strongest, scale, passive, rise, offset, low, high


def pressure_for(line: Line, force: float) -> float:
    """Pressure [Pa gauge] for a pull [N], limited to the range."""
    if line[2] <= 0.0:
        return line[6]
    pressure = (force - line[3]) / line[2]
    return line[6] if pressure < line[6] else min(pressure, line[7])


def stiffness_for(line: Line, force: float) -> float:
    """dF/dL [N/m] at a pull [N]."""
    if line[2] <= 0.0:
        return line[5]
    return (force - line[3]) / line[2] * line[4] + line[5]


def antagonist_pull(a: Line, b: Line, difference: float, rate: float) -> float:
    """Pull of the antagonist [N] at which the sum of stiffnesses is nearest to `rate` [N/m]."""
    least = max(b[0], a[0] - difference)
    most = max(least, min(b[1], a[1] - difference))
    at_least = stiffness_for(a, least + difference) + stiffness_for(b, least) - rate
    at_most = stiffness_for(a, most + difference) + stiffness_for(b, most) - rate
    if at_least * at_most >= 0.0:
        return least if abs(at_least) <= abs(at_most) else most
    return least - at_least * (most - least) / (at_most - at_least)


def through(line: Line, first: Point, second: Point) -> Line:
    """The line of the same muscle through two points of different pressure."""
    run = second[0] - first[0]
    scale = (second[1] - first[1]) / run
    if scale > 0.0:
        line = (*line[:2], scale, line[3], (second[2] - first[2]) / run, *line[5:])
    return shifted(line, second)


def shifted(line: Line, point: Point) -> Line:
    """The line through a point, with the slopes that it has."""
    weakest, strongest, scale, _, rise, _, low, high = line
    if scale <= 0.0:
        return line
    passive, offset = point[1] - scale * point[0], point[2] - rise * point[0]
    return weakest, strongest, scale, passive, rise, offset, low, high


def is_limited(
    strongest: float, missed_torque: float, missed: float, stiffness: float
) -> tuple[bool, bool]:
    """Whether a torque [N m], and a stiffness [N m/rad], is missed by more than rounding.

    `strongest` is the torque of all muscles if they pulled in one direction [N m].
    """
    return (
        abs(missed_torque) > CLIPPED * (1.0 + strongest),
        abs(missed) > STIFFNESS_CLIPPED * (1.0 + abs(stiffness)),
    )


def affine_pressures(
    a: Line, b: Line, radius: float, torque: float, stiffness: float
) -> tuple[float, float, float, float, bool, bool]:
    """The pressures for a torque [N m] and a stiffness [N m/rad].

    Returns
    -------
    agonist, antagonist : float
        [Pa gauge].
    torque, stiffness : float
        That are reached [N m], [N m/rad].
    torque_limited, stiffness_limited : bool
        Whether the request was outside the range; torque has priority over stiffness.
    """
    difference = min(max(torque / radius, a[0] - b[1]), a[1] - b[0])
    square = radius * radius
    pull = antagonist_pull(a, b, difference, stiffness / square)
    other = pull + difference
    reached = radius * difference
    stiff = square * (stiffness_for(a, other) + stiffness_for(b, pull))
    strongest = radius * (a[1] + b[1])
    cut, soft = is_limited(strongest, reached - torque, stiff - stiffness, stiffness)
    return pressure_for(a, other), pressure_for(b, pull), reached, stiff, cut, soft
