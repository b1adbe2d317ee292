"""`pam control node`: the controller."""

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pam_model.command_line import (
    Arguments,
    Command,
    NodeCommand,
    Outcome,
    Tool,
    no_arguments,
)

if TYPE_CHECKING:
    from pam_ros.node_help import NodeHelp


def _node(arguments: Sequence[str] | None) -> int:
    from pam_control.controller_node import main as run  # noqa: PLC0415  (rclpy)

    return run(arguments)


def _usage() -> NodeHelp:
    from pam_control.controller_help import HELP  # noqa: PLC0415

    return HELP


NODE = NodeCommand("node", "control position and stiffness of joints (a ROS node)", _node, _usage)


def _parameters(_: Arguments) -> Outcome:
    from pam_control.parameter_file import yaml_text  # noqa: PLC0415

    text = yaml_text()
    print(text, end="")
    return Outcome({"text": text})


COMMANDS = (
    NODE,
    Command(
        "parameters",
        "print a parameter file with all defaults and what they mean",
        no_arguments,
        _parameters,
        examples=("pam control parameters > controller.yaml",),
    ),
)
TOOL = Tool("control", "Position and stiffness control of joints", COMMANDS)

main = TOOL.run
controller_node = NODE.start  # `ros2 run pam_control pam_controller_node`


if __name__ == "__main__":
    sys.exit(main())
