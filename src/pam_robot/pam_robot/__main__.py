"""`pam robot node`: driver, controller and model of a robot in one process."""

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pam_model.command_line import NodeCommand, Tool

if TYPE_CHECKING:
    from pam_ros.node_help import NodeHelp


def _node(arguments: Sequence[str] | None) -> int:
    from pam_control.controller_node import ControllerNode  # noqa: PLC0415  (rclpy)
    from pam_driver.driver_node import DriverNode  # noqa: PLC0415
    from pam_model.model_node import ModelNode  # noqa: PLC0415
    from pam_robot.robot_node import main as run  # noqa: PLC0415

    return run(arguments, DriverNode, ControllerNode, ModelNode)


def _usage() -> NodeHelp:
    from pam_robot.robot_help import HELP  # noqa: PLC0415

    return HELP


NODE = NodeCommand(
    "node", "drive, control and estimate a robot in one cycle (three ROS nodes)", _node, _usage
)


COMMANDS = (NODE,)
TOOL = Tool("robot", "Driver, controller and model of a robot in one process", COMMANDS)

main = TOOL.run
robot_node = NODE.start  # `ros2 run pam_robot pam_robot_node`


if __name__ == "__main__":
    sys.exit(main())
