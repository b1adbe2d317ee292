"""Commands that inject faults and delays into a simulated rig."""

from __future__ import annotations

from pam_check.commands.common_arguments import add_jobs, add_kinds, add_one_process, add_seed
from pam_model.argument_types import count, output_file
from pam_model.command_line import Arguments, Command, Outcome, Parser
from pam_model.common_options import add_out, add_rig


def _declare_faults(parser: Parser) -> None:
    add_rig(parser)
    parser.add_argument(
        "--trials",
        type=count(),
        metavar="N",
        help="number of injections in total (default: 1000 for all kinds)",
    )
    add_kinds(parser)
    add_one_process(parser)
    add_seed(parser, 1)
    add_jobs(parser)
    add_out(parser, "out/faults")
    parser.add_argument(
        "--page",
        type=output_file,
        metavar="FILE",
        help="also write the table to this file, for the docs",
    )


def _faults(given: Arguments) -> Outcome:
    from pam_check.faults.campaign import run  # noqa: PLC0415

    return run(given)


def _declare_delays(parser: Parser) -> None:
    add_rig(parser)
    parser.add_argument(
        "--draws", type=count(), default=500, metavar="N", help="(default: %(default)s)"
    )
    add_seed(parser, 1)
    add_jobs(parser)
    parser.add_argument(
        "--out",
        type=output_file,
        default="out/faults/delays.csv",
        metavar="FILE",
        help="table of all draws (default: %(default)s)",
    )
    parser.add_argument(
        "--resume", action="store_true", help="go on with the table of a run that was interrupted"
    )


def _delays(given: Arguments) -> Outcome:
    from pam_check.faults.delay_draws import run  # noqa: PLC0415

    return run(given)


def _declare_processes(parser: Parser) -> None:
    add_rig(parser)
    add_kinds(parser)
    add_one_process(parser)
    parser.add_argument(
        "--out",
        type=output_file,
        default="out/faults/processes.md",
        metavar="FILE",
        help="page with the table (default: %(default)s)",
    )


def _processes(given: Arguments) -> Outcome:
    from pam_check.faults.operator_node import open_operator  # noqa: PLC0415  (rclpy)
    from pam_check.faults.process_campaign import run  # noqa: PLC0415

    return run(given, open_operator)


COMMANDS = (
    Command(
        "faults",
        "inject every fault many times on a virtual clock and compare with the stated bounds",
        _declare_faults,
        _faults,
        bad_news="if a fault is out of bounds",
        examples=(
            "pam check faults --kind encoder_stuck --trials 50",
            "pam check faults --rig config/elbow_canopen.yaml",
        ),
    ),
    Command(
        "delays",
        "draw delays and hidden effects: the joint must stay slow enough, and track or stop",
        _declare_delays,
        _delays,
        bad_news="if a joint is too fast, or neither tracks nor stops",
    ),
    Command(
        "processes",
        "inject the rig's faults on real processes over a bus and ROS",
        _declare_processes,
        _processes,
        bad_news="if a fault is out of bounds",
    ),
)
