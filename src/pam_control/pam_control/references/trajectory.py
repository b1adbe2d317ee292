"""Joint trajectories as they arrive in messages, and what is rejected before anything moves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pam_model.errors import PamError
from pam_model.rig import Plausibility
from pam_model.within_limits import beyond, is_at_joint, within
from pam_ros.foreign_text import shown

# [rad/s], [rad/s^2]: no joint moves so fast, and larger numbers would overflow a spline.
LARGEST = {"velocities": 100.0, "accelerations": 1e5}
DEFAULT_END_SPEED = 1e-3
START_MARGIN = Plausibility().position_margin  # rad; a rig file may state another one
LATEST_START = 60.0  # s after its arrival; a joint must not move by itself when nobody expects it


class CommandError(PamError):
    """A command that is rejected as a whole; the message names the wrong part and the reason."""


class JointNameError(CommandError):
    """A trajectory for a joint that is unknown, or that it names twice."""


class PastTrajectoryError(CommandError):
    """A trajectory that has ended before it arrived."""


@dataclass(frozen=True, slots=True)
class TrajectoryPoint:
    """One point of a message; each field is empty or has one value per joint name."""

    time_from_start: float
    positions: Sequence[float]
    velocities: Sequence[float] = ()
    accelerations: Sequence[float] = ()


def check_trajectory(
    names: Sequence[str],
    points: Sequence[TrajectoryPoint],
    limits: Mapping[str, tuple[float, float]],
    *,
    max_velocities: Mapping[str, float] | None = None,
    allow_nonzero_end_velocity: bool = False,
    measured: Mapping[str, float] | None = None,
    start_margin: float = START_MARGIN,
) -> None:
    """Reject a trajectory that cannot be followed.

    A planner begins where the joint is, and a joint at its stop may be a little beyond its limits:
    the first of several points may be there, too, and further ones on the way back.

    Parameters
    ----------
    names : sequence of str
        The message's joint names; a subset of the rig's joints, in any order.
    points : sequence of TrajectoryPoint
        Not empty.
    limits : mapping of str to (float, float)
        Position limits [rad] of every joint of the rig.
    max_velocities : mapping of str to float, optional
        Largest speed [rad/s] of every joint of the rig; by default any plausible speed.
    allow_nonzero_end_velocity : bool, optional
        Accept a last point with a velocity; the reference then brakes beyond it.
    measured : mapping of str to float, optional
        Where the joints are [rad], as far as that is known.
    start_margin : float, optional
        How far the driver permits a joint beyond its position limits [rad].

    Raises
    ------
    CommandError
        For an unknown, repeated or missing joint name, a field of the wrong size, a number that
        is not finite, times that do not increase, a position outside the limits, or a velocity
        that the joint cannot have.
    """
    if not names:
        raise JointNameError("trajectory rejected: it names no joint")
    for name in names:
        if name not in limits:
            known = ", ".join(limits)
            raise JointNameError(
                f"trajectory rejected: unknown joint {shown(name)}; known: {known}"
            )
    if len(set(names)) != len(names):
        raise JointNameError("trajectory rejected: a joint is named twice")
    previous = -math.inf
    for number, point in enumerate(points):
        where = f"trajectory rejected: point {number}"
        if not math.isfinite(point.time_from_start) or point.time_from_start < 0.0:
            raise CommandError(f"{where}: time_from_start = {point.time_from_start} s")
        if point.time_from_start <= previous:
            raise CommandError(
                f"{where}: time_from_start = {point.time_from_start:g} s is not later than "
                f"the point before, {previous:g} s"
            )
        previous = point.time_from_start
        _check_point(where, names, point, max_velocities or {})
        margin = start_margin if number == 0 and len(points) > 1 else None
        before = points[number - 1].positions if 0 < number < len(points) - 1 else point.positions
        for name, position, last in zip(names, point.positions, before, strict=True):
            low, high = limits[name]
            if last < position < low or high < position < last:
                continue  # on the way back from where the joint is
            check_position(where, name, position, limits[name], (measured or {}).get(name), margin)
    if not allow_nonzero_end_velocity:
        for name, velocity in zip(names, points[-1].velocities, strict=False):
            if abs(velocity) > DEFAULT_END_SPEED:
                raise CommandError(
                    f"trajectory rejected: {name} still moves at {velocity:g} rad/s at its end"
                )


def _check_point(
    where: str,
    names: Sequence[str],
    point: TrajectoryPoint,
    max_velocities: Mapping[str, float],
) -> None:
    fields = (
        ("positions", point.positions, True),
        ("velocities", point.velocities, False),
        ("accelerations", point.accelerations, False),
    )
    for field, values, needed in fields:
        if len(values) != len(names) and (needed or len(values) > 0):
            raise CommandError(f"{where}: {len(values)} {field} for {len(names)} joints")
        for name, value in zip(names, values, strict=False):
            if not math.isfinite(value):
                raise CommandError(f"{where}: {field} of {name} is {value}")
            if field != "positions" and abs(value) > LARGEST[field]:
                raise CommandError(
                    f"{where}: {field} of {name} is {value:g}, expected {LARGEST[field]:g} at most"
                )
    for name, value in zip(names, point.velocities, strict=False):
        check_speed(where, name, value, max_velocities.get(name, math.inf))
    if len(point.accelerations) > 0 and len(point.velocities) == 0:
        raise CommandError(f"{where}: accelerations without velocities")


def check_speed(where: str, name: str, velocity: float, fastest: float) -> None:
    """Reject a velocity [rad/s] above the joint's `fastest`.

    Raises
    ------
    CommandError
        The text begins with `where`.
    """
    if not within(velocity, -fastest, fastest):
        told, _, most = beyond(velocity, -fastest, fastest)
        raise CommandError(
            f"{where}: {name} at {told} rad/s is above its max_velocity, {most} rad/s"
        )


def check_position(
    where: str,
    name: str,
    position: float,
    limits: tuple[float, float],
    measured: float | None,
    start_margin: float | None,
) -> None:
    """Reject a position [rad] outside of the joint's limits.

    Parameters
    ----------
    where, name : str
        What begins the message, and the joint.
    position : float
        [rad].
    limits : (float, float)
        [rad].
    measured : float or None
        Where the joint is [rad], if that is known.
    start_margin : float or None
        How far beyond the limits the command may be if the joint is there, too [rad]; None: it may
        not.

    Raises
    ------
    CommandError
        The text begins with `where`.
    """
    if within(position, *limits):
        return
    if start_margin is not None and is_at_joint(position, measured, *limits, start_margin):
        return
    told, lower, upper = beyond(position, *limits)
    raise CommandError(
        f"{where}: {name} at {told} rad is outside its position_limits [{lower}, {upper}] rad"
    )
