"""Records the topics that a diagnosis needs to a rosbag2, and says what is still missing.

`pam gap record --rig RIG --out BAG` needs no command line of ROS. Messages are received
and written as bytes; one in 20 ms of a topic is read for the advice. What was received is written
to the file every second.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Sequence
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
from sensor_msgs.msg import JointState

from pam_gap.live.recording_advice import RecordingAdvice, progress_line
from pam_model.errors import PamError
from pam_model.rig import Rig
from pam_ros.foreign_text import plain
from pam_ros.joint_state_bytes import stamp_of
from pam_ros.message_decoder import decode
from pam_ros.message_types import message_type
from pam_ros.node_end import end_node
from pam_ros.start import start_ros
from pam_ros.steady_timers import turns
from pam_ros.subscriptions import MOST_BYTES_OF_DIAGNOSTICS, subscribe
from pam_ros.unforeseen import ending_broken

_JOINT_STATE = "sensor_msgs/msg/JointState"
TOPICS = {
    "valve_commands": _JOINT_STATE,
    "sent_valve_commands": _JOINT_STATE,
    "pressure_states": _JOINT_STATE,
    "joint_states": _JOINT_STATE,
    "muscle_states": _JOINT_STATE,
    "joint_estimates": _JOINT_STATE,
    "pam_controller/reference": _JOINT_STATE,
    "supply_pressure": "sensor_msgs/msg/FluidPressure",
    "pam_driver/state": "diagnostic_msgs/msg/DiagnosticStatus",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}
"""The topics that a diagnosis needs, and their types."""
NOT_RECORDED = ("/parameter_events",)
READ_EVERY = 0.02  # s
TELL_EVERY = 2.0  # s
KEEP_EVERY = 1.0  # s
LOOK_EVERY = 0.2  # s


class RecordNode(Node):  # type: ignore[misc]
    """Writes the messages of topics, and shows some of them to the advice.

    Parameters
    ----------
    namespace : str
        Of the robot's nodes.
    writer : Writer
        Where they are written.
    advice : RecordingAdvice
        Says what is still missing.
    every_topic : bool
        Whether all topics are recorded, not only those that a diagnosis needs.
    """

    def __init__(
        self, namespace: str, writer: Writer, advice: RecordingAdvice, *, every_topic: bool = False
    ) -> None:
        super().__init__("pam_record", namespace=namespace)
        self._writer = writer
        self._advice = advice
        self._every_topic = every_topic
        self._known = {self.resolve_topic_name(topic): topic for topic in TOPICS}
        self._read_at: dict[str, float] = {}
        self._joined: set[str] = set()
        self._store = get_typestore(Stores.ROS2_JAZZY)

    def join(self) -> None:
        """Subscribe to the topics that have a publisher by now."""
        for topic, types in self.get_topic_names_and_types():
            known = self._known.get(topic, "")
            if topic in self._joined or topic in NOT_RECORDED or not (known or self._every_topic):
                continue
            publishers = self.get_publishers_info_by_topic(topic)
            if not publishers:
                continue
            self._joined.add(topic)
            name = TOPICS.get(known, types[0])
            try:
                kind = message_type(name)
                connection = self._writer.add_connection(topic, name, typestore=self._store)
            except (LookupError, TypesysError):
                self.get_logger().warning(
                    f"{plain(topic)}: type {plain(name)} is not known, not recorded"
                )
                continue
            write = partial(self._write, known, connection, kind)
            most = None if self._every_topic else MOST_BYTES_OF_DIAGNOSTICS
            subscribe(self, kind, topic, write, _qos(publishers), raw=True, most_bytes=most)

    def _write(self, topic: str, connection: Any, kind: Any, data: bytes) -> None:
        self._writer.write(connection, time.time_ns(), data)
        if not topic:  # none of those that a diagnosis needs
            return
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


def _qos(publishers: Sequence[Any]) -> QoSProfile:
    """Reliable if every publisher is; a best-effort publisher reaches no reliable subscriber."""
    offers = {info.qos_profile.reliability for info in publishers}
    best_effort = ReliabilityPolicy.BEST_EFFORT in offers
    reliability = ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE
    return QoSProfile(depth=1000, reliability=reliability)


def record(
    rig: Rig,
    out: Path,
    namespace: str,
    duration: float,
    tell: Callable[[str], None],
    *,
    every_topic: bool = False,
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
    every_topic : bool
        Whether all topics are recorded, not only those that a diagnosis needs.

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
            node = RecordNode(namespace, writer, advice, every_topic=every_topic)
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
