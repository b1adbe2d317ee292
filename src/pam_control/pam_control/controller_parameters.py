"""The controller node's parameters: names, units, ranges, texts; and the settings they make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pam_control.controller import Controller
from pam_control.feedback.kept_designs import KeptDesigns
from pam_control.feedback.pid import PidGains
from pam_control.laws.position_stiffness import PositionStiffnessController
from pam_control.laws.pressure_ratio_pid import PressureRatioPid
from pam_control.settings import ControlSettings
from pam_model.errors import PamError
from pam_model.rig import Rig
from pam_ros.node_help import Endpoint, NodeHelp
from pam_ros.parameters import Parameter, Value

DESIGNED = -1.0
LAWS: Mapping[str, type[Controller]] = {
    "model_based": PositionStiffnessController,
    "pressure_ratio_pid": PressureRatioPid,
}
_DEFAULT = ControlSettings()


def _number(*columns: Any, fixed: bool = False) -> Parameter:
    """A row of name, default, unit, low, high, text."""
    name, default, unit, low, high, text = columns
    return Parameter(name, default, unit, low, high, text, changeable=not fixed)


def parameter_table(joint_names: Sequence[str]) -> list[Parameter]:
    """All parameters of the node beside the rig's.

    Parameters
    ----------
    joint_names : sequence of str
        Each joint has gains of its own.
    """
    d = _DEFAULT
    table = [
        Parameter("law", "model_based", "-", 0, 0, f"control law: {' or '.join(LAWS)}"),
        _number("loop.rate", 1.0 / d.period, "Hz", 50.0, 2000.0, "control cycles", fixed=True),
        _number(
            "loop.realtime_priority", 0, "-", 0, 99,
            "of the control thread (SCHED_FIFO) where the system permits it; 0: ordinary",
            fixed=True,
        ),
        _number(
            "loop.measurement_delay", d.measurement_delay, "s", 0.0, 0.1,
            "from a sensor's sample to its stamp",
        ),
        _number(
            "loop.command_delay", d.command_delay, "s", 0.0, 0.1,
            "from the controller to the valve",
        ),
        _number(
            "loop.stale_after", d.stale_after, "s", 0.002, 2.0,
            "age at which a measurement is no measurement and commands stop",
        ),
        _number(
            "telemetry.rate", 100.0, "Hz", 1.0, 2000.0,
            "of ~/reference and ~/error", fixed=True,
        ),
        Parameter(
            "feedforward.enabled", d.feedforward, "-", 0, 0,
            "inverse dynamics and pressures ahead of the feedback", changeable=True,
        ),
        _number(
            "design.phase_margin", d.phase_margin, "rad", 0.53, 1.4,
            "least phase margin of designed gains",
        ),
        _number(
            "design.sensitivity", d.sensitivity, "-", 1.1, 3.0,
            "largest sensitivity |S| of designed gains",
        ),
        _number(
            "design.least_stiffness", min(d.stiffness_grid), "N m/rad", 0.01, 1e5,
            "softest joint that gains are designed and checked for",
        ),
        _number(
            "design.greatest_stiffness", max(d.stiffness_grid), "N m/rad", 0.01, 1e5,
            "stiffest joint that gains are designed and checked for",
        ),
        _number(
            "pressure_loop.gain", DESIGNED, "1/s", -1.0, 1000.0,
            "of the pressure loops; -1: designed",
        ),
        _number(
            "pressure_loop.lead_ratio", d.lead_ratio, "-", 0.1, 1.0,
            "part of the valve's lag that is left uncompensated",
        ),
        _number(
            "pressure_loop.min_pressure", d.min_pressure, "Pa", 0.0, 5e5,
            "no muscle is asked for less", fixed=True,
        ),
        _number(
            "pressure_loop.rate_limit", d.pressure_rate, "Pa/s", 1e3, 1e8,
            "fastest change of a desired pressure",
        ),
        _number(
            "pressure_loop.spool_limit", d.spool_limit, "-", 0.01, 1.0,
            "largest command to a flow valve",
        ),
        _number(
            "pid.derivative_filter", d.derivative_filter, "s", 1e-3, 0.2,
            "time constant of measured velocities",
        ),
        _number(
            "pid.integral_limit", d.integral_limit, "N m", 0.0, 1e4,
            "largest integral part (pressure_ratio_pid: of the ratio, no unit)",
        ),
        _number(
            "stiffness.default", d.default_stiffness, "N m/rad", 0.01, 1e5,
            "until a stiffness is commanded", fixed=True,
        ),
        _number(
            "stiffness.rate_limit", d.stiffness_rate, "N m/(rad s)", 0.01, 1e5,
            "fastest change of the stiffness asked of the muscles",
        ),
        _number(
            "pressure_ratio.mean_pressure", d.mean_pressure, "Pa", 1e4, 1e6,
            "mean of the two pressures in law pressure_ratio_pid",
        ),
        _number(
            "stream.timeout", d.stream_timeout, "s", 0.01, 10.0,
            "age at which a streamed command is held where it is",
        ),
        _number(
            "stream.bandwidth", d.stream_bandwidth, "rad/s", 1.0, 500.0,
            "of the filter behind streamed commands",
        ),
        Parameter(
            "trajectory.allow_nonzero_end_velocity", d.allow_nonzero_end_velocity, "-", 0, 0,
            "accept trajectories that end in motion", changeable=True,
        ),
    ]  # fmt: skip
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
    """Settings of checked parameters; gains at -1 are left to the design.

    Parameters
    ----------
    values : mapping
        Every parameter of the table.
    joint_names : sequence of str
        As for `parameter_table`.

    Raises
    ------
    PamError
        For a design range whose ends are the wrong way round.
    """

    def number(name: str) -> float:
        return float(values[name])

    low, high = number("design.least_stiffness"), number("design.greatest_stiffness")
    if low > high:
        raise PamError(
            f"design.least_stiffness = {low:g} N m/rad must not be above "
            f"design.greatest_stiffness = {high:g} N m/rad"
        )
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
        stiffness_grid=tuple(sorted({low, 0.5 * (low + high), high})),
        min_pressure=number("pressure_loop.min_pressure"),
        pressure_rate=number("pressure_loop.rate_limit"),
        spool_limit=number("pressure_loop.spool_limit"),
        mean_pressure=number("pressure_ratio.mean_pressure"),
        stale_after=number("loop.stale_after"),
        stream_timeout=number("stream.timeout"),
        stream_bandwidth=number("stream.bandwidth"),
        allow_nonzero_end_velocity=bool(values["trajectory.allow_nonzero_end_velocity"]),
    )


def create_controller(
    rig: Rig,
    values: Mapping[str, Value],
    joint_names: Sequence[str],
    designs: KeptDesigns | None = None,
) -> Controller:
    """The controller that the parameters ask for.

    Parameters
    ----------
    rig : Rig
        What is controlled.
    values : mapping
        Every parameter of the table.
    joint_names : sequence of str
        As for `parameter_table`.
    designs : KeptDesigns, optional
        Where designed gains are kept; in memory alone if left out.

    Raises
    ------
    PamError
        For an unknown law; ControlDesignError where the loop would not be safe.
    """
    law = str(values["law"])
    if law not in LAWS:
        raise PamError(f"law = {law!r}: must be {' or '.join(LAWS)}")
    return LAWS[law](rig, settings_from(values, joint_names), designs)


HELP = NodeHelp(
    program="ros2 run pam_control controller_node",
    purpose="Makes joints follow angles with the stiffness that is asked for: references and "
    "measurements in, valve commands out.",
    parameters=parameter_table(("<joint>",)),
    other_keys="the keys of the rig file, which docs/rig_file.md describes",
    example="--ros-args --params-file config/elbow.yaml --params-file config/controller.yaml",
    subscribes=(
        Endpoint(
            "~/joint_trajectory", "trajectory_msgs/JointTrajectory", "positions [rad] over time [s]"
        ),
        Endpoint("~/commands", "sensor_msgs/JointState", "streamed references: position [rad]"),
        Endpoint("~/stiffness_commands", "std_msgs/Float64MultiArray", "[N m/rad], one a joint"),
        Endpoint("joint_states", "sensor_msgs/JointState", "position [rad]"),
        Endpoint("pressure_states", "sensor_msgs/JointState", "effort: gauge pressure [Pa]"),
    ),
    publishes=(
        Endpoint(
            "valve_commands",
            "sensor_msgs/JointState",
            "position: spool opening from -1 to 1 of a flow valve; effort [Pa] of a regulator",
        ),
        Endpoint("~/reference", "sensor_msgs/JointState", "what the joints should do [rad]"),
        Endpoint("~/error", "sensor_msgs/JointState", "how far off they are [rad]"),
        Endpoint("/diagnostics", "diagnostic_msgs/DiagnosticArray", "health, once a second"),
    ),
)
