"""Messages and spoilt bytes for every subscription of every node of the suite, in one process."""

from __future__ import annotations

import ast
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from rclpy.logging import LoggingSeverity
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import StoragePlugin, Writer
from std_msgs.msg import Float64

from pam_bringup.viewer.markers_node import MarkersNode
from pam_bringup.viewer.robot_view import RobotView
from pam_bringup.viewer.viewer_node import ViewerNode
from pam_check.endurance.lifecycle_cycles_node import LifecycleCycler
from pam_check.faults.operator_node import FaultOperator
from pam_check.fuzz import callbacks_node, message_bytes
from pam_check.fuzz.callbacks_node import fuzz_callbacks
from pam_check.fuzz.messages import Messages
from pam_check.fuzz.random_targets import ViolationError
from pam_check.fuzz.topics_node import Attack, TopicAttacker, is_malformed
from pam_control import controller_health
from pam_control.controller_node import ControllerNode
from pam_demo.commission.ros_port_node import RosPortNode
from pam_demo.player_node import PlayerNode
from pam_driver import driver_diagnostics
from pam_driver.can_bus.bus import open_bus
from pam_driver.driver_node import DriverNode
from pam_gap.experiments.excitations import Menu
from pam_gap.experiments.files import write_experiment
from pam_gap.experiments.play_node import PlayNode
from pam_gap.live import monitor_node
from pam_gap.live.monitor_node import MonitorNode
from pam_gap.live.record_node import TOPICS, RecordNode
from pam_gap.live.recording_advice import RecordingAdvice
from pam_model import model_node
from pam_model.model_node import ModelNode
from pam_model.rig import load_rig
from pam_ros import diagnostics
from pam_sim import rig_node
from pam_sim.rig_node import RigNode
from support.rigs import ELBOW
from support.source_tree import ALL_PACKAGES, python_files

PATIENCE = 30.0  # s
PEOPLE = [
    f"pam_driver:people.{name}_topic:=true"
    for name in ("emergency_stop", "enabling_switch", "full_speed")
]


class Nothing:
    """A viewer that shows nothing."""

    def number(self, path: str, time: float, value: float) -> None: ...

    def text(self, path: str, time: float, markdown: str) -> None: ...

    def lines(self, time: float, strokes: Any) -> None: ...


def node_classes() -> set[str]:
    """The classes in the source that are nodes."""
    return {
        node.name
        for package in ALL_PACKAGES
        for path in python_files(package)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef)
        for base in node.bases
        if ast.unparse(base).split(".")[-1] in {"Node", "LifecycleNode"}
    }


@contextmanager
def every_node(folder: Path) -> Iterator[dict[str, Callable[[], Any]]]:
    """How each node is made; the driver first."""
    rig = load_rig(ELBOW)
    port = open_bus("virtual", "fuzz_operator")
    form = {"version": 9, "storage_plugin": StoragePlugin.MCAP}
    with Writer(folder / "all", **form) as all_topics, Writer(folder / "some", **form) as some:

        def joined(node: Any, join: Callable[[], None], wanted: int) -> Any:
            end = time.monotonic() + PATIENCE
            while len(list(node.subscriptions)) < wanted and time.monotonic() < end:
                join()
                time.sleep(0.02)
            return node

        def record_all() -> Any:
            node = RecordNode("", all_topics, RecordingAdvice(rig), every_topic=True)
            return joined(node, node.join, 12)

        def record() -> Any:
            node = RecordNode("", some, RecordingAdvice(rig))
            return joined(node, node.join, len(TOPICS) - 1)  # no supply is measured

        yield {
            "DriverNode": DriverNode,
            "ControllerNode": ControllerNode,
            "ModelNode": ModelNode,
            "RigNode": RigNode,
            "MonitorNode": MonitorNode,
            "PlayNode": PlayNode,
            "MarkersNode": MarkersNode,
            "ViewerNode": lambda: ViewerNode("", RobotView(rig, Nothing())),
            "PlayerNode": lambda: PlayerNode(rig.joint_names),
            "FaultOperator": lambda: FaultOperator(rig, port),
            "LifecycleCycler": LifecycleCycler,
            "TopicAttacker": lambda: TopicAttacker(rig, 0, Attack()),
            "RecordNode": record,
            "RecordNode of all topics": record_all,
            "RosPortNode": lambda: RosPortNode(rig, rig.joint_names[0], 0.002),
        }
    port.close()


