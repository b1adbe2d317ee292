"""Data of one control step: measurement, what a control law gets and returns, commands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import compress
from operator import attrgetter
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pam_control.feedback.pid import PidGains
from pam_control.joint_models import JointModels, PerMuscle
from pam_control.learning.motion_learner import MotionLearner
from pam_control.references.motion_limiter import MotionLimits
from pam_control.references.spline import JointReference
from pam_control.rows.telemetry_rows import (
    Z_DRIVEN,
    Z_ERROR,
    Z_POSITION,
    Z_PRESSURES,
    Z_RATE_CUT,
    Z_REFERENCE,
    Z_TORQUE,
    Z_TORQUE_CUT,
    Z_TUBES,
    Z_UNEXPLAINED,
    Z_YIELDS,
)
from pam_control.settings import ControlSettings
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


class MeasuredMotion(NamedTuple):
    """Measured motion of one joint.

    Attributes
    ----------
    position : float
        [rad]; NaN before the first measurement.
    velocity : float
        Filtered [rad/s].
    time : float
        Of the measurement [s].
    """

    position: float = math.nan
    velocity: float = 0.0
    time: float = math.nan

    def measured(self, position: float, time: float, velocity_filter: float) -> MeasuredMotion:
        """The motion with a new position [rad]; the same if it is not newer."""
        if math.isnan(self.time):
            return MeasuredMotion(position, self.velocity, time)
        step = time - self.time
        if step <= 0.0:
            return self
        weight = step / (velocity_filter + step)
        velocity = self.velocity + weight * ((position - self.position) / step - self.velocity)
        return MeasuredMotion(position, velocity, time)


class Moment(NamedTuple):
    """A time [s], and the reference at that time."""

    time: float
    reference: JointReference

    @classmethod
    def at(cls, row: Sequence[float], place: int) -> Moment:
        """The moment that begins at a place of a row: the time, then the reference."""
        return cls(row[place], JointReference(*row[place + 1 : place + 4]))

    @property
    def row(self) -> PerMuscle:
        """As in a row."""
        at = self.reference
        return self.time, at.position, at.velocity, at.acceleration


@dataclass(slots=True)
class PlanRequest:
    """Input of a control law for the pressures of one joint.

    Attributes
    ----------
    step : float
        Time since the last cycle [s].
    settings : ControlSettings
        Complete for this joint.
    gains : PidGains
        Of the feedback.
    output, integral : float
        Of the feedback; the integral may be changed by the law (`PressurePlan.integral`).
    stiffness : float
        Commanded [N m/rad].
    torque : float or None
        Commanded [N m]; None if no torque is commanded.
    motion : MeasuredMotion
        Measured.
    fresh : float
        Time since the last new position [s]; 0 if it is not new.
    pressures, desired : tuple of float
        Measured, and desired until now [Pa].
    measured_at : float
        When the pressures were measured [s].
    seen : Moment
        When the position was measured.
    now : Moment
        When the measured pressures were true; `measured_at`, unless they were found to be late.
    acts : tuple of Moment
        When the valve of each muscle will act.
    limits : MotionLimits
        Which the reference keeps.
    adapts : bool
        Whether what was learnt is used.
    learner : MotionLearner or None
        Of a motion that is repeated.
    """

    step: float
    settings: ControlSettings
    gains: PidGains
    output: float
    integral: float
    stiffness: float
    torque: float | None
    motion: MeasuredMotion
    fresh: float
    pressures: PerMuscle
    desired: PerMuscle
    measured_at: float
    seen: Moment
    now: Moment
    acts: tuple[Moment, ...]
    limits: MotionLimits
    adapts: bool
    learner: MotionLearner | None

    @property
    def then(self) -> Moment:
        """When the last valve will act."""
        return max(self.acts, key=attrgetter("time"))

    @property
    def side_velocities(self) -> PerMuscle:
        """Velocity of the reference when each valve will act [rad/s]."""
        return tuple(moment.reference.velocity for moment in self.acts)


class LawTelemetry(NamedTuple):
    """What a control law says about its plan.

    Attributes
    ----------
    torque, stiffness : float
        Desired values [N m], [N m/rad].
    torque_reached, stiffness_reached : float
        Values that the desired pressures give by the model [N m], [N m/rad].
    true_stiffness : float
        The stiffness that is reached, as far as the law knows better than the model [N m/rad].
    disturbance : float
        Torque on the joint that its model does not explain [N m], observed or learnt; NaN if
        neither is asked for.
    clipped : tuple of str
        What was limited: "torque", "stiffness".
    yields : bool
        Whether the law lets others move the joint: then an error is no fault.
    driven : bool
        Whether the joint is moved by torques, so that it has no reference.
    """

    torque: float = math.nan
    stiffness: float = math.nan
    torque_reached: float = math.nan
    stiffness_reached: float = math.nan
    true_stiffness: float = math.nan
    disturbance: float = math.nan
    clipped: tuple[str, ...] = ()
    yields: bool = False
    driven: bool = False


@dataclass(slots=True)
class PressurePlan:
    """Desired pressures of one joint, the input of its pressure loops.

    Attributes
    ----------
    reference : tuple of float
        PerMuscle for the time of measurement [Pa].
    rate : tuple of float
        Feedforward pressure rate at the time when the valve acts [Pa/s].
    ahead : tuple of float
        Feedforward pressure change from the measurement to that time [Pa].
    velocities : tuple of float
        Joint velocity for each muscle's dV/dt feedforward [rad/s].
    missed : float
        Reachable minus requested PID output, in its unit.
    integral : float
        Of the PID from now on, in the unit of its output.
    telemetry : LawTelemetry
        What the plan is meant to give.
    """

    reference: PerMuscle
    rate: PerMuscle
    ahead: PerMuscle
    velocities: PerMuscle
    missed: float
    integral: float
    telemetry: LawTelemetry


LAW_LIMITS, LOOP_LIMITS = ("torque", "stiffness"), ("pressure_rate", "valve")
"""What may be limited by the law and by the loop, in the order of `telemetry_rows`."""


class JointTelemetry(NamedTuple):
    """Telemetry of one joint from the last control step.

    Attributes
    ----------
    reference : JointReference
        Reference at the time of measurement.
    motion : MeasuredMotion
        Measured.
    error : float
        Reference minus measured position [rad].
    pressures : tuple of float
        Desired gauge pressures [Pa].
    clipped : tuple of str
        What was limited: "torque", "stiffness", "pressure_rate", "valve".
    behind_tube : int
        Number of muscles that were found to be behind a tube.
    law : LawTelemetry
        What the control law says.
    unexplained : float
        Torque of the muscles beside that of the model at the measured motion, with that of the
        inertia [N m]; NaN if it is not computed.
    """

    reference: JointReference = JointReference(math.nan)
    motion: MeasuredMotion = MeasuredMotion()
    error: float = math.nan
    pressures: PerMuscle = (math.nan, math.nan)
    clipped: tuple[str, ...] = ()
    behind_tube: int = 0
    law: LawTelemetry = LawTelemetry()
    unexplained: float = math.nan

    @classmethod
    def of(cls, row: Sequence[float]) -> JointTelemetry:
        """The telemetry of a row (`telemetry_rows`) of Python's own numbers."""
        by_law, by_loop = row[Z_TORQUE_CUT:Z_RATE_CUT], row[Z_RATE_CUT:Z_TUBES]
        torque, stiffness, reached, stiff, true, beside = row[Z_TORQUE:Z_UNEXPLAINED]
        clipped = tuple(compress(LAW_LIMITS, by_law))
        yields, driven = row[Z_YIELDS] > 0.0, row[Z_DRIVEN] > 0.0
        return cls(
            JointReference(*row[Z_REFERENCE:Z_POSITION]),
            MeasuredMotion(*row[Z_POSITION:Z_ERROR]),
            row[Z_ERROR],
            tuple(row[Z_PRESSURES:]),
            clipped + tuple(compress(LOOP_LIMITS, by_loop)),
            int(row[Z_TUBES]),
            LawTelemetry(torque, stiffness, reached, stiff, true, beside, clipped, yields, driven),
            row[Z_UNEXPLAINED],
        )

    @property
    def torque(self) -> float:
        """Desired torque [N m]."""
        return self.law.torque

    @property
    def stiffness(self) -> float:
        """Desired stiffness [N m/rad]."""
        return self.law.stiffness

    @property
    def torque_reached(self) -> float:
        """Torque that the desired pressures give [N m]."""
        return self.law.torque_reached

    @property
    def stiffness_reached(self) -> float:
        """Stiffness that the desired pressures give [N m/rad]."""
        return self.law.stiffness_reached

    @property
    def disturbance(self) -> float:
        """Torque on the joint that its model does not explain [N m]; NaN if not asked for."""
        return self.law.disturbance


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
    rows : array or None
        The telemetry of all joints (`telemetry_rows`); None without commands.
    """

    commands: PerMuscle | None
    reason: str = ""
    rows: npt.NDArray[np.float64] | None = field(default=None, repr=False, compare=False)

    @property
    def joints(self) -> tuple[JointTelemetry, ...]:
        """The telemetry of each joint; empty without commands."""
        return () if self.rows is None else tuple(map(JointTelemetry.of, self.rows.tolist()))


def missing_measurement(
    time: float,
    measurement: Measurement,
    rig: Rig,
    joints: Sequence[JointModels],
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
    joints : sequence of JointModels
        All joints.
    oldest : float
        Largest age [s].
    """
    positions, pressures = measurement.positions, measurement.pressures
    if (  # a quick look; words only where something is wrong
        len(positions) == len(rig.joints)
        and len(pressures) == len(rig.muscles)
        and time - measurement.position_time <= oldest
        and time - measurement.pressure_time <= oldest
        and math.isfinite(sum(positions) + sum(pressures))
    ):
        return ""
    for what, count, values, stamp in (
        ("position", len(rig.joints), positions, measurement.position_time),
        ("pressure", len(rig.muscles), pressures, measurement.pressure_time),
    ):
        if len(values) != count:
            return f"no {what} measured yet" if not values else f"{len(values)} {what}s"
        age = time - stamp
        if not age <= oldest:
            return f"{what}s are {age * 1e3:.0f} ms old, limit {oldest * 1e3:.0f} ms"
    for models, position in zip(joints, positions, strict=True):
        if not math.isfinite(position):
            return f"position of {models.name} is not available"
        for muscle, index in zip(models.muscles, models.joint.muscles, strict=True):
            if not math.isfinite(pressures[index]):
                return f"pressure of {muscle.name} is not available"
    return ""
