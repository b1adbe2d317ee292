"""The player's parameters and topics, without ROS: what its `--help` prints."""

from __future__ import annotations

from pam_ros.node_help import Endpoint, NodeHelp
from pam_ros.parameter_row import Parameter
from pam_ros.program_name import PROGRAM

PARAMETERS = (
    Parameter("experiment", "", "-", 0, 0, "folder of an experiment that a diagnosis has written"),
    Parameter("joint", "", "-", 0, 0, "name of the joint; empty for the first joint of the rig"),
    Parameter("rate", 200.0, "Hz", 50.0, 1000.0, "rate of the valve commands"),
    Parameter("approach", 3.0, "s", 1.0, 30.0, "time for the move to the start of the experiment"),
    Parameter(
        "max_age", 0.1, "s", 0.001, 1.0, "age of a measurement above which the experiment ends"
    ),
)

HELP = NodeHelp(
    program=f"{PROGRAM} gap play",
    purpose="Plays a proposed experiment on the rig in place of the controller: the joint moves. "
    "The driver must be active and no controller may run. At the end both muscles are vented.",
    parameters=PARAMETERS,
    other_keys="the keys of the rig file, which docs/rig_file.md describes",
    example="--ros-args --params-file RIG.yaml -p experiment:=OUT/next_experiment",
    subscribes=(
        Endpoint("pressure_states", "sensor_msgs/JointState", "effort: gauge pressure [Pa]"),
        Endpoint("joint_states", "sensor_msgs/JointState", "position [rad]"),
    ),
    publishes=(
        Endpoint(
            "valve_commands",
            "sensor_msgs/JointState",
            "position: spool opening from -1 to 1 of a flow valve; effort [Pa] of a regulator",
        ),
    ),
)
