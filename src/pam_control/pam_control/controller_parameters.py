"""The controller node's parameters (names, units, ranges, texts), and the settings made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from pam_control.actions.goal_tolerances import tolerance_parameters
from pam_control.controller import Controller
from pam_control.feedback.kept_designs import KeptDesigns
from pam_control.feedback.pid import PidGains
from pam_control.kept_files import file_inside, kept_folder
from pam_control.laws.gravity_compensation import GravityCompensation
from pam_control.laws.impedance import ImpedanceController
from pam_control.laws.position_stiffness import PositionStiffnessController
from pam_control.laws.pressure_difference_pid import PressureDifferencePid
from pam_control.laws.pressure_ratio_pid import PressureRatioPid
from pam_control.laws.torque import TorqueController
from pam_control.settings import BY_SIZE, ControlSettings
from pam_model.errors import PamError
from pam_model.rig import Rig
from pam_ros.node_help import Endpoint, NodeHelp
from pam_ros.parameters import Parameter, Value
from pam_ros.program_name import PROGRAM

DESIGNED = -1.0
_SIZE = "-1: by the size of each joint"
LEAST_BESIDE_SIZE: Mapping[str, float] = {
    "design.least_stiffness": 0.01,
    "design.greatest_stiffness": 0.01,
    "stiffness.default": 0.01,
    "stiffness.rate_limit": 0.01,
    "pid.integral_limit": 0.0,
    "disturbance_observer.limit": 0.0,
    "adaptation.limit": 0.0,
    "impedance.damping": 0.0,
    "float.hold_torque": 0.001,
}
"""Least value of each parameter that may also be -1."""
LAWS: Mapping[str, type[Controller]] = {
    "model_based": PositionStiffnessController,
    "pressure_ratio_pid": PressureRatioPid,
    "pressure_difference_pid": PressureDifferencePid,
    "impedance": ImpedanceController,
    "torque": TorqueController,
    "gravity_compensation": GravityCompensation,
}
LAW_NAMES = f"{', '.join(list(LAWS)[:-1])} or {list(LAWS)[-1]}"
_DEFAULT = ControlSettings()
COMMAND_DELAY: Final = _DEFAULT.command_delay
"""From the controller to the valve over topics [s]."""


def _number(*columns: Any, fixed: bool = False) -> Parameter:
    """A parameter from the columns name, default, unit, low, high and text."""
    name, default, unit, low, high, text = columns
    return Parameter(name, default, unit, low, high, text, changeable=not fixed)


def parameter_table(
    joint_names: Sequence[str], command_delay: float = COMMAND_DELAY
) -> list[Parameter]:
    """All parameters of the node except those of the rig.

    Parameters
    ----------
    joint_names : sequence of str
        Names of the joints; each joint has its own gains.
    command_delay : float, optional
        Default of `loop.command_delay` [s].
    """
    d = _DEFAULT
    table = [
        Parameter("law", "model_based", "-", 0, 0, f"control law: {LAW_NAMES}"),
        _number("loop.rate", 1.0 / d.period, "Hz", 50.0, 2000.0, "control cycle rate", fixed=True),
        _number(
            "loop.realtime_priority", 0, "-", 0, 99,
            "priority of the control thread (SCHED_FIFO) if the system permits it; 0: normal",
            fixed=True,
        ),
        Parameter(
            "loop.align", False, "-", 0, 0,
            "shift the cycles so that they begin shortly after pressure_states arrives",
        ),
        _number(
            "loop.measurement_delay", d.measurement_delay, "s", 0.0, 0.1,
            "delay from a sensor's sample to its stamp",
        ),
        _number(
            "loop.command_delay", command_delay, "s", 0.0, 0.1,
            "delay from the controller to the valve; the default is 0.001 in one process with the "
            "driver",
        ),
        _number(
            "loop.stale_after", d.stale_after, "s", 0.002, 2.0,
            "age at which a measurement is stale and commands stop",
        ),
        _number(
            "telemetry.rate", 100.0, "Hz", 1.0, 2000.0,
            "rate of ~/reference, ~/error and ~/disturbance", fixed=True,
        ),
        Parameter(
            "feedforward.enabled", d.feedforward, "-", 0, 0,
            "feedforward of inverse dynamics and pressures", changeable=True,
        ),
        _number(
            "design.extra_delay", d.extra_delay, "s", 0.0, 0.1,
            "unknown delay of the loop that the gain design assumes in addition to the stated ones",
        ),
        _number(
            "design.safe_delay", d.safe_delay, "s", 0.02, 0.3,
            "unknown delay for which the soft gains are designed, used after an oscillation",
        ),
        _number(
            "guard.tracking_time", d.tracking_time, "s", 0.02, 2.0,
            "how long a tracking error may be above the joint's max_tracking_error",
        ),
        _number(
            "lowering.time", d.lowering_time, "s", 0.2, 60.0,
            "time in which ~/lower lets the air out of the muscles",
        ),
        _number(
            "design.phase_margin", d.phase_margin, "rad", 0.53, 1.4,
            "minimum phase margin of designed gains",
        ),
        _number(
            "design.sensitivity", d.sensitivity, "-", 1.1, 3.0,
            "maximum sensitivity |S| of designed gains",
        ),
        _number(
            "design.least_stiffness", BY_SIZE, "N m/rad", BY_SIZE, 1e5,
            f"lowest stiffness for which gains are designed and checked; {_SIZE}",
        ),
        _number(
            "design.greatest_stiffness", BY_SIZE, "N m/rad", BY_SIZE, 1e5,
            f"highest stiffness for which gains are designed and checked; {_SIZE}",
        ),
        _number(
            "pressure_loop.gain", DESIGNED, "1/s", -1.0, 1000.0,
            "gain of the pressure loops; -1: designed",
        ),
        _number(
            "pressure_loop.lead_ratio", d.lead_ratio, "-", 0.1, 1.0,
            "part of the valve's lag that is left uncompensated",
        ),
        _number(
            "pressure_loop.min_pressure", d.min_pressure, "Pa", 0.0, 5e5,
            "lowest desired pressure of a muscle", fixed=True,
        ),
        _number(
            "pressure_loop.rate_limit", d.pressure_rate, "Pa/s", 1e3, 1e8,
            "maximum rate of a desired pressure",
        ),
        _number(
            "pressure_loop.spool_limit", d.spool_limit, "-", 0.01, 1.0,
            "largest command to a flow valve",
        ),
        _number(
            "pid.derivative_filter", d.derivative_filter, "s", 1e-3, 0.2,
            "filter time constant of measured velocities",
        ),
        _number(
            "pid.integral_limit", d.integral_limit, "N m", BY_SIZE, 1e4,
            f"maximum integral part (pressure_ratio_pid: of the ratio, no unit); {_SIZE}",
        ),
        _number(
            "stiffness.default", d.default_stiffness, "N m/rad", BY_SIZE, 1e5,
            f"stiffness until one is commanded; {_SIZE}",
        ),
        _number(
            "stiffness.rate_limit", d.stiffness_rate, "N m/(rad s)", BY_SIZE, 1e5,
            f"maximum rate of the stiffness reference; {_SIZE}",
        ),
        Parameter(
            "stiffness.corrected", d.stiffness_corrected, "-", 0, 0,
            "correct commands of the stiffness by what was learnt of the muscles' dimensions",
            changeable=True,
        ),
        _number(
            "stiffness_test.amplitude", 0.0, "rad", 0.0, 0.2,
            "amplitude of a small motion of a joint that rests, by which its stiffness is "
            "estimated (law model_based with adaptation); 0: none",
        ),
        _number(
            "stiffness_test.frequency", 1.5, "Hz", 0.2, 2.0, "frequency of this motion",
        ),
        Parameter(
            "disturbance_observer.enabled", d.observer, "-", 0, 0,
            "compensate the torque that the model does not explain (law model_based)",
            changeable=True,
        ),
        _number(
            "disturbance_observer.bandwidth", d.observer_bandwidth, "rad/s", 0.0, 500.0,
            "bandwidth of the disturbance observer; 0: designed",
        ),
        _number(
            "disturbance_observer.limit", d.observer_limit, "N m", BY_SIZE, 1e4,
            f"largest torque that the disturbance observer compensates; {_SIZE}",
        ),
        Parameter(
            "adaptation.enabled", d.adaptation, "-", 0, 0,
            "learn the torque that the model lacks and the true flows of the valves "
            "(law model_based)",
            changeable=True,
        ),
        _number(
            "adaptation.limit", d.adaptation_limit, "N m", BY_SIZE, 1e4,
            f"largest torque that is learnt; {_SIZE}",
        ),
        Parameter(
            "files.folder", "", "-", 0, 0,
            "folder of the files that adaptation.rig_file and learning.file name; empty: "
            "pam_control in $ROS_HOME or ~/.ros",
        ),
        Parameter(
            "adaptation.rig_file", "", "-", 0, 0,
            "new rig file in files.folder that ~/save_adapted_rig writes, with what was learnt",
            changeable=True,
        ),
        Parameter(
            "learning.motion", d.learning_motion, "-", 0, 0,
            "name under which the trajectories that follow are learnt as repetitions of one "
            "motion (law model_based); empty: none are",
            changeable=True,
        ),
        Parameter(
            "learning.file", d.learning_file, "-", 0, 0,
            "file in files.folder in which learnt motions are kept; empty: in memory only",
            changeable=True,
        ),
        _number(
            "pressure_ratio.mean_pressure", d.mean_pressure, "Pa", 1e4, 1e6,
            "mean of the two pressures for the laws pressure_ratio_pid and pressure_difference_pid",
        ),
        _number(
            "impedance.damping", d.impedance_damping, "N m s/rad", BY_SIZE, 1e4,
            "damping of the laws impedance and gravity_compensation, at most the designed one; "
            f"{_SIZE}",
        ),
        _number(
            "float.hold_torque", d.float_hold_torque, "N m", BY_SIZE, 1e4,
            f"torque below which a joint stays where it is put (law gravity_compensation); {_SIZE}",
        ),
        _number(
            "float.speed_limit", d.float_speed_limit, "rad/s", 0.01, 10.0,
            "largest speed at which a joint is moved by hand (law gravity_compensation)",
        ),
        _number(
            "stream.timeout", d.stream_timeout, "s", 0.01, 10.0,
            "age of the last streamed command at which the joint holds its position",
        ),
        _number(
            "stream.bandwidth", d.stream_bandwidth, "rad/s", 1.0, 500.0,
            "bandwidth of the filter for streamed commands",
        ),
        _number(
            "trajectory.max_points", 50_000, "-", 1, 1_000_000,
            "largest number of points of a trajectory; 50,000 are 100 s at 500 Hz",
        ),
        Parameter(
            "trajectory.allow_nonzero_end_velocity", d.allow_nonzero_end_velocity, "-", 0, 0,
            "accept trajectories that end in motion", changeable=True,
        ),
    ]  # fmt: skip
    table += tolerance_parameters(joint_names)
    for name in joint_names:
        for part, unit in (
            ("proportional", "N m/rad"),
            ("integral", "N m/(rad s)"),
            ("derivative", "N m s/rad"),
        ):
            table.append(
                _number(
                    f"gains.{name}.{part}", DESIGNED, unit, -1.0, 1e5,
                    f"{part} gain of {name}; -1: designed",
                )
            )  # fmt: skip
    return table


def settings_from(values: Mapping[str, Value], joint_names: Sequence[str]) -> ControlSettings:
    """Settings from checked parameters; gains of -1 are designed later.

    Parameters
    ----------
    values : mapping
        Every parameter of the table.
    joint_names : sequence of str
        As for `parameter_table`.

    Raises
    ------
    PamError
        For a design range whose lower end is above its upper end, a stiffness test without
        anything that would learn from it, or a file outside of files.folder.
    """

    def number(name: str) -> float:
        return float(values[name])

    for name, least in LEAST_BESIDE_SIZE.items():
        if number(name) != BY_SIZE and number(name) < least:
            raise PamError(
                f"{name} = {number(name):g}: must be at least {least:g}, or -1 for the value that "
                "follows from the size of each joint"
            )
    low, high = number("design.least_stiffness"), number("design.greatest_stiffness")
    if (low == BY_SIZE) != (high == BY_SIZE):
        raise PamError(
            f"design.least_stiffness = {low:g} and design.greatest_stiffness = {high:g}: both must "
            "be given in N m/rad, or both be -1 for values that follow from the size of each joint"
        )
    if low > high:
        raise PamError(
            f"design.least_stiffness = {low:g} N m/rad must not be above "
            f"design.greatest_stiffness = {high:g} N m/rad"
        )
    law = str(values["law"])
    learns = values["adaptation.enabled"] and law in LAWS and LAWS[law].has_adaptation
    if number("stiffness_test.amplitude") > 0.0 and not learns:
        raise PamError(
            "stiffness_test.amplitude: must be 0 unless law is model_based and adaptation.enabled "
            "is true, because only then a stiffness is estimated"
        )
    kept_file(values, "adaptation.rig_file")
    gain = number("pressure_loop.gain")
    partial = {}
    for name in joint_names:
        given = {
            part: number(f"gains.{name}.{part}")
            for part in ("proportional", "integral", "derivative")
            if number(f"gains.{name}.{part}") >= 0.0
        }
        if given:
            partial[name] = given
    derivative_filter = number("pid.derivative_filter")
    return ControlSettings(
        period=1.0 / number("loop.rate"),
        measurement_delay=number("loop.measurement_delay"),
        command_delay=number("loop.command_delay"),
        extra_delay=number("design.extra_delay"),
        safe_delay=number("design.safe_delay"),
        lowering_time=number("lowering.time"),
        tracking_time=number("guard.tracking_time"),
        lead_ratio=number("pressure_loop.lead_ratio"),
        pressure_gain=gain if gain > 0.0 else None,
        derivative_filter=derivative_filter,
        phase_margin=number("design.phase_margin"),
        sensitivity=number("design.sensitivity"),
        gains={
            name: PidGains(**given, derivative_filter=derivative_filter)
            for name, given in partial.items()
            if len(given) == 3
        },
        partial_gains={name: given for name, given in partial.items() if len(given) < 3},
        feedforward=bool(values["feedforward.enabled"]),
        integral_limit=number("pid.integral_limit"),
        default_stiffness=number("stiffness.default"),
        stiffness_rate=number("stiffness.rate_limit"),
        stiffness_corrected=bool(values["stiffness.corrected"]),
        stiffness_grid=() if low == BY_SIZE else tuple(sorted({low, 0.5 * (low + high), high})),
        min_pressure=number("pressure_loop.min_pressure"),
        pressure_rate=number("pressure_loop.rate_limit"),
        spool_limit=number("pressure_loop.spool_limit"),
        mean_pressure=number("pressure_ratio.mean_pressure"),
        observer=bool(values["disturbance_observer.enabled"]),
        observer_bandwidth=number("disturbance_observer.bandwidth"),
        observer_limit=number("disturbance_observer.limit"),
        adaptation=bool(values["adaptation.enabled"]),
        adaptation_limit=number("adaptation.limit"),
        learning_motion=str(values["learning.motion"]),
        learning_file=str(kept_file(values, "learning.file") or ""),
        impedance_damping=number("impedance.damping"),
        float_hold_torque=number("float.hold_torque"),
        float_speed_limit=number("float.speed_limit"),
        stale_after=number("loop.stale_after"),
        stream_timeout=number("stream.timeout"),
        stream_bandwidth=number("stream.bandwidth"),
        allow_nonzero_end_velocity=bool(values["trajectory.allow_nonzero_end_velocity"]),
    )


def kept_file(values: Mapping[str, Value], key: str) -> Path | None:
    """The file that a parameter names; None for an empty name.

    Raises
    ------
    PamError
        If it is not inside of files.folder.
    """
    name = str(values[key])
    return file_inside(kept_folder(str(values["files.folder"])), name, key) if name else None


def create_controller(
    rig: Rig,
    values: Mapping[str, Value],
    joint_names: Sequence[str],
    designs: KeptDesigns | None = None,
) -> Controller:
    """Create the controller that the parameters describe.

    Parameters
    ----------
    rig : Rig
        The controlled rig.
    values : mapping
        Every parameter of the table.
    joint_names : sequence of str
        As for `parameter_table`.
    designs : KeptDesigns, optional
        Store of designed gains; by default in memory only.

    Raises
    ------
    PamError
        For an unknown law; ControlDesignError if the loop would not be safe.
    """
    law = str(values["law"])
    if law not in LAWS:
        raise PamError(f"law = {law!r}: must be {LAW_NAMES}")
    return LAWS[law](rig, settings_from(values, joint_names), designs)


HELP = NodeHelp(
    program=f"{PROGRAM} control node",
    purpose="Controls joint angles and stiffness: receives references and measurements, sends "
    "valve commands.",
    parameters=parameter_table(("<joint>",)),
    other_keys="the keys of the rig file, which docs/rig_file.md describes",
    example="--ros-args --params-file config/elbow.yaml --params-file config/controller.yaml",
    subscribes=(
        Endpoint(
            "~/joint_trajectory", "trajectory_msgs/JointTrajectory", "positions [rad] over time [s]"
        ),
        Endpoint("~/commands", "sensor_msgs/JointState", "streamed references: position [rad]"),
        Endpoint("~/stiffness_commands", "std_msgs/Float64MultiArray", "[N m/rad], one per joint"),
        Endpoint(
            "~/torque_commands",
            "std_msgs/Float64MultiArray",
            "[N m], one per joint; law torque only",
        ),
        Endpoint("joint_states", "sensor_msgs/JointState", "position [rad]"),
        Endpoint("pressure_states", "sensor_msgs/JointState", "effort: gauge pressure [Pa]"),
        Endpoint(
            "pam_driver/state",
            "diagnostic_msgs/DiagnosticStatus",
            "state of the driver; no commands and no references while it takes none",
        ),
    ),
    serves=(
        Endpoint(
            "~/follow_joint_trajectory",
            "action control_msgs/FollowJointTrajectory",
            "trajectories with tolerances, feedback and result, where control_msgs is installed",
        ),
        Endpoint("~/stop", "std_srvs/Trigger", "brake within the limits and hold (category 2)"),
        Endpoint("~/lower", "std_srvs/Trigger", "brake, let the air out slowly, vent (category 1)"),
        Endpoint(
            "~/save_adapted_rig",
            "std_srvs/Trigger",
            "write a copy of the rig file with what was learnt to adaptation.rig_file",
        ),
    ),
    publishes=(
        Endpoint(
            "valve_commands",
            "sensor_msgs/JointState",
            "position: spool opening from -1 to 1 of a flow valve; effort [Pa] of a regulator",
        ),
        Endpoint("~/reference", "sensor_msgs/JointState", "reference of the joints [rad]"),
        Endpoint("~/error", "sensor_msgs/JointState", "reference minus measured position [rad]"),
        Endpoint(
            "~/disturbance",
            "sensor_msgs/JointState",
            "effort: torque on the joint that its model does not explain [N m]",
        ),
        Endpoint("/diagnostics", "diagnostic_msgs/DiagnosticArray", "health, once a second"),
    ),
)
