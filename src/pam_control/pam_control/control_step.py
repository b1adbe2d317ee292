"""What passes through one control step: measurement, a law's plan, commands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pam_control.joint_channel import JointChannel, Pair
from pam_control.references.trajectory import JointReference


@dataclass(frozen=True, slots=True)
class Measurement:
    """What the sensors said, in the rig's order.

    Attributes
    ----------
    positions : sequence of float
        Of the joints [rad].
    pressures : sequence of float
        Of the muscles, gauge [Pa].
    position_time, pressure_time : float
        When they were measured [s].
    """

    positions: Sequence[float]
    pressures: Sequence[float]
    position_time: float
    pressure_time: float


@dataclass(frozen=True, slots=True)
class ControlOutput:
    """What one step gives.

    Attributes
    ----------
    commands : tuple of float or None
        One per muscle of the rig, spool [-] or [Pa] by valve kind, NaN for a muscle of no joint;
        None: send nothing, `reason` says why.
    reason : str
        Empty while commands are given.
    """

    commands: tuple[float, ...] | None
    reason: str = ""


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """What a law gets to plan one joint's pressures from.

    Attributes
    ----------
    index : int
        Of the joint.
    channel : JointChannel
        Of the joint.
    output : float
        Of the PID.
    now, then : JointReference
        Reference at the time of measurement, and at the time the valve will act.
    measured_at, acts_at : float
        Those times [s]; with valves of unequal delay the later one's.
    side_acts_at : (float, float)
        When the agonist's and the antagonist's valve will act [s].
    side_velocities : (float, float)
        Of the reference at those times [rad/s].
    step : float
        Since the last cycle [s].
    """

    index: int
    channel: JointChannel
    output: float
    now: JointReference
    then: JointReference
    measured_at: float
    acts_at: float
    side_acts_at: Pair
    side_velocities: Pair
    step: float


@dataclass(frozen=True, slots=True)
class PressurePlan:
    """What a law asks of the pressure loops of one joint.

    Attributes
    ----------
    reference : (float, float)
        Pressures for the time of measurement [Pa].
    rate : (float, float)
        Their feedforward rate at the time of action [Pa/s].
    ahead : (float, float)
        Their feedforward change from measurement to action [Pa].
    velocities : (float, float)
        Joint velocity for each muscle's dV/dt feedforward [rad/s].
    missed : float
        Reached less asked output of the PID, in its unit.
    """

    reference: Pair
    rate: Pair
    ahead: Pair
    velocities: Pair
    missed: float
