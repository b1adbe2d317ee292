"""Geometry of a joint between two muscles on one pulley.

The pull of the agonist turns the joint in the positive direction. The sign of the agonist is 1,
that of the antagonist -1. These functions of floats also accept arrays, element by element.
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
