"""`ros2 run pam_control controller_node`, also as `python -m pam_control`."""

from __future__ import annotations

import sys

from pam_model.program_signals import end_at_signals


def controller_node() -> int:
    """Entry point of `ros2 run pam_control controller_node`."""
    end_at_signals()
    from pam_control.controller_node import main as run  # noqa: PLC0415  (rclpy)

    return run()


if __name__ == "__main__":
    sys.exit(controller_node())
