"""`pam model`: models, muscles and rig files from the command line."""

# PYTHON_ARGCOMPLETE_OK: shells with argcomplete complete its commands and options

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pam_model.command_line import NodeCommand, Tool
from pam_model.commands import catalogue, identify, new_rig, rig_sections, size
from pam_ros.program_name import PROGRAM

if TYPE_CHECKING:
    from pam_ros.node_help import NodeHelp


def _node(arguments: Sequence[str] | None) -> int:
    from pam_model.model_node import main as run  # noqa: PLC0415  (rclpy)

    return run(arguments)


def _usage() -> NodeHelp:
    from pam_model.model_help import HELP  # noqa: PLC0415

    return HELP


NODE = NodeCommand(
    "node", "estimate forces, torques and stiffness of a robot (a ROS node)", _node, _usage
)


COMMANDS = (
    NODE,
    *catalogue.COMMANDS,
    *identify.COMMANDS,
    *rig_sections.COMMANDS,
    *new_rig.COMMANDS,
    *size.COMMANDS,
)


TOOL = Tool(
    "model",
    "Muscle models, rig files, design of joints, and the model node",
    COMMANDS,
    moved=dict.fromkeys(("gallery", "effect-tables"), f"{PROGRAM} check pages"),
)

main = TOOL.run
model_node = NODE.start  # `ros2 run pam_model pam_model_node`


if __name__ == "__main__":
    sys.exit(main())
