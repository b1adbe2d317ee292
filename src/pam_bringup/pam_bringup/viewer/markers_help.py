"""The markers node's parameters and topics, without ROS: what its `--help` prints."""

from __future__ import annotations

from pam_ros.node_help import Endpoint, NodeHelp
from pam_ros.parameter_row import Parameter
from pam_ros.program_name import PROGRAM

PARAMETERS = (
    Parameter("rate", 20.0, "Hz", 1.0, 100.0, "of the markers"),
    Parameter("frame", "base_link", "-", 0, 0, "in which the muscles stand; that of the URDF"),
)

HELP = NodeHelp(
    program=f"{PROGRAM} bringup markers",
    purpose="Publishes the muscles as markers, with their length and, as colour, their pressure.",
    parameters=PARAMETERS,
    other_keys="the keys of the rig file, which docs/rig_file.md describes",
    example="--ros-args --params-file config/elbow.yaml",
    subscribes=(
        Endpoint("joint_states", "sensor_msgs/JointState", "position [rad]"),
        Endpoint("pressure_states", "sensor_msgs/JointState", "effort: gauge pressure [Pa]"),
    ),
    publishes=(Endpoint("~/muscles", "visualization_msgs/MarkerArray", "muscles and tendons [m]"),),
)
