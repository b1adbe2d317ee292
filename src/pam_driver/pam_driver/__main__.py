"""`pam driver`: tools for the buses and boards of a robot."""

# PYTHON_ARGCOMPLETE_OK: shells with argcomplete complete its commands and options

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pam_driver.board_rules.command import CHECK_BOARD
from pam_model.argument_types import count, input_file, number
from pam_model.command_line import (
    Arguments,
    Command,
    NodeCommand,
    Outcome,
    Parser,
    Tool,
)
from pam_model.common_options import add_bus, add_dbc

if TYPE_CHECKING:
    from pam_ros.node_help import NodeHelp


def _check_rig(given: Arguments) -> Outcome:
    from pam_driver.tools.check_rig import run  # noqa: PLC0415  (cantools)

    return run(given)


def _declare_check_rig(parser: Parser) -> None:
    add = parser.add_argument
    add("rig_file", type=input_file, metavar="RIG", help="rig file")
    add(
        "--rate",
        type=number("Hz", above=0.0),
        default=500.0,
        metavar="HZ",
        help="cycles of the driver in a second (default: %(default)g)",
    )
    add(
        "--bitrate",
        type=count(10_000, 1_000_000),
        default=1_000_000,
        metavar="BIT/S",
        help="of the only bus, if the rig file describes none (default: %(default)d)",
    )
    add_dbc(parser)


def _scan(given: Arguments) -> Outcome:
    from pam_driver.tools.scan import run  # noqa: PLC0415  (python-can)

    return run(given)


def _declare_listening(parser: Parser, seconds: float) -> None:
    add_bus(parser)
    parser.add_argument(
        "--duration",
        type=number("s", above=0.0),
        default=seconds,
        metavar="S",
        help="how long to listen [s] (default: %(default)g)",
    )


def _declare_scan(parser: Parser) -> None:
    _declare_listening(parser, 2.0)
    parser.add_argument("--fd", action="store_true", help="the bus carries CAN FD frames")
    parser.add_argument(
        "--identify",
        action="store_true",
        help="ask every CANopen node for its identity (SDO, reading only); without it, nothing is "
        "sent",
    )


def _monitor(given: Arguments) -> Outcome:
    from pam_driver.tools.monitor import run  # noqa: PLC0415  (python-can)

    return run(given)


def _declare_monitor(parser: Parser) -> None:
    add = parser.add_argument
    add("rig_file", type=input_file, metavar="RIG", help="rig file")
    _declare_listening(parser, 10.0)
    add(
        "--period",
        type=number("s", above=0.0),
        default=0.5,
        metavar="S",
        help="time between two lines (default: %(default)g)",
    )
    add_dbc(parser)


def _set(given: Arguments) -> Outcome:
    from pam_driver.tools.set_valve import run  # noqa: PLC0415  (python-can)

    return run(given)


def _declare_set(parser: Parser) -> None:
    add = parser.add_argument
    add("rig_file", type=input_file, metavar="RIG", help="rig file")
    add("board", metavar="BOARD", help="board of the valve, as the rig file names it")
    add("channel_name", metavar="CHANNEL", help="channel of the valve")
    add(
        "percent",
        type=number("%"),
        metavar="PERCENT",
        help="set point in percent of full scale; a flow valve takes -100 to 100",
    )
    add_bus(parser)
    add(
        "--duration",
        type=number("s", above=0.0, most=10.0),
        default=1.0,
        metavar="S",
        help="how long the valve follows, at most 10 s (default: %(default)g)",
    )
    add(
        "--limit",
        type=number("Pa", above=0.0),
        default=100e3,
        metavar="PA",
        help="gauge pressure at which it vents at once (default: %(default)g)",
    )
    add("--yes", action="store_true", help="do not ask")
    add_dbc(parser)


def _node(arguments: Sequence[str] | None) -> int:
    from pam_driver.driver_node import main as run  # noqa: PLC0415  (rclpy)

    return run(arguments)


def _usage() -> NodeHelp:
    from pam_driver.driver_parameters import HELP  # noqa: PLC0415

    return HELP


NODE = NodeCommand("node", "drive the valve boards of a robot (a ROS node)", _node, _usage)


COMMANDS = (
    NODE,
    Command(
        "check-rig",
        "check rig file, DBC files, identifiers and bus load without a bus, and show the wiring",
        _declare_check_rig,
        _check_rig,
        bad_news="if a bus would carry too much, or measurements come too rarely",
        examples=("pam driver check-rig config/two_buses.yaml",),
    ),
    Command(
        "scan",
        "list what sends on a bus: boards, CANopen nodes, unknown frames; only listens by default",
        _declare_scan,
        _scan,
        bad_news="if nothing was received",
        examples=(
            "pam driver scan --channel can0",
            "pam driver scan --channel can0 --identify",
        ),
    ),
    Command(
        "monitor",
        "show the measurements of a robot's boards, decoded by its rig file; sends nothing",
        _declare_monitor,
        _monitor,
        bad_news="if a board is missing or something is wrong",
        examples=("pam driver monitor config/elbow.yaml --channel can0",),
    ),
    Command(
        "set",
        "give one valve a set point for a moment, after a question; for bringing up a robot",
        _declare_set,
        _set,
        bad_news="if it ended early",
        examples=("pam driver set config/elbow_canopen.yaml outputs flexor 10",),
    ),
    CHECK_BOARD,
)


TOOL = Tool("driver", "Tools for the buses and boards of a robot, and the driver node", COMMANDS)

main = TOOL.run
driver_node = NODE.start  # `ros2 run pam_driver pam_driver_node`


if __name__ == "__main__":
    sys.exit(main())
