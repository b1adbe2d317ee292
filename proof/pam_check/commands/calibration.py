"""The command that calibrates drawn rigs whose files are off by a third."""

from __future__ import annotations

from pam_check.commands.common_arguments import add_seed
from pam_model.argument_types import count
from pam_model.command_line import Arguments, Command, Outcome, Parser
from pam_model.common_options import add_out


def _declare(parser: Parser) -> None:
    parser.add_argument(
        "--rigs",
        type=count(),
        default=12,
        metavar="N",
        help="number of rigs (default: %(default)s)",
    )
    parser.add_argument(
        "--first",
        type=count(0),
        default=0,
        metavar="K",
        help="number of the first one, to make a campaign in parts: the figures are of all rigs of "
        "the seed whose results are in the folder (default: %(default)s)",
    )
    add_seed(parser, 1)
    add_out(parser, "out/calibration")


def _run(given: Arguments) -> Outcome:
    from pam_check.calibration.campaign import run  # noqa: PLC0415  (scipy, numba)

    return run(given)


def _declare_commission(parser: Parser) -> None:
    parser.add_argument(
        "--rigs",
        type=count(),
        default=6,
        metavar="N",
        help="number of rigs (default: %(default)s)",
    )
    parser.add_argument(
        "--first",
        type=count(0),
        default=0,
        metavar="K",
        help="number of the first one, to share a campaign among processes (default: %(default)s)",
    )
    add_seed(parser, 1)
    add_out(parser, "out/commission")


def _run_commission(given: Arguments) -> Outcome:
    from pam_check.calibration.commission_campaign import run  # noqa: PLC0415  (scipy, numba)

    return run(given)


def _declare_wiring(parser: Parser) -> None:
    parser.add_argument(
        "--rigs",
        type=count(),
        default=30,
        metavar="N",
        help="number of rigs (default: %(default)s)",
    )
    add_seed(parser, 1)
    add_out(parser, "out/commission_wiring")


def _run_wiring(given: Arguments) -> Outcome:
    from pam_check.calibration.commission_campaign import run_wiring  # noqa: PLC0415

    return run_wiring(given)


COMMANDS = (
    Command(
        "calibrate",
        "calibrate drawn rigs whose files are off by a third, and compare with the truth",
        _declare,
        _run,
        bad_news="if numbers are off, intervals do not hold, or an exchange is not told",
        examples=("pam check calibrate --rigs 12 --seed 7",),
    ),
    Command(
        "commission",
        "commission drawn rigs whose files are off by a third, and compare with the true rig file",
        _declare_commission,
        _run_commission,
        bad_news="if a robot leaves a limit, or does not track and nothing says why",
        examples=("pam check commission --rigs 6 --seed 7",),
    ),
    Command(
        "commission-wiring",
        "only the start-up check of a commissioning, on drawn rigs with each exchange",
        _declare_wiring,
        _run_wiring,
        bad_news="if a rightly wired rig does not pass, or an exchange does",
        examples=("pam check commission-wiring --rigs 30 --seed 7",),
    ),
)
