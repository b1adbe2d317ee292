"""What the robot node's `--help` prints; its nodes have the parameters and topics."""

from __future__ import annotations

from typing import Final

from pam_ros.node_help import NodeHelp
from pam_ros.program_name import PROGRAM

HELP: Final = NodeHelp(
    program=f"{PROGRAM} robot node",
    purpose="Runs the driver, the controller and the model of one robot as three nodes of one "
    "process. One cycle measures, judges, controls and sends, without a message in between. "
    "Topics, services and parameters are those of the nodes, which their own --help lists.",
    parameters=(),
    other_keys="the parameters of pam_driver, pam_controller and pam_model, each in the section of "
    "its node or as -p NODE:NAME:=VALUE, and the keys of the rig file (docs/rig_file.md)",
    example="--ros-args --params-file config/elbow.yaml -p pam_driver:bus.channel:=can0",
)
