"""Records the topics that a diagnosis needs to a rosbag2, and says what is still missing.

`pam gap record --rig RIG --out BAG` needs no command line of ROS. Messages are received
and written as bytes; one in 20 ms of a topic is read for the advice. What was received is written
to the file every second.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import McapWriter
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import FluidPressure, JointState

from pam_gap.live.recording_advice import RecordingAdvice, progress_line
from pam_model.errors import PamError
from pam_model.rig import Rig
from pam_ros.joint_state_bytes import stamp_of
from pam_ros.message_decoder import decode
from pam_ros.node_end import end_node
from pam_ros.start import start_ros
from pam_ros.steady_timers import turns
from pam_ros.subscriptions import MOST_BYTES_OF_DIAGNOSTICS, subscribe
from pam_ros.unforeseen import ending_broken

TOPICS = {
    "valve_commands": (JointState, "sensor_msgs/msg/JointState"),
    "sent_valve_commands": (JointState, "sensor_msgs/msg/JointState"),
    "pressure_states": (JointState, "sensor_msgs/msg/JointState"),
    "joint_states": (JointState, "sensor_msgs/msg/JointState"),
    "muscle_states": (JointState, "sensor_msgs/msg/JointState"),
    "joint_estimates": (JointState, "sensor_msgs/msg/JointState"),
    "pam_controller/reference": (JointState, "sensor_msgs/msg/JointState"),
    "supply_pressure": (FluidPressure, "sensor_msgs/msg/FluidPressure"),
    "pam_driver/state": (DiagnosticStatus, "diagnostic_msgs/msg/DiagnosticStatus"),
    "/diagnostics": (DiagnosticArray, "diagnostic_msgs/msg/DiagnosticArray"),
}
READ_EVERY = 0.02  # s
TELL_EVERY = 2.0  # s
KEEP_EVERY = 1.0  # s
LOOK_EVERY = 0.2  # s


class RecordNode(Node):  # type: ignore[misc]
    """Writes the messages of the topics, and shows some of them to the advice."""

    def __init__(self, namespace: str, writer: Writer, advice: RecordingAdvice) -> None:
        super().__init__("pam_record", namespace=namespace)
        self._writer = writer
        self._advice = advice
        self._read_at: dict[str, float] = {}
        self._joined: set[str] = set()
        self._store = get_typestore(Stores.ROS2_JAZZY)

    def join(self) -> None:
        """Subscribe to the topics that have a publisher by now."""
        for topic, (kind, name) in TOPICS.items():
            publishers = self.get_publishers_info_by_topic(self.resolve_topic_name(topic))
            if topic in self._joined or not publishers:
                continue
            self._joined.add(topic)
            connection = self._writer.add_connection(
                self.resolve_topic_name(topic), name, typestore=self._store
            )
            write = partial(self._write, topic, connection, kind)
            # reliable if every publisher is; a best-effort publisher reaches no reliable subscriber
            offers = {info.qos_profile.reliability for info in publishers}
            best_effort = ReliabilityPolicy.BEST_EFFORT in offers
            qos = QoSProfile(
                depth=1000,
                reliability=ReliabilityPolicy.BEST_EFFORT
                if best_effort
                else ReliabilityPolicy.RELIABLE,
            )
            most = MOST_BYTES_OF_DIAGNOSTICS
            subscribe(self, kind, topic, write, qos, raw=True, most_bytes=most)

    def _write(self, topic: str, connection: Any, kind: Any, data: bytes) -> None:
        self._writer.write(connection, time.time_ns(), data)
        now = time.monotonic()
        if kind is not JointState or now - self._read_at.get(topic, 0.0) < READ_EVERY:
            self._advice.take(topic, now, stamp=stamp_of(data))
            return
        self._read_at[topic] = now
        message = decode(data, JointState)
        self._advice.take(
            topic, now, message.name, message.position, message.effort, stamp_of(data)
        )

    def keep(self) -> None:
        """Write the messages that are still in the writer's buffer."""
        storage = self._writer.storage
        if isinstance(storage, McapWriter) and storage.chunk.msgs:
            storage.close_chunk()
            storage.bio.flush()


def record(
    rig: Rig, out: Path, namespace: str, duration: float, tell: Callable[[str], None]
) -> list[str]:
    """Record until SIGINT, SIGTERM or the duration ends; returns what is missing.

    Parameters
    ----------
    rig : Rig
        The robot.
    out : Path
        Folder to make.
    namespace : str
        Namespace of the robot's nodes; may be empty.
    duration : float
        How long to record [s]; 0 for until a signal.
    tell : callable
        Takes a line for the user, when something has changed.

    Raises
    ------
    PamError
        If the folder exists already.
    """
    if out.exists():
        raise PamError(
            f"--out {out}: exists already; a recording makes its own folder: name another one, "
            "or remove this one"
        )
    out.parent.mkdir(parents=True, exist_ok=True)
    ending = False

    def end(*_: object) -> None:
        nonlocal ending
        ending = True

    before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    advice = RecordingAdvice(rig)
    try:
        start_ros([])
        with Writer(out, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            node = RecordNode(namespace, writer, advice)
            executor = EventsExecutor()
            executor.add_node(node)
            tell(f"recording to {out}; Ctrl-C ends it")
            begun = kept = told = time.monotonic()
            looked = 0.0
            said: list[str] = []

            def going_on() -> bool:
                return not (ending or (duration and time.monotonic() - begun > duration))

            with ending_broken(node, PamError, OSError):
                for _ in turns(executor, None, going_on):
                    now = time.monotonic()
                    if now - looked > LOOK_EVERY:
                        node.join()
                        looked = now
                    if now - kept > KEEP_EVERY:
                        node.keep()
                        kept = now
                    if now - told > TELL_EVERY:
                        told, missing = now, advice.missing()
                        if missing != said:
                            tell(progress_line(advice.duration, missing))
                        said = missing
            end_node(node, executor)
    finally:
        rclpy.try_shutdown()
        for number, handler in before.items():
            signal.signal(number, handler)
    return advice.missing()
