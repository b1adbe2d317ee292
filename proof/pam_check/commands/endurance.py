"""Commands that run the suite for a long time, or end its processes many times."""

from __future__ import annotations

from pam_check.commands.common_arguments import add_one_process, add_seed
from pam_model.argument_types import count, number
from pam_model.command_line import Arguments, Command, Outcome, Parser
from pam_model.common_options import add_rig

LONGEST_SOAK = 24.0 * 14  # h


def _declare_kill_trials(parser: Parser) -> None:
    add_rig(parser)
    parser.add_argument(
        "--trials",
        type=count(),
        default=200,
        metavar="N",
        help="number of kills (default: %(default)s)",
    )
    add_one_process(parser)


def _kill_trials(given: Arguments) -> Outcome:
    from pam_check.endurance.kill_trials import run  # noqa: PLC0415

    return run(given)


def _declare_soak(parser: Parser) -> None:
    add_rig(parser)
    parser.add_argument(
        "--hours",
        type=number("h", above=0.0, most=LONGEST_SOAK),
        default=2.0,
        metavar="H",
        help="virtual time [h] (default: %(default)g)",
    )
    parser.add_argument(
        "--joints",
        type=count(),
        default=8,
        metavar="N",
        help="number of copies of the rig's first joint, one board each (default: %(default)s)",
    )


def _soak(given: Arguments) -> Outcome:
    from pam_check.endurance.soak import run  # noqa: PLC0415

    return run(given)


def _declare_lifecycle(parser: Parser) -> None:
    add_rig(parser)
    parser.add_argument(
        "--cycles", type=count(), default=1000, metavar="N", help="(default: %(default)s)"
    )
    parser.add_argument(
        "--unplugged",
        type=count(0),
        metavar="N",
        help="number of cycles without bus, none of the first ten (default: a fifth of --cycles)",
    )
    add_seed(parser, 0)


def _lifecycle(given: Arguments) -> Outcome:
    from pam_check.endurance.lifecycle_cycles_node import run  # noqa: PLC0415  (rclpy)

    return run(given)


COMMANDS = (
    Command(
        "kill-trials",
        "kill a driving process many times and measure how soon the boards vent",
        _declare_kill_trials,
        _kill_trials,
        bad_news="if a board vents too late",
    ),
    Command(
        "soak",
        "move many joints for hours of virtual time and look for leaks and drift",
        _declare_soak,
        _soak,
        bad_news="if anything is out of bounds",
    ),
    Command(
        "lifecycle",
        "configure, activate, deactivate and clean up a driver again and again",
        _declare_lifecycle,
        _lifecycle,
        bad_news="if threads, handles, sockets or memory grow",
    ),
)
