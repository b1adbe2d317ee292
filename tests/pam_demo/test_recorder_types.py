"""The recorder goes on when a topic has a type that its library does not know."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

pytest.importorskip("rclpy")

from pam_demo import recorder_node
from pam_demo.recorder_node import Recorder

TOPICS = [
    ("/arm/feedback", ["control_msgs/action/FollowJointTrajectory_FeedbackMessage"]),
    ("/own", ["my_package/msg/Own"]),
    ("/newer", ["sensor_msgs/msg/OfALaterDistribution"]),
    ("/joint_states", ["sensor_msgs/msg/JointState"]),
]


def test_a_topic_of_an_unknown_type_is_left_out_and_the_others_are_recorded(tmp_path, monkeypatch):
    """The feedback of the controller's own action ended the recorder with a traceback."""
    told: list[str] = []
    heard: list[str] = []
    monkeypatch.setattr(
        recorder_node, "subscribe", lambda node, kind, topic, *_, **__: heard.append(topic)
    )
    with Writer(tmp_path / "bag", version=9) as writer:
        recorder = SimpleNamespace(
            _writer=writer,
            _typestore=get_typestore(Stores.ROS2_JAZZY),
            _topics={},
            get_topic_names_and_types=lambda: TOPICS,
            count_publishers=lambda topic: 1,
            get_logger=lambda: SimpleNamespace(warning=told.append),
            _write=lambda connection, data: None,
            _qos=lambda topic: None,
        )
        for _ in range(2):  # it looks again and again, and says it once
            Recorder.join_new_topics(recorder)
    assert [text.partition(":")[0] for text in told] == ["/arm/feedback", "/own", "/newer"]
    assert heard == ["/joint_states"]
