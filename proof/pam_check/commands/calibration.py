"""The command that calibrates drawn rigs whose files are off by a third."""

from __future__ import annotations

from pam_check.commands.common_arguments import add_seed
from pam_model.argument_types import count, output_folder
from pam_model.command_line import Arguments, Command, Outcome, Parser


def _declare(parser: Parser) -> None:
    parser.add_argument(
        "--rigs",
        type=count(),
        default=12,
        metavar="N",
        help="number of rigs (default: %(default)s)",
    )
    add_seed(parser, 1)
    parser.add_argument(
        "--out", type=output_folder, default="out/calibration", help="folder (default: %(default)s)"
    )


def _run(given: Arguments) -> Outcome:
    from pam_check.calibration.campaign import run  # noqa: PLC0415  (scipy, numba)

    return run(given)


COMMANDS = (
    Command(
        "calibrate",
        "calibrate drawn rigs whose files are off by a third, and compare with the truth",
        _declare,
        _run,
        bad_news="if numbers are off, intervals do not hold, or an exchange is not told",
        examples=("pam check calibrate --rigs 12 --seed 7",),
    ),
)
