"""`pam control node`: the controller."""

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import sys
from collections.abc import Sequence

from pam_model.command_line import NodeCommand, Tool, start_node


def _node(arguments: Sequence[str] | None) -> int:
    from pam_control.controller_node import main as run  # noqa: PLC0415  (rclpy)

    return run(arguments)


COMMANDS = (NodeCommand("node", "control position and stiffness of joints (a ROS node)", _node),)
TOOL = Tool("control", "Position and stiffness control of joints, as a node", COMMANDS)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return the exit code."""
    return TOOL.run(arguments)


def controller_node() -> int:
    """Entry point of `ros2 run pam_control pam_controller_node`."""
    return start_node(_node)


if __name__ == "__main__":
    sys.exit(main())
