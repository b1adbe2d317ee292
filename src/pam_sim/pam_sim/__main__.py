"""`pam sim`: a simulated rig on a CAN bus without ROS, and the tables of faults."""

# PYTHON_ARGCOMPLETE_OK: shells with argcomplete complete its commands and options

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pam_model.argument_types import count, input_file, named_number, number
from pam_model.command_line import (
    Arguments,
    Command,
    NodeCommand,
    Outcome,
    Parser,
    Tool,
    add_rig,
    start_node,
)

if TYPE_CHECKING:
    from pam_ros.node_help import NodeHelp


def _rig(given: Arguments) -> Outcome:
    from pam_sim.rig import run  # noqa: PLC0415  (numba)

    return run(given)


def _declare_rig(parser: Parser) -> None:
    add_rig(parser, required=True)
    add = parser.add_argument
    add(
        "--true-rig",
        type=input_file,
        metavar="FILE",
        help="rig file with the true parameters of the plant (default: --rig)",
    )
    add(
        "--effect",
        type=named_number,
        action="append",
        default=[],
        metavar="[NAME.]EFFECT.PARAMETER=VALUE",
        help="an effect in the plant, such as coulomb_friction.torque=0.5; may be repeated",
    )
    add("--interface", help="python-can's interface (default: socketcan)")
    add("--channel", help="python-can's channel (default: can0)")
    add("--port", type=count(1, 65535), help="UDP port, used by udp_multicast only")
    add("--dbc", type=input_file, metavar="FILE", help="CAN database (default: the driver's own)")
    add(
        "--firmware",
        type=input_file,
        metavar="PROGRAM",
        help="host build of firmware/, which then runs as each valve board of this project",
    )
    add(
        "--rate",
        type=number("Hz", above=0.0),
        default=1000.0,
        metavar="HZ",
        help="rate at which plant and boards are updated [Hz] (default: %(default)g)",
    )
    add(
        "--realtime-priority",
        type=count(0, 99),
        default=0,
        help="real-time priority (SCHED_FIFO) of the simulation's thread, where the system permits "
        "it; 0: none (default: %(default)s)",
    )
    for name, unit, text in (
        ("step", "s", "longest integration step of the plant"),
        ("measurement-rate", "Hz", "rate of the boards' measurements"),
        ("watchdog", "s", "watchdog time of the boards (default: from the CAN database)"),
        ("duration", "s", "time after which to end (default: only at a signal)"),
    ):
        metavar = unit.upper()
        add(f"--{name}", type=number(unit, above=0.0), metavar=metavar, help=f"{text} [{unit}]")
    for name, unit, text in (
        ("pressure-noise", "Pa", "standard deviation of the noise"),
        ("position-noise", "rad", "standard deviation of the noise"),
        ("pressure-quantum", "Pa", "resolution of the converter"),
        ("position-quantum", "rad", "resolution of the encoder"),
    ):
        metavar = unit.upper()
        add(f"--{name}", type=number(unit, least=0.0), metavar=metavar, help=f"{text} [{unit}]")
    add("--faults", default="", help="faults to inject: 'seconds name value=number; seconds name'")
    add("--seed", type=count(0), default=0, help="seed of the noise (default: %(default)s)")


def _node(arguments: Sequence[str] | None) -> int:
    from pam_sim.rig_node import main as run  # noqa: PLC0415  (rclpy)

    return run(arguments)


def _usage() -> NodeHelp:
    from pam_sim.rig_help import HELP  # noqa: PLC0415

    return HELP


NODE = NodeCommand(
    "node", "a simulated rig on a CAN bus, with faults to inject (a ROS node)", _node, _usage
)


COMMANDS = (
    NODE,
    Command(
        "rig",
        "run a simulated rig on a CAN bus, without ROS",
        _declare_rig,
        _rig,
        examples=(
            "pam sim rig --rig config/elbow.yaml --interface udp_multicast --channel 239.74.163.2",
        ),
    ),
)
TOOL = Tool("sim", "A simulated rig with valve boards, as a program and as a node", COMMANDS)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return the exit code."""
    return TOOL.run(arguments)


def rig_node() -> int:
    """Entry point of `ros2 run pam_sim pam_rig`."""
    return start_node(NODE)


if __name__ == "__main__":
    sys.exit(main())
