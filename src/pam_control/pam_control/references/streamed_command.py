"""What is rejected of a streamed command before anything moves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from pam_control.references.trajectory import LARGEST, CommandError


def check_streamed_command(
    names: Sequence[str],
    positions: Sequence[float],
    velocities: Sequence[float],
    limits: Mapping[str, tuple[float, float]],
) -> None:
    """Reject a streamed command that cannot be followed.

    Parameters
    ----------
    names : sequence of str
        Some or all joints of the rig, in any order.
    positions, velocities : sequence of float
        [rad], [rad/s]; velocities may be empty.
    limits : mapping of str to (float, float)
        Position limits [rad] of every joint of the rig.

    Raises
    ------
    CommandError
        For an unknown or repeated joint, a wrong size, a number that is not finite, a velocity that
        no joint can have, or a position outside the limits.
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
            raise CommandError(f"{what}: unknown joint {name!r}; known: {', '.join(limits)}")
        lower, upper = limits[name]
        position = positions[index]
        velocity = velocities[index] if len(velocities) else 0.0
        if not (math.isfinite(position) and math.isfinite(velocity)):
            raise CommandError(f"{what}: {name} at {position} rad, {velocity} rad/s")
        if abs(velocity) > LARGEST["velocities"]:
            raise CommandError(
                f"{what}: {name} at {velocity:g} rad/s, expected "
                f"{LARGEST['velocities']:g} rad/s at most"
            )
        if not lower <= position <= upper:
            raise CommandError(
                f"{what}: {name} at {position:g} rad is outside its position_limits "
                f"[{lower:g}, {upper:g}] rad"
            )
