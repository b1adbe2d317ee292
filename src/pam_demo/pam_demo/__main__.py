"""`pam demo`: the demo, and `close-loop`, from a hidden effect to better tracking."""

# PYTHON_ARGCOMPLETE_OK: shells with argcomplete complete its commands and options

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import sys

from pam_model.argument_types import count, input_file, number
from pam_model.command_line import Arguments, Command, Outcome, Parser, Tool
from pam_model.common_options import add_namespace, add_out, add_rig, add_tolerances

DEFAULT_EFFECT = "coulomb_friction.torque=0.5"
EFFECT = "EFFECT.PARAMETER=VALUE"


def _demo(given: Arguments) -> Outcome:
    from pam_demo.demo import run  # noqa: PLC0415  (matplotlib)
    from pam_demo.player_node import open_player  # noqa: PLC0415  (rclpy)

    return run(given, open_player)


def _declare_demo(parser: Parser) -> None:
    add_rig(parser)
    _add_can(parser)
    _add_rate(parser, "the highest of 500, 250 and 125 that this computer holds")
    _add_separate(parser)
    parser.add_argument(
        "--joint", default="", metavar="NAME", help="the joint that moves (default: the first)"
    )
    add_out(parser, "out/demo")
    parser.add_argument(
        "--no-baselines", action="store_true", help="play with the full controller only"
    )
    parser.add_argument(
        "--short", action="store_true", help="only the arm's motion and the chirp, full controller"
    )
    parser.add_argument(
        "--firmware",
        type=input_file,
        metavar="PROGRAM",
        help="host build of firmware/ that runs as each valve board (default: boards in Python)",
    )
    parser.add_argument(
        "--true-rig",
        type=input_file,
        metavar="FILE",
        help="rig file of the simulated plant alone (default: --rig)",
    )
    parser.add_argument(
        "--true-effects",
        nargs="+",
        default=[],
        metavar=EFFECT,
        help="effects that are applied to the plant and hidden from all other nodes",
    )


def _close_loop(given: Arguments) -> Outcome:
    from pam_demo.close_loop import run  # noqa: PLC0415  (scipy, matplotlib)

    return run(given)


def _declare_close_loop(parser: Parser) -> None:
    add_rig(parser)
    parser.add_argument(
        "--hide",
        nargs="+",
        default=[DEFAULT_EFFECT],
        metavar=EFFECT,
        help=f"effects of the simulated rig that its rig file omits (default: {DEFAULT_EFFECT})",
    )
    parser.add_argument(
        "--runs",
        type=count(1),
        default=1,
        metavar="N",
        help="runs before and after the diagnosis, whose errors are given as medians "
        "(default: %(default)s)",
    )
    add_out(parser, "out/close_loop")
    _add_can(parser)


def _robot(given: Arguments) -> Outcome:
    from pam_demo.robot import run  # noqa: PLC0415  (matplotlib)

    return run(given)


def _declare_robot(parser: Parser) -> None:
    add_rig(parser)
    _add_can(parser)
    _add_rate(parser, "500; fewer on a slow computer")
    _add_separate(parser)
    parser.add_argument(
        "--true-effects",
        nargs="+",
        default=[],
        metavar=EFFECT,
        help="effects of the simulated robot that its rig file omits",
    )
    add_out(parser, "out/robot")


def _commission(given: Arguments) -> Outcome:
    from pam_demo.commission.commission import run  # noqa: PLC0415  (scipy, numba)
    from pam_demo.commission.ros_port_node import open_ros_port  # noqa: PLC0415  (rclpy)

    return run(given, open_ros_port)


def _declare_commission(parser: Parser) -> None:
    add_rig(parser, required=True)
    add_out(parser)
    parser.add_argument(
        "--joint", default="", metavar="NAME", help="the joint (default: the first)"
    )
    add_namespace(parser)
    parser.add_argument(
        "--rate",
        type=number("Hz", least=50.0, most=1000.0),
        default=250.0,
        metavar="HZ",
        help="rate of the commands [Hz] (default: %(default)g)",
    )
    add_tolerances(parser)
    parser.add_argument(
        "--simulate",
        type=input_file,
        metavar="FILE",
        help="commission a simulated robot, which has the numbers of this rig file",
    )
    parser.add_argument(
        "--crossed-hoses", action="store_true", help="the simulated robot has two hoses crossed"
    )
    parser.add_argument("--yes", action="store_true", help="do not ask before every step")


def _add_separate(parser: Parser) -> None:
    parser.add_argument(
        "--separate",
        action="store_true",
        help="driver, model and controller are processes of their own (default: one process)",
    )


def _add_rate(parser: Parser, default: str) -> None:
    parser.add_argument(
        "--rate",
        type=number("Hz", least=50.0, most=1000.0),
        metavar="HZ",
        help=f"rate of the loops of driver and controller [Hz] (default: {default})",
    )


def _add_can(parser: Parser) -> None:
    parser.add_argument(
        "--can",
        default="",
        metavar="INTERFACE",
        help="CAN interface (default: vcan0 where it is up, else loopback multicast)",
    )


COMMANDS = (
    Command(
        "run",
        "run the whole suite on a simulated rig and report the tracking errors on a page",
        _declare_demo,
        _demo,
        bad_news="if a target is missed",
        examples=("pam demo --rig my_robot.yaml --no-baselines",),
    ),
    Command(
        "close-loop",
        "hide an effect, diagnose the demo's recording, run it again with the improved rig file",
        _declare_close_loop,
        _close_loop,
        bad_news="if a motion is not followed more closely than before",
        examples=("pam demo close-loop --hide valve_dead_zone.overlap=0.1",),
    ),
    Command(
        "commission",
        "find the numbers of a running robot with a rough rig file, in safe steps, until it tracks",
        _declare_commission,
        _commission,
        bad_news="if it was ended before the joint tracks",
        examples=(
            "pam demo commission --rig rough.yaml --out out/commission",
            "pam demo commission --rig rough.yaml --simulate config/elbow.yaml --yes --out OUT",
        ),
    ),
    Command(
        "robot",
        "run a simulated robot until Ctrl-C, for nodes of your own, without ros2 launch",
        _declare_robot,
        _robot,
        examples=("pam demo robot --true-effects coulomb_friction.torque=0.6",),
    ),
)


TOOL = Tool("demo", "Demonstrations of the whole suite on a simulated rig", COMMANDS, default="run")

main = TOOL.run


if __name__ == "__main__":
    sys.exit(main())
