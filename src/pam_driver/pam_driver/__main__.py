"""`python -m pam_driver`: tools for the buses and boards of a robot."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from pam_model.argument_types import count, input_file, number
from pam_model.command_line import Arguments, Command, Outcome, Parser, run_program


def _check_rig(given: Arguments) -> Outcome:
    from pam_driver.check_rig import run  # noqa: PLC0415  (cantools)

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
    add("--dbc", type=input_file, metavar="FILE", help="CAN database of boards of kind pam_board")


COMMANDS = (
    Command(
        "check-rig",
        "check rig file, DBC files, identifiers and bus load without a bus, and show the wiring",
        _declare_check_rig,
        _check_rig,
        bad_news="if a bus would carry too much",
        examples=("python -m pam_driver check-rig config/two_buses.yaml",),
    ),
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return the exit code."""
    description = "Tools for the buses and boards of a robot. The node is: ros2 run pam_driver"
    return run_program("python -m pam_driver", description, COMMANDS, arguments)


if __name__ == "__main__":
    sys.exit(main())
