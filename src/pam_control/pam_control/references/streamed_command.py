"""What is rejected of a streamed command before anything moves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from pam_control.references.trajectory import LARGEST, CommandError
from pam_ros.foreign_text import shown


def check_streamed_command(
    names: Sequence[str],
    positions: Sequence[float],
    velocities: Sequence[float],
    limits: Mapping[str, tuple[float, float]],
    max_velocities: Mapping[str, float],
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
    max_velocities : mapping of str to float
        Largest speed [rad/s] of a joint; by default any plausible speed.

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
        lower, upper = limits[name]
        position = positions[index]
        velocity = velocities[index] if len(velocities) else 0.0
        if not (math.isfinite(position) and math.isfinite(velocity)):
            raise CommandError(f"{what}: {name} at {position} rad, {velocity} rad/s")
        fastest = max_velocities.get(name, LARGEST["velocities"])
        if abs(velocity) > fastest:
            raise CommandError(
                f"{what}: {name} at {velocity:g} rad/s is above its max_velocity, {fastest:g} rad/s"
            )
        if not lower <= position <= upper:
            raise CommandError(
                f"{what}: {name} at {position:g} rad is outside its position_limits "
                f"[{lower:g}, {upper:g}] rad"
            )
