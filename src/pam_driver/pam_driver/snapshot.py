"""What one cycle of the driver has measured and sent, in the rig's order."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from pam_driver.board_set import BoardSet
from pam_driver.joint_velocity import JointVelocity
from pam_driver.safety.states import SafetyState


class Snapshot(NamedTuple):
    """The result of one cycle, in the rig's order."""

    state: SafetyState  # state after the cycle
    pressures: tuple[float, ...]  # by muscle [Pa gauge], NaN if not fresh
    pressure_stamp: float  # wall-clock time of the oldest of them [s], 0 if none is fresh
    # positions, velocities: by joint [rad], [rad/s], NaN if not fresh
    positions: tuple[float, ...]
    velocities: tuple[float, ...]
    joint_stamp: float  # wall-clock time of the oldest of them [s], 0 if none is fresh
    # command by muscle as fraction of full scale, including the command to vent; empty if the bus
    # did not accept it
    sent: tuple[float, ...] = ()
    # pressure_time, joint_time: the moments of both stamps on the monotonic clock [s]; infinite if
    # none is fresh
    pressure_time: float = math.inf
    joint_time: float = math.inf
    newest_stamp: float = 0.0  # wall-clock time of the newest of all [s], 0 if none is fresh


def take_snapshot(
    state: SafetyState, boards: BoardSet, filters: Sequence[JointVelocity], oldest: float
) -> Snapshot:
    """The measurements of the boards; what is missing or too old is NaN.

    Parameters
    ----------
    state : SafetyState
        The driver's state.
    boards : BoardSet
        The boards with their last measurements.
    filters : sequence of JointVelocity
        By joint.
    oldest : float
        A measurement from before this time is too old, monotonic [s].
    """
    pressures, pressure_stamps = [], []
    pressure_time = joint_time = math.inf
    for samples, channel in boards.pressures:
        sample = samples[channel]
        fresh = sample.time >= oldest
        pressures.append(sample.value if fresh else math.nan)
        if fresh:
            pressure_stamps.append(sample.stamp)
            pressure_time = min(pressure_time, sample.time)
    positions, velocities, joint_stamps = [], [], []
    for filtered, (samples, channel) in zip(filters, boards.angles, strict=True):
        sample = samples[channel]
        fresh = sample.time >= oldest
        positions.append(sample.value if fresh else math.nan)
        velocities.append(filtered.value if fresh else math.nan)
        if fresh:
            joint_stamps.append(sample.stamp)
            joint_time = min(joint_time, sample.time)
    return Snapshot(
        state,
        tuple(pressures),
        min(pressure_stamps, default=0.0),
        tuple(positions),
        tuple(velocities),
        min(joint_stamps, default=0.0),
        pressure_time=pressure_time,
        joint_time=joint_time,
        newest_stamp=max((*pressure_stamps, *joint_stamps), default=0.0),
    )
