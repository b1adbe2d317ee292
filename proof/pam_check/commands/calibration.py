"""The commands that calibrate and commission drawn rigs whose files are off by a third."""

from __future__ import annotations

from collections.abc import Callable

from pam_check.commands.common_arguments import add_seed
from pam_model.argument_types import count
from pam_model.command_line import Arguments, Command, Outcome, Parser
from pam_model.common_options import add_out

FIRST = "number of the first one, to make a campaign in parts"
OF_THE_FOLDER = f"{FIRST}: the figures are of all of the seed whose results are in the folder"


def _declare(rigs: int, out: str, first: str = FIRST) -> Callable[[Parser], None]:
    """Declare the options of a campaign; without the text about the first rig, it begins at 0."""

    def declare(parser: Parser) -> None:
        parser.add_argument(
            "--rigs", type=count(), default=rigs, metavar="N",
            help="how many are drawn (default: %(default)s)",
        )  # fmt: skip
        if first:
            parser.add_argument(
                "--first", type=count(0), default=0, metavar="K",
                help=f"{first} (default: %(default)s)",
            )  # fmt: skip
        add_seed(parser, 1)
        add_out(parser, out)

    return declare


def _run(given: Arguments) -> Outcome:
    from pam_check.calibration.campaign import run  # noqa: PLC0415  (scipy, numba)

    return run(given)


def _run_bench(given: Arguments) -> Outcome:
    from pam_check.calibration.bench_diagnoses import run  # noqa: PLC0415  (scipy, numba)

    return run(given)


def _run_commission(given: Arguments) -> Outcome:
    from pam_check.calibration.commission_campaign import run  # noqa: PLC0415  (scipy, numba)

    return run(given)


def _run_over_ros(given: Arguments) -> Outcome:
    from pam_check.calibration.commission_over_ros import run  # noqa: PLC0415  (scipy, numba)
    from pam_demo.commission.ros_port_node import open_ros_port  # noqa: PLC0415  (rclpy)

    return run(given, open_ros_port)


def _run_wiring(given: Arguments) -> Outcome:
    from pam_check.calibration.commission_campaign import run_wiring  # noqa: PLC0415

    return run_wiring(given)


COMMANDS = (
    Command(
        "calibrate",
        "calibrate drawn rigs whose files are off by a third, and compare with the truth",
        _declare(12, "out/calibration", OF_THE_FOLDER),
        _run,
        bad_news="if numbers are off, intervals do not hold, or an exchange is not told",
        examples=("pam check calibrate --rigs 12 --seed 7",),
    ),
    Command(
        "bench-diagnosis",
        "calibrate and diagnose drawn muscles on a bench: moved, held, with weight or spring",
        _declare(24, "out/bench_diagnosis", OF_THE_FOLDER),
        _run_bench,
        examples=("pam check bench-diagnosis --rigs 8 --seed 1",),
        bad_news="if more than one muscle in twelve is wrong",
    ),
    Command(
        "commission",
        "commission drawn rigs whose files are off by a third, and compare with the true rig file",
        _declare(6, "out/commission"),
        _run_commission,
        bad_news="if a robot leaves a limit, or does not track and nothing says why",
        examples=("pam check commission --rigs 6 --seed 7",),
    ),
    Command(
        "commission-over-ros",
        "commission drawn rigs over ROS topics, and compare with the true rig file",
        _declare(3, "out/commission_over_ros"),
        _run_over_ros,
        bad_news="if a robot leaves a limit, takes ten minutes, or does not track and nothing says "
        "why",
        examples=("pam check commission-over-ros --rigs 3 --seed 7",),
    ),
    Command(
        "commission-wiring",
        "only the start-up check of a commissioning, on drawn rigs with each exchange",
        _declare(30, "out/commission_wiring", ""),
        _run_wiring,
        bad_news="if a rightly wired rig does not pass, or an exchange does",
        examples=("pam check commission-wiring --rigs 30 --seed 7",),
    ),
)
