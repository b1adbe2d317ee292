"""`pam gap`: diagnose a recording, watch a running rig, write the page of effects."""

# PYTHON_ARGCOMPLETE_OK: shells with argcomplete complete its commands and options

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import gc
import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pam_model.argument_types import (
    count,
    input_file,
    input_folder,
    input_path,
    named_number,
    number,
)
from pam_model.command_line import (
    Arguments,
    Command,
    NodeCommand,
    Outcome,
    Parser,
    Tool,
    run_command,
)
from pam_model.common_options import (
    add_column_map,
    add_namespace,
    add_no_progress,
    add_out,
    add_rig,
    add_tolerances,
)
from pam_ros.program_name import PROGRAM

if TYPE_CHECKING:
    from pam_ros.node_help import NodeHelp

MOVED = {
    "blind": f"{PROGRAM} check blind",
    "effects": f"{PROGRAM} check pages",
    "rules": f"{PROGRAM} check pages",
    "close-loop": f"{PROGRAM} demo close-loop",
}


def _add_recordings(
    parser: Parser, metavar: str, nargs: str, more: tuple[tuple[str, str], ...]
) -> None:
    """The recordings of one rig, and further ones under other conditions."""
    parser.add_argument(
        "recordings",
        nargs=nargs,
        type=input_path,
        metavar=metavar,
        help="bag, CSV(.gz), Parquet, NPZ, MAT, HDF5 or JSON; several of one rig may be given",
    )
    add_rig(parser, required=True)
    add_out(parser)
    parser.add_argument("--joint", help="only this joint")
    for name, text in more:
        parser.add_argument(
            name,
            nargs="+",
            type=input_path,
            default=[],
            metavar=metavar,
            help=f"more recordings, {text}",
        )
    add_column_map(parser)


def _add_work(parser: Parser, usual: str) -> None:
    """How many simulations run at once, and whether progress is shown."""
    parser.add_argument(
        "--threads",
        type=count(0),
        default=0,
        metavar="N",
        help=f"simulations at once (default: 0, {usual})",
    )
    add_no_progress(parser)


def _diagnose(given: Arguments) -> Outcome:
    gc.disable()  # what is imported stays; no search for garbage has to look at it
    try:
        from pam_gap.diagnosis_files import run  # noqa: PLC0415  (scipy, numba)

        gc.freeze()
    finally:
        gc.enable()
    return run(given)


def _declare_diagnose(parser: Parser) -> None:
    _add_recordings(
        parser,
        "RECORDING",
        "*",
        (
            ("--turned-over", "with the joint mounted upside down (reversed gravity)"),
            ("--locked", "with the joint locked at one angle"),
            ("--shut", "with both valves shut and the joint moved by an external torque"),
        ),
    )
    parser.add_argument(
        "--material",
        type=number("", least=0.0, most=0.5),
        default=None,
        metavar="SHARE",
        help="share of the motion below which a gap does not matter (default: 0.001)",
    )
    parser.add_argument(
        "--belief",
        type=named_number,
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="a cost of an answer or a probability beforehand, such as false_name=3 "
        "(docs/what_we_believe.md); may be given several times",
    )
    _add_work(parser, "one per processor")
    parser.add_argument(
        "--keep-evidence",
        action="store_true",
        help="write evidence.npz too, from which the verdict can be decided again",
    )
    parser.add_argument(
        "--answer-only",
        action="store_true",
        help="no report page and no next experiment, which take half of the time or more",
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="only a first look, in seconds: where the gap is, and which effects resemble it; no "
        "verdict",
    )


def _calibrate(given: Arguments) -> Outcome:
    from pam_gap.calibration.calibrate_files import run  # noqa: PLC0415  (scipy, numba)

    return run(given)


def _declare_calibrate(parser: Parser) -> None:
    _add_recordings(
        parser,
        "LOG",
        "+",
        (
            (
                "--withheld",
                "that take no part in the fit (default: the last part of the longest log)",
            ),
            ("--turned-over", "with the joint mounted upside down (reversed gravity)"),
        ),
    )
    add_tolerances(parser)
    _add_work(parser, "one")


