"""The model node's parameters and topics, without ROS: what its `--help` prints."""

from __future__ import annotations

from pam_ros.node_help import Endpoint, NodeHelp
from pam_ros.parameter_row import Parameter
from pam_ros.program_name import PROGRAM

PARAMETERS = (
    Parameter("publish_rate", 100.0, "Hz", 1.0, 1000.0, "rate at which estimates are published"),
    Parameter("max_age", 0.1, "s", 0.001, 10.0, "an older measurement counts as missing", True),
    Parameter(
        "closed_chambers", False, "-", 0, 0, "stiffness with shut valves instead of fixed pressure"
    ),
)

HELP = NodeHelp(
    program=f"{PROGRAM} model node",
    purpose="Estimates muscle lengths and forces, joint torques and stiffness from the measured "
    "pressures and angles.",
    parameters=PARAMETERS,
    other_keys="the keys of the rig file, which docs/rig_file.md describes",
    example="--ros-args --params-file config/elbow.yaml",
    subscribes=(
        Endpoint("pressure_states", "sensor_msgs/JointState", "effort: gauge pressure [Pa]"),
        Endpoint("joint_states", "sensor_msgs/JointState", "position [rad], velocity [rad/s]"),
    ),
    publishes=(
        Endpoint(
            "muscle_states",
            "sensor_msgs/JointState",
            "position: length [m], velocity [m/s], effort: force [N]",
        ),
        Endpoint("joint_estimates", "sensor_msgs/JointState", "effort: torque [N m]"),
        Endpoint("joint_stiffness", "std_msgs/Float64MultiArray", "[N m/rad]"),
        Endpoint("/diagnostics", "diagnostic_msgs/DiagnosticArray", "health, once a second"),
    ),
)
