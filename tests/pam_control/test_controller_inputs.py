"""When a measurement was made, for a loop that takes it later than it arrives."""

from __future__ import annotations

import contextlib
import time
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy")

from pam_control import controller_inputs
from pam_control.controller_inputs import ControllerInputs
from pam_model.rig import Rig
from pam_ros.joint_state_bytes import JointStateWriter

NOW = 100.0


class Topic:
    """Stands for a subscription; the test hands the messages over."""

    def __init__(self, node: Any, kind: Any, topic: str, take: Any, **_: Any) -> None:
        node[topic] = self
        self.take, self.waited = take, 0.0


@pytest.fixture
def topics(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(controller_inputs, "PolledTopic", Topic)
    made: dict[str, Any] = {}
    inputs = ControllerInputs(
        made, rig, lambda: NOW, lambda _: contextlib.nullcontext(), lambda _: None
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