def test_no_node_is_left_out(tmp_path: Path) -> None:
    with every_node(tmp_path) as nodes:
        assert {name.split()[0] for name in nodes} == node_classes()


def test_nothing_escapes_whatever_arrives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(callbacks_node, "BLOCK", 150)
    rig = load_rig(ELBOW)
    experiment = tmp_path / "experiment"
    menu = Menu(rig, 0, 0.01).entries()
    write_experiment(experiment, rig, 0, next(e for e in menu if e.name == "vented_swing"), {})
    with every_node(tmp_path) as nodes:
        played = [f"pam_play:experiment:={experiment}"]
        failed = fuzz_callbacks(ELBOW, 1, 11, tuple(nodes.values()), [*PEOPLE, *played])
    assert {name: texts for name, texts in failed.items() if texts} == {}
    assert len(failed) > 45, "subscriptions of all nodes"
    for name in ("emergency_stop_released", "enabling_switch_held", "full_speed_permitted"):
        assert f"pam_driver /pam_driver/{name}" in failed


MARK = "Q7"


def test_no_text_of_a_message_fills_the_log_or_the_diagnostics(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Names of 100 kB wrote 500 MB in 10 s; a stream in degrees wrote 490 lines in a second."""
    monkeypatch.setattr(message_bytes, "_TEXTS", ("elbow", MARK * 2000, f"state {MARK * 2000}"))
    monkeypatch.setattr(Messages, "data", Marked.data)
    monkeypatch.setattr(callbacks_node, "made_nodes", loud(callbacks_node.made_nodes))
    monkeypatch.setattr(callbacks_node, "BLOCK", 150)
    # else every reference is refused for another reason
    monkeypatch.setattr(ControllerNode, "_reason_against_references", lambda self: "")
    statuses: list[Any] = []
    make = diagnostics.diagnostic_status

    def kept(*arguments: Any, **others: Any) -> Any:
        statuses.append(make(*arguments, **others))
        return statuses[-1]

    for module in (controller_health, driver_diagnostics, monitor_node, model_node, rig_node):
        found = module.health if module is controller_health else module
        monkeypatch.setattr(found, "diagnostic_status", kept)
    with every_node(tmp_path) as nodes:
        few = [nodes[name] for name in ("DriverNode", "ControllerNode", "ModelNode", "RigNode",
                                        "MonitorNode", "MarkersNode")]  # fmt: skip
        failed = fuzz_callbacks(ELBOW, 1, 5, few, PEOPLE)
    assert not any(failed.values())
    told = capfd.readouterr().err
    texts = [told, *(str(status) for status in statuses)]
    assert any(MARK in text for text in texts), "the beginning is shown"
    assert not [text for text in texts if MARK * 40 in text]
    assert len(told.splitlines()) < 60, "kinds of news, not messages"


class Marked(Messages):
    """Messages with long texts and with numbers that are never the same."""

    def data(self, kind: type) -> bytes:
        message = message_bytes.drawn(kind, self._draw)
        if hasattr(message, "position") and self._draw.random() < 0.5:
            message.name, message.velocity = ["elbow"], []
            message.position = [self._draw.uniform(2.0, 90.0)]  # in degrees
        return bytes(serialize_message(message))


def loud(made_nodes: Any) -> Any:
    """The same nodes, with their warnings."""

    @contextmanager
    def made(*arguments: Any) -> Iterator[list[Any]]:
        with made_nodes(*arguments) as nodes:
            for node in nodes:
                node.get_logger().set_level(LoggingSeverity.INFO)
            yield nodes

    return made


def test_a_subscription_without_the_decoder_is_found() -> None:
    class Naked(ModelNode):
        def __init__(self) -> None:
            super().__init__()
            self.create_subscription(type(self)._kind(), "a", print, 1)

        @staticmethod
        def _kind() -> Any:
            from std_msgs.msg import Bool

            return Bool

    with pytest.raises(ViolationError, match="/a: does not pass the guarded decoder"):
        fuzz_callbacks(ELBOW, 1, 1, (DriverNode, Naked))


def test_a_message_that_the_transport_completes_is_not_called_malformed() -> None:
    """RTPS fills a message up to whole words, so a few missing bytes arrive as zeros."""
    whole = serialize_message(Float64(data=0.1))[:12]
    assert not is_malformed(whole, Float64)
    assert not is_malformed(whole[:-3], Float64)
    assert is_malformed(whole[:-5], Float64)
    assert is_malformed(whole[:3], Float64)
