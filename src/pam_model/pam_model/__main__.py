"""`python -m pam_model`: models, muscles and rig files from the command line."""

# PYTHON_ARGCOMPLETE_OK: shells with argcomplete complete its commands and options

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import sys
from collections.abc import Sequence

from pam_model.command_line import run_program
from pam_model.commands import catalogue, identify, new_rig, rig_sections, size
from pam_model.program_signals import end_at_signals

COMMANDS = (
    *catalogue.COMMANDS,
    *identify.COMMANDS,
    *rig_sections.COMMANDS,
    *new_rig.COMMANDS,
    *size.COMMANDS,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return the exit code."""
    description = (
        "Models of pneumatic muscles: list, draw, fit and compare them; design a muscle "
        "or a joint; new rig files, their sections and URDF."
    )
    return run_program("python -m pam_model", description, COMMANDS, arguments)


def model_node() -> int:
    """Entry point of `ros2 run pam_model model_node`."""
    end_at_signals()
    from pam_model.model_node import main as run  # noqa: PLC0415  (rclpy)

    return run()


if __name__ == "__main__":
    sys.exit(main())
