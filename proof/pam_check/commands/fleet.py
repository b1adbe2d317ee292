"""The command that checks the tracking of a fleet on a simulated robot."""

from __future__ import annotations

from pam_model.argument_types import count, number
from pam_model.command_line import Arguments, Command, Outcome, Parser
from pam_model.common_options import add_out


def _declare(parser: Parser) -> None:
    for name, default, text in (
        ("--recordings", 24, "number of recordings (default: %(default)s)"),
        ("--seed", 1, "seed of all random draws (default: %(default)s)"),
        ("--workers", 1, "number of parallel diagnoses (default: %(default)s)"),
    ):
        parser.add_argument(name, type=count(), default=default, metavar="N", help=text)
    for option, usual, unit, words in (
        ("--weeks", 8.0, "weeks", "time from the first to the last recording"),
        ("--duration", 12.0, "s", "length of a recording [s]"),
    ):
        parser.add_argument(
            option,
            type=number(unit, above=0.0),
            default=usual,
            metavar="X",
            help=f"{words} (default: {usual:g})",
        )
    parser.add_argument(
        "--full-every",
        type=number("days", least=0.0),
        default=0.0,
        metavar="DAYS",
        help="as for `fleet` of the tool gap (default: 0, diagnose all in full)",
    )
    add_out(parser, "out/fleet_check")


def _run(given: Arguments) -> Outcome:
    from pam_check.blind.fleet_over_weeks import run  # noqa: PLC0415  (scipy, numba, Dask)

    return run(given)


COMMANDS = (
    Command(
        "fleet",
        "record a robot over weeks with one growing and one repaired effect, and find both",
        _declare,
        _run,
        bad_news="if a change is not found at the right week",
        examples=("pam check fleet --recordings 60 --workers 2",),
    ),
)