def _fleet(given: Arguments) -> Outcome:
    from pam_gap.fleet.fleet import run  # noqa: PLC0415  (scipy, numba, Dask)

    return run(given)


def _declare_fleet(parser: Parser) -> None:
    parser.add_argument(
        "folder", type=input_folder, metavar="FOLDER", help="folder of the recordings, of any depth"
    )
    rigs = parser.add_mutually_exclusive_group(required=True)
    rigs.add_argument("--rig", type=input_file, metavar="FILE", help="rig file of all recordings")
    rigs.add_argument(
        "--rigs",
        type=input_file,
        metavar="TABLE",
        help="CSV with the columns recording, rig and, where wanted, robot and time",
    )
    add_out(parser)
    parser.add_argument(
        "--workers",
        type=count(),
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes on this machine, one thread each (default: one per processor)",
    )
    parser.add_argument(
        "--scheduler",
        default="",
        metavar="ADDRESS",
        help="an existing Dask scheduler, whose workers see the same files",
    )
    parser.add_argument(
        "--limit",
        type=named_number,
        action="append",
        default=[],
        metavar="EFFECT.PARAMETER=VALUE",
        help="limit of a parameter, to predict when it is reached; may be given several times",
    )
    parser.add_argument(
        "--full-every",
        type=number("days", least=0.0),
        default=0.0,
        metavar="DAYS",
        help="diagnose one recording of each robot in this time in full and only fit the followed "
        "effects on the others, which takes far less time (default: 0, all in full)",
    )
    add_column_map(parser)
    add_no_progress(parser)


def _import(given: Arguments) -> Outcome:
    from pam_gap.import_log.import_log import run  # noqa: PLC0415  (scipy, bokeh)

    return run(given)


def _declare_import(parser: Parser) -> None:
    parser.add_argument(
        "log", type=input_path, metavar="LOG", help="bag, CSV, Parquet, NPZ, MAT, HDF5 or JSON"
    )
    add_rig(parser, required=True)
    add_out(parser)
    parser.add_argument(
        "--map", type=input_file, metavar="FILE", help="map of the columns (default: propose one)"
    )
    parser.add_argument(
        "--rate",
        type=number("Hz", least=0.0),
        default=0.0,
        metavar="HZ",
        help="rate of a table without a time, for the proposal",
    )


def _compare(given: Arguments) -> Outcome:
    from pam_gap.answer.compare_page import run  # noqa: PLC0415  (scipy, matplotlib)

    return run(given)


def _declare_compare(parser: Parser) -> None:
    parser.add_argument(
        "diagnoses",
        nargs="+",
        type=input_path,
        metavar="DIAGNOSIS",
        help="folders of `diagnose` or diagnosis.json files; the first is the reference",
    )
    add_out(parser)


def _declare_record(parser: Parser) -> None:
    add_rig(parser, required=True)
    add_out(parser)
    add_namespace(parser)
    parser.add_argument(
        "--duration",
        type=number("s", least=0.0),
        default=0.0,
        metavar="S",
        help="ends by itself after this time [s] (default: by Ctrl-C)",
    )
    parser.add_argument(
        "--all", action="store_true", help="record every topic, not only what a diagnosis needs"
    )
    parser.add_argument(
        "--realtime-priority",
        type=count(0, 99),
        default=0,
        metavar="N",
        help="real-time priority (SCHED_FIFO), where the system permits it; 0: none (default: 0)",
    )


def _record(given: Arguments) -> Outcome:
    from pam_gap.live.record_node import record  # noqa: PLC0415  (rclpy)
    from pam_model.rig.partial import load_partial_rig  # noqa: PLC0415  (numpy)
    from pam_ros.periodic import take_priority  # noqa: PLC0415

    def tell(line: str) -> None:
        print(line, flush=True)

    rig = load_partial_rig(given.rig).rig  # only its names and topics matter here
    take_priority(given.realtime_priority)  # before there are other threads, which inherit it
    missing = record(rig, given.out, given.namespace, given.duration, tell, every_topic=given.all)
    print(f"written: {given.out}; missing: {'; '.join(missing) or 'nothing'}")
    return Outcome({"bag": given.out, "missing": missing}, missing)


