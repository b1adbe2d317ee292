"""The monitor's parameters and topics, without ROS: what its `--help` prints."""

from __future__ import annotations

from pam_ros.node_help import Endpoint, NodeHelp
from pam_ros.parameter_row import Parameter
from pam_ros.program_name import PROGRAM

PARAMETERS = (
    Parameter("window", 6.0, "s", 3.0, 60.0, "length of the window that is judged"),
    Parameter("period", 1.0, "s", 0.2, 60.0, "how often the gap is reported"),
    Parameter(
        "warning_ratio", 5.0, "-", 1.0, 1e6, "gap over noise above which a warning is given", True
    ),
)

HELP = NodeHelp(
    program=f"{PROGRAM} gap monitor",
    purpose="Watches a running rig and reports how far its measurements are from what its rig file "
    "predicts, and at which stage they differ.",
    parameters=PARAMETERS,
    other_keys="the keys of the rig file, which docs/rig_file.md describes",
    example="--ros-args --params-file config/elbow.yaml",
    subscribes=(
        Endpoint(
            "valve_commands",
            "sensor_msgs/JointState",
            "position: spool opening from -1 to 1 of a flow valve; effort [Pa] of a regulator",
        ),
        Endpoint("pressure_states", "sensor_msgs/JointState", "effort: gauge pressure [Pa]"),
        Endpoint("joint_states", "sensor_msgs/JointState", "position [rad]"),
    ),
    publishes=(Endpoint("/diagnostics", "diagnostic_msgs/DiagnosticArray", "the gap per joint"),),
)
