"""All numbers of a controller that a user may change, whatever the control law; see `declared`."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pam_control.declared import (
    BY_SIZE,
    changes_loop,
    check_fields,
    declared,
    share_of_stiffness,
    share_of_torque,
    switch,
)
from pam_control.feedback.gain_schedule import GainSchedule

DESIGNED = -1.0
ADAPTS = ("model_based",)  # the laws that learn


@dataclass(frozen=True, slots=True)
class ControlSettings:
    """Gains, limits and delays; a missing gain is designed from the rig.

    Values that are `BY_SIZE` follow from the size of each joint. Times are in s, angles in rad,
    pressures in Pa. The parameters of a control law are fields of the law.

    Attributes
    ----------
    gains : mapping of str to GainSchedule
        Gains by joint; those of other joints are designed.
    partial_gains : mapping
        By joint and gain ("proportional", ...): these values replace the designed ones.
    stiffness_grid : tuple of float
        Stiffnesses at which gains are designed and checked [N m/rad]; empty: by size.

    Raises
    ------
    PamError
        For a number that is not finite, or has a sign or size without a meaning.
    """

    gains: Mapping[str, GainSchedule] = field(default_factory=dict)
    partial_gains: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    stiffness_grid: tuple[float, ...] = ()
    # fmt: off
    period: float = declared(
        "loop.rate", 500.0, "Hz", 50.0, 2000.0, "control cycle rate", fixed=True, loop=True,
        possible=(1e-4, 1.0), read=lambda rate: 1.0 / rate,
    )
    measurement_delay: float = declared(
        "loop.measurement_delay", 0.001, "s", 0.0, 0.1,
        "delay from a sensor's sample to its stamp", loop=True,
    )
    command_delay: float = declared(
        "loop.command_delay", 0.003, "s", 0.0, 0.1,
        "delay from the controller to the valve; 0.001 is the default in one process with the "
        "driver", loop=True,
    )
    stale_after: float = declared(
        "loop.stale_after", 0.05, "s", 0.002, 2.0,
        "age at which a measurement is stale and commands stop",
    )
    feedforward: bool = switch(
        "feedforward.enabled", True, "feedforward of inverse dynamics and pressures", loop=True,
    )
    extra_delay: float = declared(
        "design.extra_delay", 0.01, "s", 0.0, 0.1,
        "unknown delay of the loop that the gain design assumes in addition to the stated ones",
        loop=True,
    )
    safe_delay: float = declared(
        "design.safe_delay", 0.08, "s", 0.02, 0.3,
        "unknown delay for which the soft gains are designed, used after an oscillation",
        loop=True,
    )
    phase_margin: float = declared(
        "design.phase_margin", math.radians(50.0), "rad", 0.53, 1.4,
        "minimum phase margin of designed gains", loop=True, possible=(0.0, math.pi),
    )
    sensitivity: float = declared(
        "design.sensitivity", 1.6, "-", 1.1, 3.0, "maximum sensitivity |S| of designed gains",
        loop=True, possible=(1.0, math.inf),
    )
    tracking_time: float = declared(
        "guard.tracking_time", 0.3, "s", 0.02, 2.0,
        "how long a tracking error may be above the joint's max_tracking_error",
    )
    lowering_time: float = declared(
        "lowering.time", 3.0, "s", 0.2, 60.0,
        "time in which ~/lower lets the air out of the muscles",
    )
    pressure_gain: float | None = declared(
        "pressure_loop.gain", DESIGNED, "1/s", -1.0, 1000.0,
        "gain of the pressure loops; -1: designed", loop=True, possible=(0.0, math.inf),
        read=lambda gain: gain if gain > 0.0 else None,
    )
    lead_ratio: float = declared(
        "pressure_loop.lead_ratio", 0.7, "-", 0.1, 1.0,
        "part of the valve's lag that is left uncompensated", loop=True, possible=(0.0, 1.0),
    )
    min_pressure: float = declared(
        "pressure_loop.min_pressure", 5e3, "Pa", 0.0, 5e5,
        "lowest desired pressure of a muscle, so that none becomes slack", fixed=True,
    )
    pressure_rate: float = declared(
        "pressure_loop.rate_limit", 4e6, "Pa/s", 1e3, 1e8, "maximum rate of a desired pressure",
    )
    spool_limit: float = declared(
        "pressure_loop.spool_limit", 1.0, "-", 0.01, 1.0, "largest command to a flow valve",
        possible=(1e-3, 1.0),
    )
    derivative_filter: float = declared(
        "pid.derivative_filter", 0.01, "s", 1e-3, 0.2,
        "filter time constant of measured velocities and of the derivative", loop=True,
    )
    feedback_lead: float = declared(
        "pid.lead", 0.4, "-", 0.0, 1.0,
        "share of the pressure loops' lag for which the feedback makes up by a lead", loop=True,
        laws=("model_based", "torque" ),
    )
    motion_observer: float = declared(
        "pid.motion_observer", 160.0, "rad/s", 0.0, 1000.0,
        "bandwidth of the observer that gives the feedback speed and acceleration, from the "
        "position and from the torque of the muscles; 0: the position alone, filtered", loop=True,
        laws=ADAPTS,
    )
    integral_limit: float = declared(
        "pid.integral_limit", BY_SIZE, "N m", 0.0, 1e4,
        "maximum integral part (pressure_ratio_pid: of the ratio, no unit)",
        by_size=share_of_torque(0.33),
    )
    default_stiffness: float = declared(
        "stiffness.default", BY_SIZE, "N m/rad", 0.01, 1e5, "stiffness until one is commanded",
        by_size=share_of_stiffness(0.43),
    )
    stiffness_rate: float = declared(
        "stiffness.rate_limit", BY_SIZE, "N m/(rad s)", 0.01, 1e5,
        "maximum rate of the stiffness reference", by_size=share_of_stiffness(0.61, " in a second"
        ),
    )
    stiffness_corrected: bool = switch(
        "stiffness.corrected", False,
        "correct commands of the stiffness by what was learnt of the muscles' dimensions",
        laws=ADAPTS,
    )
    observer: bool = switch(
        "disturbance_observer.enabled", False,
        "compensate the torque that the model does not explain", loop=True, laws=ADAPTS,
    )
    observer_bandwidth: float = declared(
        "disturbance_observer.bandwidth", 0.0, "rad/s", 0.0, 500.0,
        "bandwidth of the disturbance observer; 0: designed", loop=True, laws=ADAPTS,
    )
    observer_limit: float = declared(
        "disturbance_observer.limit", BY_SIZE, "N m", 0.0, 1e4,
        "largest torque that the disturbance observer compensates", by_size=share_of_torque(0.16),
        laws=ADAPTS,
    )
    adaptation: bool = switch(
        "adaptation.enabled", True,
        "learn the torque that the model lacks and the true flows of the valves", laws=ADAPTS,
    )
    adaptation_limit: float = declared(
        "adaptation.limit", BY_SIZE, "N m", 0.0, 1e4, "largest torque that is learnt",
        by_size=share_of_torque(0.16), laws=ADAPTS,
    )
    learning_motion: str = switch(
        "learning.motion", "",
        "name under which the trajectories that follow are learnt as repetitions of one motion; "
        "empty: none are", laws=ADAPTS,
    )
    learning_file: str = switch(
        "learning.file", "",
        "file in files.folder in which learnt motions are kept; empty: in memory only",
        laws=ADAPTS,
    )
    stream_timeout: float = declared(
        "stream.timeout", 0.2, "s", 0.01, 10.0,
        "age of the last streamed command at which the joint holds its position",
    )
    stream_bandwidth: float = declared(
        "stream.bandwidth", 40.0, "rad/s", 1.0, 500.0,
        "bandwidth of the filter for streamed commands",
    )
    allow_nonzero_end_velocity: bool = switch(
        "trajectory.allow_nonzero_end_velocity", False, "accept trajectories that end in motion",
    )
    # fmt: on

    def __post_init__(self) -> None:
        """Refuse numbers without a meaning; the node's parameters have narrower bounds."""
        check_fields(self)

    def replace(self, **changes: Any) -> ControlSettings:
        """Return a copy with other values."""
        return dataclasses.replace(self, **changes)

    def changes_loop(self, other: ControlSettings) -> bool:
        """Whether the linear loop, and so its margins, differs from that of `other`."""
        return (
            self.gains != other.gains
            or self.partial_gains != other.partial_gains
            or self.stiffness_grid != other.stiffness_grid
            or changes_loop(self, other)
        )