def _monitor(arguments: Sequence[str] | None) -> int:
    from pam_gap.live.monitor_node import main as run  # noqa: PLC0415  (rclpy)

    return run(arguments)


def _monitor_usage() -> NodeHelp:
    from pam_gap.live.monitor_help import HELP  # noqa: PLC0415

    return HELP


MONITOR = NodeCommand(
    "monitor", "watch the gap on live topics (a ROS node)", _monitor, _monitor_usage
)


def _play(arguments: Sequence[str] | None) -> int:
    from pam_gap.experiments.play_node import main as run  # noqa: PLC0415  (rclpy)

    return run(arguments)


def _play_usage() -> NodeHelp:
    from pam_gap.experiments.play_help import HELP  # noqa: PLC0415

    return HELP


PLAY = NodeCommand("play", "play a proposed experiment on the rig (a ROS node)", _play, _play_usage)


DIAGNOSE = Command(
    "diagnose",
    "find where a rig differs from its rig file, and why",
    _declare_diagnose,
    _diagnose,
    bad_news="if a joint's verdict is not `none`",
    examples=(
        "pam gap diagnose out/demo/bag --rig config/elbow.yaml --out out/report",
        "pam gap diagnose A B --locked C --rig RIG.yaml --out OUT",
    ),
)
COMMANDS = (
    DIAGNOSE,
    Command(
        "import",
        "show what is understood of a log of any program, before anything is fitted",
        _declare_import,
        _import,
        bad_news="if a diagnosis would refuse the log",
        examples=(
            "pam gap import log.mat --rig RIG.yaml --out OUT",
            "pam gap import log.mat --map OUT/map.yaml --rig RIG.yaml --out OUT",
        ),
    ),
    Command(
        "calibrate",
        "find the numbers of a rough rig file from recordings, and say what they leave open",
        _declare_calibrate,
        _calibrate,
        bad_news="if no rig file follows, as with a reversed sign",
        examples=(
            "pam gap calibrate LOG --rig PARTIAL.yaml --out OUT",
            "pam gap calibrate A B --withheld C --rig PARTIAL.yaml --out OUT --tolerance 0.2",
        ),
    ),
    Command(
        "compare",
        "put diagnoses of one rig side by side: what changed, and whether it is more than noise",
        _declare_compare,
        _compare,
        bad_news="if something changed by more than noise",
        examples=("pam gap compare out/before out/after --out out/compare",),
    ),
    Command(
        "fleet",
        "diagnose many recordings in parallel, and find what changed over weeks",
        _declare_fleet,
        _fleet,
        bad_news="if an effect changed or a recording failed",
        examples=(
            "pam gap fleet RECORDINGS --rig RIG.yaml --out OUT --workers 4",
            "pam gap fleet RECORDINGS --rigs TABLE.csv --out OUT",
        ),
    ),
    Command(
        "record",
        "record what a diagnosis needs, and show what is still missing",
        _declare_record,
        _record,
        bad_news="if the recording misses something",
        examples=("pam gap record --rig RIG.yaml --out recording",),
    ),
    MONITOR,
    PLAY,
)


TOOL = Tool(
    "gap",
    "Find where a rig differs from its rig file, from recordings",
    COMMANDS,
    moved=MOVED,
)

main = TOOL.run


def diagnose(arguments: Sequence[str] | None = None) -> int:
    """Entry point of `ros2 run pam_gap pam_diagnose`."""
    return run_command(DIAGNOSE, f"{PROGRAM} gap diagnose", arguments)


monitor = MONITOR.start  # `ros2 run pam_gap pam_monitor`
play = PLAY.start  # `ros2 run pam_gap pam_play`


if __name__ == "__main__":
    sys.exit(main())
