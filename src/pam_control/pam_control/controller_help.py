"""The controller's topics, without ROS: what its `--help` prints."""

from __future__ import annotations

from pam_ros.node_help import Endpoint, NodeHelp
from pam_ros.program_name import PROGRAM

HELP = NodeHelp(
    program=f"{PROGRAM} control node",
    purpose="Controls joint angles and stiffness: receives references and measurements, sends "
    "valve commands.",
    parameters=(),  # of more than a hundred, some are those of laws that other packages install
    other_keys=f"those that '{PROGRAM} control parameters' prints as a file, with defaults, units, "
    "ranges and meaning, and the keys of the rig file, which docs/rig_file.md describes",
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
