"""Geometry of a joint between two muscles on one pulley.

The agonist's pull turns the joint in the positive direction and shortens the agonist: its sign is
1, the antagonist's -1. Functions of floats, which also work on arrays element by element.
"""

from __future__ import annotations

from typing import Any, Final

AGONIST_SIGN: Final = 1.0
ANTAGONIST_SIGN: Final = -1.0
SIGNS: Final = (AGONIST_SIGN, ANTAGONIST_SIGN)
"""Of agonist and antagonist."""


def muscle_length(neutral_length: Any, sign: Any, pulley_radius: Any, position: Any) -> Any:
    """Length [m] of the path of a muscle at a joint position [rad]."""
    return neutral_length - sign * pulley_radius * position


def length_per_position(sign: Any, pulley_radius: Any) -> Any:
    """Change of the path's length with the joint position [m/rad]; also dL/dt over speed."""
    return -sign * pulley_radius


def muscle_torque(sign: Any, pulley_radius: Any, pull: Any) -> Any:
    """Torque [N m] of a muscle's pull [N]."""
    return sign * pulley_radius * pull
