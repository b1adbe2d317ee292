"""When a measurement was made, for a loop that takes it later than it arrives."""

from __future__ import annotations

import contextlib
import time
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy")

from pam_control import controller_inputs
from pam_control.controller_inputs import ControllerInputs, NodeSide
from pam_model.rig import Rig
from pam_ros.joint_state_bytes import JointStateWriter

NOW = 100.0


class Topic:
    """Stands for a subscription; the test hands the messages over."""

    def __init__(
        self, node: Any, kind: Any, topic: str, take: Any, *, read: Any = None, **_: Any
    ) -> None:
        node[topic] = self
        self.take, self.waited = (lambda data: take(read(data))), 0.0


@pytest.fixture
def topics(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(controller_inputs, "PolledTopic", Topic)
    made: dict[str, Any] = {}
    inputs = ControllerInputs(
        NodeSide(
            made, rig, lambda: NOW, lambda _: contextlib.nullcontext(), lambda _: None, lambda: None
        )
    )
    return SimpleNamespace(inputs=inputs, **made)


def measured(topics: Any, waited: float, nanoseconds: int) -> float:
    """The time that the controller takes for that of a measurement [s]."""
    topics.joint_states.waited = waited
    topics.joint_states.take(JointStateWriter().write(nanoseconds, ("elbow",), (0.1,)))
    assert topics.inputs.positions == [0.1]
    return float(topics.inputs.position_time)


def test_a_measurement_without_a_stamp_was_made_when_it_arrived(topics: Any) -> None:
    """Not when the loop took it: after a pause of the loop it would look new."""
    assert measured(topics, 0.08, 0) == pytest.approx(NOW - 0.08)


def test_a_stamp_is_believed_unless_it_is_later_than_the_arrival(topics: Any) -> None:
    early, late = time.time_ns() - 50_000_000, time.time_ns() + 10**9
    assert NOW - 5.0 < measured(topics, 0.002, early) <= NOW - 0.05 + 1e-6
    assert measured(topics, 0.002, late) == pytest.approx(NOW - 0.002)


def say(topic: Any, source: str, names: tuple[str, ...], **fields: Any) -> None:
    topic.take(JointStateWriter(source).write(0, names, **fields))


@pytest.mark.parametrize("topic", ["joint_states", "pressure_states"])
def test_measurements_of_two_nodes_are_named(topics: Any, rig: Rig, topic: str) -> None:
    """A second node that publishes angles in degrees drove the arm into its end stop."""
    names, field = {
        "joint_states": (rig.joint_names, "position"),
        "pressure_states": (rig.muscle_names, "effort"),
    }[topic]
    values = {field: [0.1] * len(names)}
    for _ in range(3):
        say(getattr(topics, topic), "/pam_driver#1", names, **values)
    assert topics.inputs.two_publishers() == ""
    say(getattr(topics, topic), "", names, **values)
    assert topics.inputs.two_publishers() == ""  # as after a restart of the driver
    say(getattr(topics, topic), "/pam_driver#1", names, **values)
    assert topics.inputs.two_publishers() == (
        f"two nodes publish {topic} of this rig, /pam_driver#1 and one without a name: stop one "
        "of them"
    )


def test_another_robot_on_joint_states_is_no_second_publisher(topics: Any, rig: Rig) -> None:
    for _ in range(4):
        say(topics.joint_states, "/pam_driver#1", rig.joint_names, position=[0.1])
        say(topics.joint_states, "/gripper", ("finger",), position=[0.2])
    assert topics.inputs.two_publishers() == ""
