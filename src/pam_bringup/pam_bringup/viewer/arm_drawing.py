"""The lines and colours by which the 3-D view shows joints and muscles, computed without a viewer.

As in the URDF of `pam_model urdf`, each joint is an axis along y with a rod, 0.2 m from the last
joint. The two muscles stand above it. Each pulls its side of the pulley by a tendon; the
agonist's side is the one whose upward pull gives positive torque.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from pam_model.robot import Robot
from pam_model.views.equivalent_rod import EquivalentRod
from pam_model.views.gravity import hanging_position
from pam_model.views.muscle_path import path_length

Point = tuple[float, float, float]

SPACING = 0.2  # m, between joints, as in the URDF
TENDON = 0.05  # m, of the longest muscle's tendon at position 0
_EMPTY = (120, 130, 140)
_FULL = (220, 50, 40)


@dataclass(frozen=True, slots=True)
class Stroke:
    """A line with a thickness."""

    name: str  # what it shows, for example `elbow/elbow_flexor`
    points: tuple[Point, ...]  # its corners [m]
    radius: float  # half of its thickness [m]
    colour: tuple[int, int, int]  # red, green and blue, 0 to 255


def eye_of(robot: Robot) -> tuple[Point, Point]:
    """Where the eye stands so that it sees the whole robot, and the point at which it looks [m]."""
    places = range(len(robot.joints))
    points = [p for k in places for s in arm_strokes(robot, k, 0.0, {}) for p in s.points]
    low, high = ([choose(axis) for axis in zip(*points, strict=True)] for choose in (min, max))
    middle = (0.0, 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2]))
    distance = 1.2 * max(high[2] - low[2], high[1] - low[1])
    side = (
        0.3 if len(robot.joints) == 1 else 1.0
    )  # joints one behind the other are seen from a side
    return (side * distance, low[1] - distance, middle[2] + 0.2 * distance), middle


def pressure_colour(share: float) -> tuple[int, int, int]:
    """Colour of a muscle; `share` is its pressure over its highest pressure, NaN if unknown."""
    share = 0.0 if math.isnan(share) else min(max(share, 0.0), 1.0)
    red, green, blue = (
        round(low + share * (high - low)) for low, high in zip(_EMPTY, _FULL, strict=True)
    )
    return red, green, blue


def arm_strokes(
    robot: Robot, joint: int, position: float, pressures: dict[str, float]
) -> list[Stroke]:
    """The rod, the tendons and the muscles of a joint.

    Parameters
    ----------
    joint : int
        Place of the joint in the rig file.
    position : float
        [rad].
    pressures : mapping of str to float
        Gauge pressure by muscle [Pa]; a missing one is drawn as empty.
    """
    entry, y = robot.joints[joint], SPACING * joint
    rod = EquivalentRod.of(entry)
    angle = position - hanging_position(entry)
    down = (-math.sin(angle), 0.0, -math.cos(angle))
    reach = max(rod.length, 0.15)
    end = (reach * down[0], y, reach * down[2])
    strokes = [Stroke(f"{entry.name}/link", ((0.0, y, 0.0), end), 0.012, (70, 90, 160))]
    positions = [0.0] * len(robot.joints)
    top = TENDON + max(path_length(robot.muscles[place], positions) for place in entry.muscles)
    positions[joint] = position
    for arm in entry.arms:
        muscle = robot.muscles[arm.muscle]
        name, braid = muscle.name, muscle.geometry
        length = path_length(muscle, positions)
        inside = max(braid.thread_length**2 - length**2, 0.0)
        half_width = 0.5 * math.sqrt(inside) / (braid.turns * math.pi)
        x = -arm.length
        share = pressures.get(name, math.nan) / muscle.max_pressure
        lower = (x, y, top - length)
        strokes.append(
            Stroke(
                f"{entry.name}/{name}",
                ((x, y, top), lower),
                max(half_width, 0.004),
                pressure_colour(share),
            )
        )
        tendon = (lower, (x, y, 0.0))
        strokes.append(Stroke(f"{entry.name}/{name}_tendon", tendon, 0.002, (90, 90, 90)))
    return strokes
