"""`pam control node`: the controller."""

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pam_model.argument_types import input_folder
from pam_model.command_line import (
    Arguments,
    Command,
    NodeCommand,
    Outcome,
    Parser,
    Tool,
    start_node,
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


def _declare_parameters(parser: Parser) -> None:
    parser.add_argument("--table", action="store_true", help="as a table in Markdown")
    parser.add_argument(
        "--write",
        metavar="CLONE",
        type=input_folder,
        help="update config/controller.yaml and docs/controller.md of a clone of this project",
    )


def _parameters(chosen: Arguments) -> Outcome:
    from pam_control.parameter_page import table, write_pages, yaml_text  # noqa: PLC0415

    if chosen.write is not None:
        changed = write_pages(chosen.write)
        print("written: " + ", ".join(map(str, changed)) if changed else "all is up to date")
        return Outcome({"changed": changed})
    text = table() if chosen.table else yaml_text()
    print(text, end="")
    return Outcome({"text": text})


COMMANDS = (
    NODE,
    Command(
        "parameters",
        "print a parameter file with all defaults and what they mean",
        _declare_parameters,
        _parameters,
        examples=("pam control parameters > controller.yaml",),
    ),
)
TOOL = Tool("control", "Position and stiffness control of joints", COMMANDS)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return the exit code."""
    return TOOL.run(arguments)


def controller_node() -> int:
    """Entry point of `ros2 run pam_control pam_controller_node`."""
    return start_node(NODE)


if __name__ == "__main__":
    sys.exit(main())
