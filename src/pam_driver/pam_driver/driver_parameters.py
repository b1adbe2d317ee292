"""The driver node's parameters and topics, without ROS: what its `--help` prints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from pam_driver.boards.protocol import EMERGENCY_STOP, ENABLING_SWITCH
from pam_driver.can_bus.bitrate import DEFAULT_BITRATE
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.people_inputs import FULL_SPEED
from pam_model.errors import PamError
from pam_ros.node_help import Endpoint, NodeHelp
from pam_ros.parameter_row import Parameter, declared_rows
from pam_ros.program_name import PROGRAM

if TYPE_CHECKING:
    from pam_ros.parameters import NodeParameters

TABLE: Final = (
    Parameter(
        "autostart", True, "-", 0, 1, "configure by itself at start-up: measure, with all valves "
        "vented"
    ),
    Parameter(
        "activate_on_start", False, "-", 0, 1, "with autostart: also activate by itself, once all "
        "boards answer; a vent, a fault or a clean-up before cancels it"
    ),
    Parameter(
        "startup_timeout", 10.0, "s", 0.1, 600.0, "how long autostart waits for all boards"
    ),
    Parameter("rate", 500.0, "Hz", 1.0, 1000.0, "cycles of the I/O thread"),
    Parameter(
        "realtime_priority", 0, "-", 0, 99, "real-time priority (SCHED_FIFO) of the I/O thread, "
        "where the system permits it; 0: none"
    ),
    Parameter(
        "align", True, "-", 0, 0, "shift the cycles, by a fiftieth of a period at most, so that "
        "they begin shortly after the boards' measurements have arrived"
    ),
    Parameter("bus.interface", "socketcan", "-", 0, 0, "python-can's name of the interface"),
    Parameter("bus.channel", "can0", "-", 0, 0, "network interface, multicast group or device"),
    Parameter(
        "bus.bitrate", DEFAULT_BITRATE, "bit/s", 10_000, 1_000_000, "used for the bus load; sets "
        "the bitrate on interfaces where python-can sets it (SocketCAN: ip link sets it)"
    ),
    Parameter("bus.port", 43113, "-", 1024, 65535, "UDP port, used by udp_multicast only"),
    Parameter(
        "bus.options", "", "-", 0, 0, "further options of the interface: name=value, name=value"
    ),
    Parameter(
        "bus.filter", False, "-", 0, 1, "SocketCAN: receive only frames of the rig's boards; saves "
        "time on a shared bus, but hides other drivers"
    ),
    Parameter("bus.dbc", "", "-", 0, 0, "DBC file of the boards; empty: the one of this package"),
    *declared_rows(DriverSettings),
    Parameter(
        "plausibility", True, "-", 0, 1, "compare measurements with the rig's physics, and vent "
        "when they are implausible; the limits are in the rig file"
    ),
    Parameter(
        "joint_states.keep_nan", False, "-", 0, 1, "joint_states names a joint without a fresh "
        "measurement, with NaN; otherwise it is left out"
    ),
    Parameter(
        "publish_rate", 0.0, "Hz", 0.0, 1000.0, "rate of pressure_states, joint_states and "
        "sent_valve_commands, at most that of the cycles; 0: every cycle, as a controller in "
        "another process and a recording need it"
    ),
    Parameter("fluid_pressure_rate", 10.0, "Hz", 0.1, 100.0, "rate of <muscle>/pressure"),
)  # fmt: skip


PEOPLE_TOPICS: Final = {
    EMERGENCY_STOP: "~/emergency_stop_released",
    ENABLING_SWITCH: "~/enabling_switch_held",
    FULL_SPEED: "~/full_speed_permitted",
}
"""By input for people, its topic: true permits motion, or full speed."""

HELP: Final = NodeHelp(
    program=f"{PROGRAM} driver node",
    purpose="Drives the valve boards of a rig over a CAN bus: valve commands in, measurements out. "
    "It vents on every fault, and stays vented until the fault is cleared. It is a lifecycle node; "
    "with autostart it begins to measure by itself, and activate_on_start asks for moving air too.",
    parameters=TABLE,
    other_keys="the keys of the rig file, which docs/rig_file.md describes",
    example="--ros-args --params-file config/elbow.yaml -p bus.channel:=can0",
    subscribes=(
        Endpoint(
            "valve_commands",
            "sensor_msgs/JointState",
            "position: spool opening from -1 to 1 of a flow valve; effort [Pa] of a regulator",
        ),
        Endpoint(
            PEOPLE_TOPICS[EMERGENCY_STOP],
            "std_msgs/Bool",
            "true permits motion; only with people.emergency_stop_topic in the rig file",
        ),
        Endpoint(
            PEOPLE_TOPICS[ENABLING_SWITCH],
            "std_msgs/Bool",
            "true permits motion; only with people.enabling_switch_topic in the rig file",
        ),
        Endpoint(
            PEOPLE_TOPICS[FULL_SPEED],
            "std_msgs/Bool",
            "true permits full speed; only with people.full_speed_topic in the rig file",
        ),
    ),
    publishes=(
        Endpoint("pressure_states", "sensor_msgs/JointState", "effort: gauge pressure [Pa]"),
        Endpoint(
            "joint_states",
            "sensor_msgs/JointState",
            "position [rad], velocity [rad/s] of the joints that are measured",
        ),
        Endpoint(
            "sent_valve_commands",
            "sensor_msgs/JointState",
            "the commands that were sent to the boards, and when",
        ),
        Endpoint("<muscle>/pressure", "sensor_msgs/FluidPressure", "absolute [Pa], at a low rate"),
        Endpoint(
            "~/state", "diagnostic_msgs/DiagnosticStatus", "state and reason; latched, on change"
        ),
        Endpoint("~/lamp", "std_msgs/String", "red, yellow, green or off; latched, on change"),
        Endpoint("/diagnostics", "diagnostic_msgs/DiagnosticArray", "health, once a second"),
    ),
    serves=(
        Endpoint(
            "~/vent",
            "std_srvs/Trigger",
            "lowers the joints, then vents all muscles; a second call vents at once",
        ),
        Endpoint("~/clear_faults", "std_srvs/Trigger", "forgets faults whose cause is gone"),
    ),
)


def settings_of(values: NodeParameters[Any]) -> DriverSettings:
    """The settings of the driver that works without ROS."""
    given: dict[str, Any] = {row.name: values[row.name] for row in declared_rows(DriverSettings)}
    return DriverSettings(period=1.0 / values.number("rate"), **given)


def bus_options(text: str) -> dict[str, Any]:
    """Options for python-can from "name=value, name=value"; numbers and true/false are converted.

    Raises
    ------
    PamError
        For a part that is not name=value.
    """
    options: dict[str, Any] = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not name.isidentifier():
            raise PamError(f"bus.options: {part!r} must be name=value")
        if value.lower() in {"true", "false"}:
            options[name] = value.lower() == "true"
        elif value.lstrip("-").isdecimal():
            options[name] = int(value)
        else:
            options[name] = value
    return options
