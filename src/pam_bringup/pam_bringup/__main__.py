"""`pam bringup`: show a running robot or a recording, write its layouts and security policy."""

# PYTHON_ARGCOMPLETE_OK: shells with argcomplete complete its commands and options

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pam_model.argument_types import count, input_path, output_file, output_folder
from pam_model.command_line import Arguments, Command, NodeCommand, Outcome, Parser, Tool
from pam_model.common_options import add_namespace, add_rig, chosen_rig

if TYPE_CHECKING:
    from pam_ros.node_help import NodeHelp


def _declare(parser: Parser) -> None:
    parser.add_argument(
        "bag", nargs="?", type=input_path, metavar="BAG",
        help="rosbag2 to show; without it, the running robot is shown",
    )  # fmt: skip
    add_rig(parser)
    add_namespace(parser)
    parser.add_argument(
        "--web-port", type=count(1, 65535), default=9090, help="port of the page (9090)"
    )
    parser.add_argument(
        "--data-port", type=count(1, 65535), default=9876, help="port of its data (9876)"
    )
    parser.add_argument(
        "--narrow", action="store_true", help="one view at a time, for a phone's screen"
    )
    parser.add_argument("--no-browser", action="store_true", help="open no browser here")
    parser.add_argument(
        "--save", type=output_file, metavar="FILE.rrd",
        help="write a file for the viewer, and serve no page",
    )  # fmt: skip


def _view(given: Arguments) -> Outcome:
    import signal  # noqa: PLC0415

    from pam_bringup.viewer.rerun_sink import RerunSink, layout  # noqa: PLC0415  (slow)
    from pam_bringup.viewer.robot_view import RobotView  # noqa: PLC0415
    from pam_model.rig import load_rig  # noqa: PLC0415

    rig = load_rig(chosen_rig(given))
    blueprint = layout(rig, live=given.bag is None, narrow=given.narrow)
    sink = RerunSink(live=given.bag is None)
    address = ""
    # the server of the page must not outlive this program
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    if given.save:
        sink.save(Path(given.save), blueprint)
    else:
        address = sink.serve(
            given.web_port, given.data_port, blueprint, open_browser=not given.no_browser
        )
        print(f"open in a browser: {address}\nCtrl-C ends the viewer", flush=True)
    view = RobotView(rig, sink)
    if given.bag is not None:
        from pam_bringup.viewer.show_bag import show_bag  # noqa: PLC0415

        shown = show_bag(Path(given.bag), given.namespace, view)
        print(f"{shown} messages shown", flush=True)
        sink.finish()
        if not given.save:
            _wait()
    else:
        from pam_bringup.viewer.viewer_node import show_robot  # noqa: PLC0415  (rclpy)

        show_robot(given.namespace, view)
    sink.finish()
    return Outcome({"address": address, "file": given.save})


def _wait() -> None:
    import signal  # noqa: PLC0415
    import threading  # noqa: PLC0415

    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    ended.wait()


def _markers(arguments: Sequence[str] | None) -> int:
    from pam_bringup.viewer.markers_node import main as run  # noqa: PLC0415  (rclpy)

    return run(arguments)


def _markers_usage() -> NodeHelp:
    from pam_bringup.viewer.markers_help import HELP  # noqa: PLC0415

    return HELP


MARKERS = NodeCommand(
    "markers", "publish the muscles for RViz (a ROS node)", _markers, _markers_usage
)


def _declare_layouts(parser: Parser) -> None:
    parser.add_argument("out", type=output_folder, metavar="OUT", help="folder for the layouts")
    add_rig(parser)
    add_namespace(parser)


def _layouts(given: Arguments) -> Outcome:
    from pam_bringup.layouts.write import run  # noqa: PLC0415

    return run(given)


def _declare_security(parser: Parser) -> None:
    parser.add_argument("file", type=output_file, help="where to write the policy (XML)")
    add_rig(parser)


def _security(given: Arguments) -> Outcome:
    from pam_bringup.security.policy import run  # noqa: PLC0415

    return run(given)


def _security_check(given: Arguments) -> Outcome:
    from pam_bringup.security.check_node import run  # noqa: PLC0415  (rclpy)

    return run(given)


COMMANDS = (
    Command(
        "viewer",
        "show a running robot or a recording in a browser",
        _declare,
        _view,
        examples=(
            "pam bringup viewer --rig my_robot.yaml",
            "pam bringup viewer out/demo/bag",
        ),
    ),
    MARKERS,
    Command(
        "layouts",
        "write the layouts of a robot for Foxglove and PlotJuggler",
        _declare_layouts,
        _layouts,
        examples=("pam bringup layouts out/layouts --rig my_robot.yaml",),
    ),
    Command(
        "security",
        "write the SROS 2 policy of a rig",
        _declare_security,
        _security,
        examples=("pam bringup security my_policy.xml --rig my_robot.yaml",),
    ),
    Command(
        "security-check",
        "compare the SROS 2 policy with the topics and services that running nodes use",
        add_rig,
        _security_check,
        bad_news="if they differ",
    ),
)


TOOL = Tool(
    "bringup",
    "Show a running robot or a recording, write its layouts and security policy",
    COMMANDS,
    default="viewer",
)

main = TOOL.run
markers = MARKERS.start  # `ros2 run pam_bringup pam_markers`


if __name__ == "__main__":
    sys.exit(main())
