"""All numbers of a controller that a user may change, with their defaults."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pam_control.feedback.gain_schedule import GainSchedule
from pam_model.bounds import check_numbers

BY_SIZE = -1.0
"""A value that follows from the size of each joint; see `pam_control.joint_scale`."""

NARROWER: Mapping[str, tuple[float, float]] = {
    "period": (1e-4, 1.0),
    "spool_limit": (1e-3, 1.0),
    "sensitivity": (1.0, math.inf),
    "lead_ratio": (0.0, 1.0),
    "phase_margin": (0.0, math.pi),
}
"""Numbers for which more than their sign has a meaning."""
LOOP_FIELDS = (
    "period",
    "measurement_delay",
    "command_delay",
    "extra_delay",
    "safe_delay",
    "lead_ratio",
    "pressure_gain",
    "derivative_filter",
    "feedback_lead",
    "feedforward",
    "gains",
    "partial_gains",
    "phase_margin",
    "sensitivity",
    "mean_pressure",
    "observer",
    "observer_bandwidth",
    "stiffness_grid",
)


@dataclass(frozen=True, slots=True)
class ControlSettings:
    """Gains, limits and delays; a missing gain is designed from the rig.

    Values that are `BY_SIZE` follow from the size of each joint.

    Attributes
    ----------
    period : float
        Period of the control loop [s].
    measurement_delay : float
        Delay from the sensor's sample to its stamp [s].
    command_delay : float
        Delay from the controller to the valve [s].
    extra_delay : float
        Unknown delay that the gain design assumes in addition to the stated ones [s].
    lead_ratio : float
        Part of the valve's lag that is left uncompensated [-].
    pressure_gain : float or None
        Gain of the pressure loops [1/s]; None: designed.
    derivative_filter : float
        Time constant for measured velocities and for the PID's derivative [s].
    feedback_lead : float
        Share of the pressure loops' lag that the feedback makes up for [-].
    phase_margin, sensitivity : float
        Minimum phase margin [rad] and maximum sensitivity [-] of designed gains.
    gains : mapping of str to GainSchedule
        Gains by joint; those of other joints are designed.
    partial_gains : mapping
        By joint and gain ("proportional", ...): these values replace the designed ones.
    feedforward : bool
        Whether inverse dynamics and pressures are fed forward.
    integral_limit : float
        Limit of the PID's integral, in the unit of its output.
    default_stiffness : float
        Stiffness until one is commanded [N m/rad].
    stiffness_rate : float
        Maximum rate of the stiffness reference [N m/(rad s)].
    stiffness_corrected : bool
        Whether commands of the stiffness are corrected by the stiffness that was estimated.
    stiffness_grid : tuple of float
        Stiffnesses at which gains are designed and checked [N m/rad]; empty: by size.
    min_pressure : float
        Lowest desired pressure, so that no muscle becomes slack; fixed at the start [Pa].
    pressure_rate : float
        Maximum rate of a desired pressure [Pa/s].
    spool_limit : float
        Largest command to a flow valve [-].
    mean_pressure : float
        Mean pressure of the laws that command a pressure ratio or difference [Pa].
    difference_feedforward : mapping of str to tuple of float
        Coefficients of the pressure-difference law's feedforward by joint, in the order and units
        of `DifferenceFeedforward`; those of other joints follow from the rig.
    safe_delay : float
        Unknown delay for which the safe gains are designed [s].
    tracking_time : float
        How long a tracking error may be above the joint's limit [s].
    lowering_time : float
        Time in which ~/lower lets the air out [s].
    observer : bool
        Whether the model-based law compensates the torque that its model does not explain.
    observer_bandwidth : float
        Bandwidth of this observer [rad/s]; 0: designed.
    observer_limit : float
        Largest torque that it compensates [N m].
    adaptation : bool
        Whether the model-based law learns the torque that its model lacks, and how the flows of
        its valves differ from their data.
    adaptation_limit : float
        Largest torque that is learnt [N m].
    learning_motion : str
        Name under which the trajectories that follow are learnt as repetitions; empty: none are.
    learning_file : str
        File in which motions are kept; empty: in memory only.
    impedance_damping : float
        Damping of the impedance law [N m s/rad].
    float_hold_torque : float
        Torque below which a joint that is moved by hand stays where it is [N m].
    float_speed_limit : float
        Largest speed of its rest angle [rad/s].
    stale_after : float
        Age at which a measurement is stale [s].
    stream_timeout, stream_bandwidth : float
        Time-out [s] and filter bandwidth [rad/s] of streamed references.
    allow_nonzero_end_velocity : bool
        Accept trajectories that end with a velocity.

    Raises
    ------
    PamError
        For a number that is not finite, or has a sign or size without a meaning.
    """

    period: float = 0.002
    measurement_delay: float = 0.001
    command_delay: float = 0.003
    extra_delay: float = 0.01
    lead_ratio: float = 0.7
    pressure_gain: float | None = None
    derivative_filter: float = 0.01
    feedback_lead: float = 0.5
    phase_margin: float = math.radians(50.0)
    sensitivity: float = 1.6
    gains: Mapping[str, GainSchedule] = field(default_factory=dict)
    partial_gains: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    feedforward: bool = True
    integral_limit: float = BY_SIZE
    default_stiffness: float = BY_SIZE
    stiffness_rate: float = BY_SIZE
    stiffness_corrected: bool = False
    stiffness_grid: tuple[float, ...] = ()
    min_pressure: float = 5e3
    pressure_rate: float = 4e6
    spool_limit: float = 1.0
    mean_pressure: float = 2.3e5
    difference_feedforward: Mapping[str, tuple[float, float, float, float, float]] = field(
        default_factory=dict
    )
    safe_delay: float = 0.08
    tracking_time: float = 0.3
    lowering_time: float = 3.0
    observer: bool = False
    observer_bandwidth: float = 0.0
    observer_limit: float = BY_SIZE
    adaptation: bool = True
    adaptation_limit: float = BY_SIZE
    learning_motion: str = ""
    learning_file: str = ""
    impedance_damping: float = BY_SIZE
    float_hold_torque: float = BY_SIZE
    float_speed_limit: float = 0.5
    stale_after: float = 0.05
    stream_timeout: float = 0.2
    stream_bandwidth: float = 40.0
    allow_nonzero_end_velocity: bool = False

    def __post_init__(self) -> None:
        """Refuse numbers without a meaning; the node's parameters have narrower bounds."""
        bounds = {}
        for entry in dataclasses.fields(self):
            if entry.type in ("float", "float | None"):
                low = BY_SIZE if entry.default == BY_SIZE else 0.0
                bounds[entry.name] = (*NARROWER.get(entry.name, (low, math.inf)), "-")
        check_numbers(self, "ControlSettings", bounds)

    def replace(self, **changes: Any) -> ControlSettings:
        """Return a copy with other values."""
        return dataclasses.replace(self, **changes)

    def changes_loop(self, other: ControlSettings) -> bool:
        """Whether the linear loop, and so its margins, differs from that of `other`."""
        return any(getattr(self, name) != getattr(other, name) for name in LOOP_FIELDS)
