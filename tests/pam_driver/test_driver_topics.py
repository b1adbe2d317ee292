"""What `joint_states` says of a joint that is not measured."""

from __future__ import annotations

import math
import time
from types import SimpleNamespace
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from pam_driver.can_bus.bus import CanPort
from pam_driver.driver import Driver
from pam_driver.driver_diagnostics import DriverDiagnostics
from pam_driver.driver_settings import DriverSettings
from pam_driver.driver_topics import DriverTopics
from pam_driver.safety.states import SafetyState
from pam_driver.snapshot import Snapshot
from pam_model.rig import Rig, load_rig
from pam_ros.joint_state_bytes import JointStateReader
from pam_ros.periodic import LoopStatistics
from support.rigs import ELBOW

pytestmark = pytest.mark.system

TWO_JOINTS = ELBOW.with_name("two_joints.yaml")


class Node:
    """Makes publishers that keep what is published."""

    def __init__(self, hearers: int = 1) -> None:
        self.published: dict[str, list[Any]] = {}
        self.hearers = hearers

    def get_fully_qualified_name(self) -> str:
        return "/pam_driver"

    def create_publisher(self, _: Any, topic: str, depth: int) -> Any:
        kept = self.published.setdefault(topic, [])
        return SimpleNamespace(publish=kept.append, get_subscription_count=lambda: self.hearers)


def snapshot(rig: Rig, positions: tuple[float, ...]) -> Snapshot:
    pressures = (0.0,) * len(rig.muscles)
    return Snapshot(SafetyState.READY, pressures, 1.0, positions, positions, 1.0)


def published(positions: tuple[float, ...], keeps_nan: bool = False) -> Any:
    rig = load_rig(TWO_JOINTS)
    node = Node()
    topics = DriverTopics(node, rig, keeps_nan)
    topics.publish(snapshot(rig, positions), SimpleNamespace(), 2.0, 2.0)  # type: ignore[arg-type]
    (data,) = node.published["joint_states"]
    return rig.joint_names, JointStateReader().read(data)


def test_a_topic_that_nobody_hears_is_not_written() -> None:
    rig, node = load_rig(TWO_JOINTS), Node(hearers=0)
    topics = DriverTopics(node, rig, False)
    measured = snapshot(rig, (0.1, 0.2))
    topics.publish(measured, SimpleNamespace(), 2.0, 2.0)  # type: ignore[arg-type]
    assert not any(node.published.values())
    node.hearers = 1
    end = time.monotonic() + 5.0
    while not node.published["pressure_states"]:
        assert time.monotonic() < end, "a subscription that comes later is heard too"
        topics.publish(measured, SimpleNamespace(), 2.0, 2.0)  # type: ignore[arg-type]


def test_observers_may_ask_for_a_part_of_the_cycles() -> None:
    rig, node = load_rig(TWO_JOINTS), Node()
    topics = DriverTopics(node, rig, False, every=5)
    for _ in range(20):
        topics.publish(snapshot(rig, (0.1, 0.2)), SimpleNamespace(), 2.0, 2.0)  # type: ignore[arg-type]
    assert {name: len(sent) for name, sent in node.published.items() if sent} == {
        "pressure_states": 4,
        "joint_states": 4,
    }


def test_a_joint_that_is_not_measured_is_left_out_of_joint_states() -> None:
    names, message = published((math.nan, 0.2))
    assert list(message.name) == list(names[1:])
    assert list(message.position) == list(message.velocity) == [0.2]


def test_without_any_measured_joint_the_message_is_empty_and_still_sent() -> None:
    _, message = published((math.nan, math.nan))
    assert len(message.name) == len(message.position) == 0


def test_nan_is_kept_where_the_parameter_asks_for_it() -> None:
    names, message = published((math.nan, 0.2), keeps_nan=True)
    assert list(message.name) == list(names)
    assert list(message.position) == pytest.approx([math.nan, 0.2], nan_ok=True)


def test_diagnostics_name_the_joint_that_is_not_measured(
    rig: Rig, ports: tuple[CanPort, CanPort]
) -> None:
    diagnostics = DriverDiagnostics(Driver(rig, ports[0], DriverSettings()), ports[0], 1e6)

    def status() -> Any:
        found = diagnostics.statuses(LoopStatistics(0, 0, 0, 0.0), 1.0)
        return next(one for one in found if one.name == "pam_driver: joint_states")

    assert status().level == DiagnosticStatus.OK
    topics = DriverTopics(Node(), rig, False)
    diagnostics.unmeasured = topics.unmeasured(snapshot(rig, (math.nan,)))
    assert status().level == DiagnosticStatus.WARN
    assert status().message == "not measured: elbow"
