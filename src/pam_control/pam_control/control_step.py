"""Data of one control step: measurement, pressure plan of the control law, commands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pam_control.joint_channel import JointChannel, Pair
from pam_control.references.spline import JointReference
from pam_model.rig import Rig


@dataclass(slots=True)
class Measurement:
    """Measured values, in the rig's order.

    Attributes
    ----------
    positions : sequence of float
        Joint positions [rad].
    pressures : sequence of float
        Gauge pressures of the muscles [Pa].
    position_time, pressure_time : float
        Times of measurement [s].
    """

    positions: Sequence[float]
    pressures: Sequence[float]
    position_time: float
    pressure_time: float


@dataclass(frozen=True, slots=True)
class ControlOutput:
    """Result of one step.

    Attributes
    ----------
    commands : tuple of float or None
        One command per muscle of the rig: spool opening [-] or pressure [Pa], depending on the
        kind of valve; NaN for a muscle that belongs to no joint. None: send nothing.
    reason : str
        Why there are no commands; empty if there are.
    """

    commands: tuple[float, ...] | None
    reason: str = ""


@dataclass(slots=True)
class PlanRequest:
    """Input of a control law for the pressures of one joint.

    Attributes
    ----------
    index : int
        Index of the joint.
    channel : JointChannel
        Models and state of the joint.
    output : float
        Output of the PID.
    now, then : JointReference
        Reference at `now_at`, and at the time when the valve will act.
    measured_at, acts_at : float
        These times [s]; for valves with different delays, `acts_at` is that of the later valve.
    now_at : float
        Time at which the measured pressures were true [s]; `measured_at`, unless they were found to
        be late.
    side_acts_at : (float, float)
        Times when the agonist's and the antagonist's valve will act [s].
    side_velocities : (float, float)
        Reference velocity at these times [rad/s].
    step : float
        Time since the last cycle [s].
    seen : JointReference
        Reference at the time at which the position was measured.
    seen_at : float
        This time [s].
    fresh : float
        Time since the last new position [s]; 0 if it is not new.
    pressures : (float, float)
        Measured pressures [Pa].
    """

    index: int
    channel: JointChannel
    output: float
    now: JointReference
    then: JointReference
    measured_at: float
    acts_at: float
    now_at: float
    side_acts_at: Pair
    side_velocities: Pair
    step: float
    seen: JointReference
    seen_at: float
    fresh: float
    pressures: Pair


@dataclass(slots=True)
class PressurePlan:
    """Desired pressures of one joint, the input of its pressure loops.

    Attributes
    ----------
    reference : (float, float)
        Pressures for the time of measurement [Pa].
    rate : (float, float)
        Feedforward pressure rate at the time when the valve acts [Pa/s].
    ahead : (float, float)
        Feedforward pressure change from the measurement to that time [Pa].
    velocities : (float, float)
        Joint velocity for each muscle's dV/dt feedforward [rad/s].
    missed : float
        Reachable minus requested PID output, in its unit.
    """

    reference: Pair
    rate: Pair
    ahead: Pair
    velocities: Pair
    missed: float


def missing_measurement(
    time: float,
    measurement: Measurement,
    rig: Rig,
    channels: Sequence[JointChannel],
    oldest: float,
) -> str:
    """What of a measurement is missing or too old for a control step; empty if nothing is.

    Parameters
    ----------
    time : float
        Present time [s].
    measurement : Measurement
        The latest measurement.
    rig : Rig
        Gives the number of joints and muscles.
    channels : sequence of JointChannel
        All joints.
    oldest : float
        Largest age [s].
    """
    for what, count, values, stamp in (
        ("position", len(rig.joints), measurement.positions, measurement.position_time),
        ("pressure", len(rig.muscles), measurement.pressures, measurement.pressure_time),
    ):
        if len(values) != count:
            return f"no {what} measured yet" if not values else f"{len(values)} {what}s"
        age = time - stamp
        if not age <= oldest:
            return f"{what}s are {age * 1e3:.0f} ms old, limit {oldest * 1e3:.0f} ms"
    if all(map(math.isfinite, measurement.positions)) and all(
        map(math.isfinite, measurement.pressures)
    ):
        return ""
    for channel, position in zip(channels, measurement.positions, strict=True):
        if not math.isfinite(position):
            return f"position of {channel.joint.name} is not available"
        for muscle, index in zip(channel.muscles, channel.indices, strict=True):
            if not math.isfinite(measurement.pressures[index]):
                return f"pressure of {muscle.name} is not available"
    return ""
