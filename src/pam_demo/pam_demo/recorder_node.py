"""Records every topic to a rosbag2 MCAP file as raw messages, without rosbag2 itself.

`python -m pam_demo.recorder_node --out BAG` records until SIGINT or SIGTERM. It subscribes to new
topics when they appear. Received data are written to the file every second, so that at most the
last second is lost when the recorder is killed.
"""

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import signal
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import McapWriter
from rosbags.typesys import Stores, TypesysError, get_typestore

from pam_model.argument_types import count, output_folder
from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command
from pam_model.errors import PamError
from pam_ros.foreign_text import plain
from pam_ros.message_types import message_type
from pam_ros.node_end import end_node
from pam_ros.periodic import take_priority
from pam_ros.start import start_ros
from pam_ros.steady_timers import turns
from pam_ros.subscriptions import subscribe
from pam_ros.unforeseen import ending_broken

NOT_RECORDED = ("/parameter_events",)
LOOK_EVERY = 0.2  # s
KEEP_EVERY = 1.0  # s


class Recorder(Node):  # type: ignore[misc]
    """Subscribes to all topics without deserializing, and writes the messages."""

    def __init__(self, writer: Writer) -> None:
        super().__init__("recorder")
        self._writer = writer
        self._typestore = get_typestore(Stores.ROS2_JAZZY)
        self._topics: dict[str, Any] = {}

    def join_new_topics(self) -> None:
        """Subscribe to the topics that have appeared since the last call."""
        for topic, types in self.get_topic_names_and_types():
            if topic in self._topics or topic in NOT_RECORDED or not self.count_publishers(topic):
                continue
            try:
                message = message_type(types[0])
                connection = self._writer.add_connection(topic, types[0], typestore=self._typestore)
            except (LookupError, TypesysError):
                self.get_logger().warning(
                    f"{plain(topic)}: type {plain(types[0])} is not known, not recorded"
                )
                self._topics[topic] = None
                continue
            write, qos = partial(self._write, connection), self._qos(topic)
            self._topics[topic] = subscribe(
                self, message, topic, write, qos, raw=True, most_bytes=None
            )

    def keep(self) -> None:
        """Write the messages that are still in the writer's buffer."""
        storage = self._writer.storage
        if isinstance(storage, McapWriter) and storage.chunk.msgs:
            storage.close_chunk()
            storage.bio.flush()

    def _qos(self, topic: str) -> QoSProfile:
        """Reliable if every publisher is; the queue holds one second of the fastest topic."""
        offers = {info.qos_profile.reliability for info in self.get_publishers_info_by_topic(topic)}
        best_effort = ReliabilityPolicy.BEST_EFFORT in offers
        return QoSProfile(
            depth=1000,
            reliability=ReliabilityPolicy.BEST_EFFORT
            if best_effort
            else ReliabilityPolicy.RELIABLE,
        )

    def _write(self, connection: Any, data: bytes) -> None:
        self._writer.write(connection, time.time_ns(), data)


def record(out: Path) -> None:
    """Record to the folder `out` until a signal ends it.

    Raises
    ------
    PamError
        If the folder exists already.
    """
    if out.exists():
        raise PamError(f"{out}: exists already, a recording needs a new folder")
    ending = False

    def end(*_: object) -> None:
        nonlocal ending
        ending = True

    start_ros([])
    signal.signal(signal.SIGINT, end)
    signal.signal(signal.SIGTERM, end)
    out.parent.mkdir(parents=True, exist_ok=True)
    with Writer(out, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        node = Recorder(writer)
        executor = EventsExecutor()
        executor.add_node(node)
        print(f"recording to {out}", flush=True)
        looked = kept = 0.0
        with ending_broken(node, PamError, OSError):
            for _ in turns(executor, None, lambda: not ending):
                if time.monotonic() - kept > KEEP_EVERY:
                    node.keep()
                    kept = time.monotonic()
                if time.monotonic() - looked > LOOK_EVERY:
                    node.join_new_topics()
                    looked = time.monotonic()
        end_node(node, executor)
    rclpy.try_shutdown()


def _declare(parser: Parser) -> None:
    parser.add_argument("--out", type=output_folder, required=True, help="folder to make")
    parser.add_argument(
        "--realtime-priority",
        type=count(0, 99),
        default=0,
        help="real-time priority (SCHED_FIFO), where the system permits it; 0: none (default: "
        "%(default)s)",
    )


def _run(given: Arguments) -> Outcome:
    if given.out.exists():
        raise PamError(
            f"--out {given.out}: exists already; a recording makes its own folder: name another, "
            "or remove this one"
        )
    take_priority(given.realtime_priority)  # before there are other threads, which inherit it
    record(given.out)
    return Outcome({"bag": given.out})


def main() -> int:
    """Record until a signal and return the exit code."""
    command = Command("recorder", "record all topics to a rosbag2 MCAP", _declare, _run)
    return run_command(command, "python -m pam_demo.recorder_node")


if __name__ == "__main__":
    sys.exit(main())
