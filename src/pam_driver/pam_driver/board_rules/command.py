"""The command that tests a valve board."""

from __future__ import annotations

from pam_model.argument_types import count, number, output_file
from pam_model.command_line import Arguments, Command, Outcome, Parser
from pam_model.common_options import add_bus, add_dbc


def _declare(parser: Parser) -> None:
    add = parser.add_argument
    add_bus(parser)
    parser.set_defaults(interface="socketcan", channel="can0")
    add("--bitrate", type=count(10_000), default=1_000_000, help="[bit/s] (default: %(default)s)")
    add_dbc(parser)
    add(
        "--with-canopen",
        action="store_true",
        help="the board uses the identifiers that share a bus with CANopen devices",
    )
    add("--board", type=count(0), default=0, help="number of the board (default: %(default)s)")
    add("--yes", action="store_true", help="open the valves without asking")
    add("--no-air", action="store_true", help="only the rules that do not open the valves")
    add(
        "--opening",
        type=number("", above=0.0, most=1.0),
        default=0.2,
        metavar="X",
        help="valve command that fills, as a fraction of full scale (default: %(default)g)",
    )
    add(
        "--max-pressure",
        type=number("Pa", least=60_000.0),
        default=150_000.0,
        metavar="PA",
        help="the test vents above this pressure [Pa gauge] (default: %(default)g)",
    )
    add(
        "--over-pressure",
        type=number("Pa", above=0.0),
        metavar="PA",
        help="the board's own limit [Pa gauge]; the test fills channel 0 up to 10 %% more "
        "(default: this rule is not tried)",
    )
    add(
        "--person",
        action="store_true",
        help="ask a person to switch the board off and on, and to press and release its emergency "
        "stop and enabling switch if it has them",
    )
    add(
        "--tolerance",
        type=number("s", least=0.0, most=0.1),
        default=0.005,
        metavar="S",
        help="how late this computer and its bus may be [s] (default: %(default)g)",
    )
    add(
        "--out",
        type=output_file,
        default="out/board/board.html",
        metavar="FILE",
        help="page with the result, HTML or .md (default: %(default)s)",
    )


def _check_board(given: Arguments) -> Outcome:
    from pam_driver.board_rules.conformance import run  # noqa: PLC0415

    return run(given)


CHECK_BOARD = Command(
    "check-board",
    "play every rule of docs/can_protocol.md against a valve board on a bus",
    _declare,
    _check_board,
    bad_news="if the board breaks a rule",
    examples=(
        "pam driver check-board --channel can0 --board 0",
        "pam driver check-board --interface udp_multicast --channel 239.74.163.2 --yes",
    ),
)
