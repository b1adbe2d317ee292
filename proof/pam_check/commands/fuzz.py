"""Commands that feed random input into the suite."""

from __future__ import annotations

from pam_check.commands.common_arguments import add_inputs, add_one_process, add_seed
from pam_model.argument_types import number, output_folder
from pam_model.command_line import Arguments, Command, Outcome, Parser
from pam_model.common_options import add_rig


def _declare_fuzz(parser: Parser) -> None:
    parser.add_argument(
        "target",
        metavar="TARGET",
        help="frames, driver, board, commands, references, measurements, injections, files or all",
    )
    add_rig(parser)
    add_inputs(parser)
    parser.add_argument(
        "--corpus",
        type=output_folder,
        default="out/fuzz",
        metavar="FOLDER",
        help="file with the seeds of failed blocks (default: %(default)s)",
    )


def _fuzz(given: Arguments) -> Outcome:
    from pam_check.fuzz.fuzz_run import run  # noqa: PLC0415

    return run(given)


def _declare_fuzz_callbacks(parser: Parser) -> None:
    add_rig(parser)
    add_inputs(parser)


def _fuzz_callbacks(given: Arguments) -> Outcome:
    from pam_check.fuzz.callbacks_node import run  # noqa: PLC0415  (rclpy)
    from pam_control.controller_node import ControllerNode  # noqa: PLC0415
    from pam_driver.driver_node import DriverNode  # noqa: PLC0415
    from pam_gap.live.monitor_node import MonitorNode  # noqa: PLC0415
    from pam_model.model_node import ModelNode  # noqa: PLC0415
    from pam_sim.rig_node import RigNode  # noqa: PLC0415

    return run(given, (DriverNode, ControllerNode, ModelNode, RigNode, MonitorNode))


def _declare_fuzz_topics(parser: Parser) -> None:
    add_rig(parser)
    parser.add_argument(
        "--seconds",
        type=number("s", least=1.0, most=1e6),
        default=60.0,
        help="how long (default: %(default)s)",
    )
    add_seed(parser, 0)
    add_one_process(parser)


def _fuzz_topics(given: Arguments) -> Outcome:
    from pam_check.faults.operator_node import open_operator  # noqa: PLC0415  (rclpy)
    from pam_check.fuzz.topics_node import run  # noqa: PLC0415

    return run(given, open_operator)


COMMANDS = (
    Command(
        "fuzz",
        "feed random and mutated input into an interface of the suite",
        _declare_fuzz,
        _fuzz,
        bad_news="if anything failed",
        examples=("pam check fuzz frames --count 10000000",),
    ),
    Command(
        "fuzz-callbacks",
        "feed random messages into the callbacks of the nodes",
        _declare_fuzz_callbacks,
        _fuzz_callbacks,
        bad_news="if anything failed",
    ),
    Command(
        "fuzz-topics",
        "send spoilt bytes to every subscription of a running chain",
        _declare_fuzz_topics,
        _fuzz_topics,
        bad_news="if a process ended or wrote a traceback, or the arm left its bounds",
        examples=("pam check fuzz-topics --seconds 600",),
    ),
)
