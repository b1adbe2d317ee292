"""`python -m pam_check`: checks of the whole suite, from fault campaigns to blind diagnosis."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from pam_model.argument_types import (
    count,
    input_file,
    input_path,
    number,
    output_file,
    output_folder,
)
from pam_model.command_line import Arguments, Command, Outcome, Parser, add_rig, run_program

LONGEST_SOAK = 24.0 * 14  # h


def _faults(given: Arguments) -> Outcome:
    from pam_check.faults.campaign import run  # noqa: PLC0415

    return run(given)


def _declare_faults(parser: Parser) -> None:
    add_rig(parser)
    parser.add_argument(
        "--trials",
        type=count(),
        metavar="N",
        help="number of injections in total (default: 1000 for all kinds)",
    )
    _add_kinds(parser)
    _add_seed(parser, 1)
    _add_jobs(parser)
    parser.add_argument(
        "--out", type=output_folder, default="out/faults", help="folder (default: %(default)s)"
    )
    parser.add_argument(
        "--page",
        type=output_file,
        metavar="FILE",
        help="also write the table to this file, for the docs",
    )


def _delays(given: Arguments) -> Outcome:
    from pam_check.faults.delay_draws import run  # noqa: PLC0415

    return run(given)


def _declare_delays(parser: Parser) -> None:
    add_rig(parser)
    parser.add_argument(
        "--draws", type=count(), default=500, metavar="N", help="(default: %(default)s)"
    )
    _add_seed(parser, 1)
    _add_jobs(parser)
    parser.add_argument(
        "--out",
        type=output_file,
        default="out/faults/delays.csv",
        metavar="FILE",
        help="table of all draws (default: %(default)s)",
    )


def _processes(given: Arguments) -> Outcome:
    from pam_check.faults.operator_node import open_operator  # noqa: PLC0415  (rclpy)
    from pam_check.faults.process_campaign import run  # noqa: PLC0415

    return run(given, open_operator)


def _declare_processes(parser: Parser) -> None:
    add_rig(parser)
    _add_kinds(parser)
    parser.add_argument(
        "--out",
        type=output_file,
        default="out/faults/processes.md",
        metavar="FILE",
        help="page with the table (default: %(default)s)",
    )


def _board(given: Arguments) -> Outcome:
    from pam_check.boards.conformance import run  # noqa: PLC0415

    return run(given)


def _declare_board(parser: Parser) -> None:
    add = parser.add_argument
    add("--interface", default="socketcan", help="python-can's interface (default: %(default)s)")
    add("--channel", default="can0", help="python-can's channel (default: %(default)s)")
    add("--bitrate", type=count(10_000), default=1_000_000, help="[bit/s] (default: %(default)s)")
    add("--port", type=count(1, 65535), help="UDP port, used by udp_multicast only")
    add("--dbc", type=input_file, metavar="FILE", help="CAN database (default: the driver's own)")
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


def _kill_trials(given: Arguments) -> Outcome:
    from pam_check.endurance.kill_trials import run  # noqa: PLC0415

    return run(given)


def _declare_kill_trials(parser: Parser) -> None:
    add_rig(parser)
    parser.add_argument(
        "--trials",
        type=count(),
        default=200,
        metavar="N",
        help="number of kills (default: %(default)s)",
    )


def _soak(given: Arguments) -> Outcome:
    from pam_check.endurance.soak import run  # noqa: PLC0415

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


def _lifecycle(given: Arguments) -> Outcome:
    from pam_check.endurance.lifecycle_cycles_node import run  # noqa: PLC0415  (rclpy)

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
    _add_seed(parser, 0)


def _fuzz(given: Arguments) -> Outcome:
    from pam_check.fuzz.inputs import run  # noqa: PLC0415

    return run(given)


def _declare_fuzz(parser: Parser) -> None:
    parser.add_argument(
        "target",
        metavar="TARGET",
        help="frames, driver, board, commands, references, measurements, injections or all",
    )
    add_rig(parser)
    _add_inputs(parser)
    parser.add_argument(
        "--corpus",
        type=output_folder,
        default="out/fuzz",
        metavar="FOLDER",
        help="file with the seeds of failed blocks (default: %(default)s)",
    )


def _fuzz_callbacks(given: Arguments) -> Outcome:
    from pam_check.fuzz.callbacks_node import run  # noqa: PLC0415  (rclpy)
    from pam_control.controller_node import ControllerNode  # noqa: PLC0415
    from pam_driver.driver_node import DriverNode  # noqa: PLC0415
    from pam_gap.live.monitor_node import MonitorNode  # noqa: PLC0415
    from pam_model.model_node import ModelNode  # noqa: PLC0415
    from pam_sim.rig_node import RigNode  # noqa: PLC0415

    return run(given, (DriverNode, ControllerNode, ModelNode, RigNode, MonitorNode))


def _declare_fuzz_callbacks(parser: Parser) -> None:
    add_rig(parser)
    _add_inputs(parser)


def _security(given: Arguments) -> Outcome:
    from pam_check.security.policy import run  # noqa: PLC0415

    return run(given)


def _declare_security(parser: Parser) -> None:
    parser.add_argument("file", type=output_file, help="where to write the policy (XML)")
    add_rig(parser)


def _security_check(given: Arguments) -> Outcome:
    from pam_check.security.check_node import run  # noqa: PLC0415  (rclpy)

    return run(given)


def _blind(given: Arguments) -> Outcome:
    from pam_check.blind.campaign import run  # noqa: PLC0415  (scipy, matplotlib)

    return run(given)


def _declare_blind(parser: Parser) -> None:
    parser.add_argument(
        "--cases",
        type=count(),
        default=24,
        metavar="N",
        help="number of rigs to draw (default: %(default)s)",
    )
    parser.add_argument(
        "--seed",
        type=count(0),
        metavar="N",
        help="seed of all random draws (default: from the clock)",
    )
    parser.add_argument(
        "--out", type=output_folder, default="out/blind", help="folder (default: %(default)s)"
    )
    parser.add_argument(
        "--workers",
        type=count(),
        default=os.cpu_count() or 1,
        metavar="N",
        help="number of parallel diagnoses (default: one per processor)",
    )
    parser.add_argument(
        "--experiments",
        action="store_true",
        help="run the experiments that ambiguous diagnoses propose, and diagnose again",
    )
    parser.add_argument(
        "--keep-evidence",
        action="store_true",
        help="keep the evidence that `sensitivity` needs to decide every case again",
    )
    parser.add_argument(
        "--background",
        action="store_true",
        help="draw rigs as they are: each with an ordinary background of small imperfections",
    )


def _sensitivity(given: Arguments) -> Outcome:
    from pam_check.blind.sensitivity import run  # noqa: PLC0415  (scipy, numba)

    return run(given)


def _declare_sensitivity(parser: Parser) -> None:
    parser.add_argument(
        "folder", type=input_path, help="the --out folder of `blind --keep-evidence`"
    )
    parser.add_argument(
        "--percent",
        type=number("%", above=0.0, most=95.0),
        default=30.0,
        metavar="P",
        help="change of each constant, downwards and upwards [%%] (default: %(default)g)",
    )
    parser.add_argument(
        "--rediagnose",
        type=count(0),
        default=0,
        metavar="N",
        help="number of cases to diagnose again for each constant that acts before the decision "
        "(default: 0, such constants are skipped)",
    )
    parser.add_argument(
        "--only",
        action="append",
        default=[],
        metavar="CONSTANT",
        help="only this constant, for example decision.no_gap; may be given several times",
    )
    parser.add_argument(
        "--workers",
        type=count(),
        default=1,
        metavar="N",
        help="number of parallel diagnoses (default: 1)",
    )


def _state_walk(given: Arguments) -> Outcome:
    from pam_check.state_walk.walk import run  # noqa: PLC0415

    return run(given)


def _add_kinds(parser: Parser) -> None:
    parser.add_argument(
        "--kind", action="append", help="only this fault; may be given several times"
    )


def _add_jobs(parser: Parser) -> None:
    parser.add_argument(
        "--jobs",
        type=count(),
        default=os.cpu_count() or 1,
        metavar="N",
        help="number of trials at the same time (default: the number of processors)",
    )


def _add_seed(parser: Parser, default: int) -> None:
    parser.add_argument(
        "--seed",
        type=count(0),
        default=default,
        metavar="N",
        help="seed of all random draws (default: %(default)s)",
    )


def _add_inputs(parser: Parser) -> None:
    parser.add_argument(
        "--count",
        type=count(),
        default=100_000,
        metavar="N",
        help="number of inputs, run in blocks of a thousand (default: %(default)s)",
    )
    _add_seed(parser, 0)


COMMANDS = (
    Command(
        "faults",
        "inject every fault many times on a virtual clock and compare with the stated bounds",
        _declare_faults,
        _faults,
        bad_news="if a fault is out of bounds",
        examples=("python -m pam_check faults --kind encoder_stuck --trials 50",),
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
    Command(
        "board",
        "play every rule of docs/can_protocol.md against a valve board on a bus",
        _declare_board,
        _board,
        bad_news="if the board breaks a rule",
        examples=(
            "python -m pam_check board --channel can0 --board 0",
            "python -m pam_check board --interface udp_multicast --channel 239.74.163.2 --yes",
        ),
    ),
    Command(
        "kill-trials",
        "kill a driving process many times and measure how soon the boards vent",
        _declare_kill_trials,
        _kill_trials,
        bad_news="if a board vents too late",
    ),
    Command(
        "state-walk",
        "visit every state of driver, board and controller and look for a way round a stop",
        add_rig,
        _state_walk,
        bad_news="if air can move after a stop or fault without the acts that it needs",
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
    Command(
        "fuzz",
        "feed random and mutated input into an interface of the suite",
        _declare_fuzz,
        _fuzz,
        bad_news="if anything failed",
        examples=("python -m pam_check fuzz frames --count 10000000",),
    ),
    Command(
        "fuzz-callbacks",
        "feed random messages into the callbacks of the nodes",
        _declare_fuzz_callbacks,
        _fuzz_callbacks,
        bad_news="if anything failed",
    ),
    Command(
        "security",
        "write the SROS 2 policy of a rig",
        _declare_security,
        _security,
        examples=("python -m pam_check security my_policy.xml --rig my_robot.yaml",),
    ),
    Command(
        "security-check",
        "compare the SROS 2 policy with the topics and services that running nodes use",
        add_rig,
        _security_check,
        bad_news="if they differ",
    ),
    Command(
        "blind",
        "diagnose randomly drawn rigs with hidden effects, and score the answers",
        _declare_blind,
        _blind,
        bad_news="if a diagnosis crashed",
        examples=("python -m pam_check blind --cases 120 --seed 1097762585 --experiments",),
    ),
    Command(
        "sensitivity",
        "change each constant of the diagnosis and count the changed verdicts of a campaign",
        _declare_sensitivity,
        _sensitivity,
        examples=(
            "python -m pam_check blind --cases 24 --keep-evidence --out out/blind",
            "python -m pam_check sensitivity out/blind --rediagnose 2",
        ),
    ),
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return the exit code."""
    description = "Checks of the whole suite, on simulated rigs."
    return run_program("python -m pam_check", description, COMMANDS, arguments)


if __name__ == "__main__":
    sys.exit(main())
