"""What is rejected of a streamed command before anything moves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from pam_control.references.trajectory import (
    LARGEST,
    START_MARGIN,
    CommandError,
    check_position,
    check_speed,
)
from pam_ros.foreign_text import shown


def check_streamed_command(
    names: Sequence[str],
    positions: Sequence[float],
    velocities: Sequence[float],
    limits: Mapping[str, tuple[float, float]],
    max_velocities: Mapping[str, float],
    measured: Mapping[str, float],
    start_margin: float = START_MARGIN,
) -> None:
    """Reject a streamed command that cannot be followed.

    A joint that rests at its end stop may be commanded to stay there, a little beyond its limits.

    Parameters
    ----------
    names : sequence of str
        Some or all joints of the rig, in any order.
    positions, velocities : sequence of float
        [rad], [rad/s]; velocities may be empty.
    limits : mapping of str to (float, float)
        Position limits [rad] of every joint of the rig.
    max_velocities : mapping of str to float
        Largest speed [rad/s] of a joint; by default any plausible speed.
    measured : mapping of str to float
        Where the joints are [rad], as far as that is known.
    start_margin : float, optional
        How far the driver permits a joint beyond its position limits [rad].

    Raises
    ------
    CommandError
        For an unknown or repeated joint, a wrong size, a number that is not finite, a velocity that
        the joint cannot have, or a position outside the limits.
    """
    what = "streamed command rejected"
    if not names or len(positions) != len(names) or len(velocities) not in (0, len(names)):
        raise CommandError(
            f"{what}: {len(names)} names, {len(positions)} positions, {len(velocities)} velocities"
        )
    if len(set(names)) != len(names):
        raise CommandError(f"{what}: a joint is named twice")
    for index, name in enumerate(names):
        if name not in limits:
            raise CommandError(f"{what}: unknown joint {shown(name)}; known: {', '.join(limits)}")
        position = positions[index]
        velocity = velocities[index] if len(velocities) else 0.0
        if not (math.isfinite(position) and math.isfinite(velocity)):
            raise CommandError(f"{what}: {name} at {position} rad, {velocity} rad/s")
        check_speed(what, name, velocity, max_velocities.get(name, LARGEST["velocities"]))
        place = measured.get(name, math.nan)
        margin = None if math.isnan(place) else start_margin
        check_position(what, name, position, limits[name], place, margin)
