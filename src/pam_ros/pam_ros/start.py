"""Starts ROS in a process; if the environment does not permit it, one line says why."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import rclpy
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions

from pam_ros.errors import ParameterError
from pam_ros.node_help import reason_of_rcl
from pam_ros.parameter_files import remember_arguments
from pam_ros.quick_log import leave_source_code_alone
from pam_ros.transport import leave_out_shared_memory


def start_ros(arguments: Sequence[str] | None = None) -> None:
    """Initialise rclpy, without shared memory and without its signal handlers.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line, with --ros-args; by default that of the process.

    Raises
    ------
    ParameterError
        Where a variable of the environment cannot be used, or no folder for the log can be made.
    """
    leave_out_shared_memory()
    leave_source_code_alone()
    remember_arguments(sys.argv if arguments is None else arguments)
    try:
        rclpy.init(
            args=None if arguments is None else list(arguments),
            signal_handler_options=SignalHandlerOptions.NO,
        )
    except rclpy_implementation.RCLError as error:
        reason = reason_of_rcl(error)
        hint = "; set ROS_LOG_DIR to a folder that can be written" if "log" in reason else ""
        raise ParameterError(f"ROS does not start: {reason}{hint}") from None
