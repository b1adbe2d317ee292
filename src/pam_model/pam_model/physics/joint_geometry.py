"""Geometry of a joint between two muscles on one pulley.

The pull of the agonist turns the joint in the positive direction. The sign of the agonist is 1,
that of the antagonist -1. These functions of floats also accept arrays, element by element.

On a pulley that is round and runs true, the lever arm is its radius at every angle, and the cable
winds up by the radius times the angle. An eccentric or oval pulley has an arm that changes with the
angle. Near the middle position, such an arm is r (1 + s q + u q^2).
"""

from __future__ import annotations

from typing import Any, Final

AGONIST_SIGN: Final = 1.0
ANTAGONIST_SIGN: Final = -1.0
SIGNS: Final = (AGONIST_SIGN, ANTAGONIST_SIGN)
"""Signs of agonist and antagonist."""


def muscle_length(neutral_length: Any, sign: Any, pulley_radius: Any, position: Any) -> Any:
    """Length [m] of a muscle's path at a joint position [rad]."""
    return neutral_length - sign * pulley_radius * position


def length_per_position(sign: Any, pulley_radius: Any) -> Any:
    """Derivative of the path's length by the joint position [m/rad]; also dL/dt over speed."""
    return -sign * pulley_radius


def muscle_torque(sign: Any, pulley_radius: Any, pull: Any) -> Any:
    """Torque [N m] of a muscle's pull [N]."""
    return sign * pulley_radius * pull


def wound_angle(position: Any, arm_slope: Any, arm_bend: Any) -> Any:
    """Angle [rad] by which a round pulley would wind up as much cable.

    The integral of `relative_arm` over the position; `arm_slope` is in 1/rad, `arm_bend` in
    1/rad^2.
    """
    return position * (1.0 + position * (0.5 * arm_slope + position * arm_bend / 3.0))


def relative_arm(position: Any, arm_slope: Any, arm_bend: Any) -> Any:
    """Lever arm at a joint position [rad], in pulley radii."""
    return 1.0 + position * (arm_slope + position * arm_bend)
