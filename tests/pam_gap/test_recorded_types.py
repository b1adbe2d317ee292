"""The recorder goes on when a topic has a type that its library does not know."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

pytest.importorskip("rclpy")
from rclpy.qos import QoSProfile

from pam_gap.live import record_node
from pam_gap.live.record_node import RecordNode

TYPES = [
    ("/arm/feedback", ["control_msgs/action/FollowJointTrajectory_FeedbackMessage"]),
    ("/own", ["my_package/msg/Own"]),
    ("/newer", ["sensor_msgs/msg/OfALaterDistribution"]),
    ("/joint_states", ["sensor_msgs/msg/JointState"]),
    ("/extra", ["std_msgs/msg/String"]),
    ("/nobody", ["std_msgs/msg/String"]),
    ("/parameter_events", ["rcl_interfaces/msg/ParameterEvent"]),
]


@pytest.mark.parametrize("every_topic", [True, False])
def test_a_topic_of_an_unknown_type_is_left_out_and_the_others_are_recorded(
    tmp_path, monkeypatch, every_topic
):
    """The feedback of the controller's own action ended the recorder with a traceback."""
    told: list[str] = []
    heard: list[str] = []
    monkeypatch.setattr(
        record_node, "subscribe", lambda node, kind, topic, *_, **__: heard.append(topic)
    )
    with Writer(tmp_path / "bag", version=9) as writer:
        recorder = SimpleNamespace(
            _writer=writer,
            _store=get_typestore(Stores.ROS2_JAZZY),
            _joined=set(),
            _every_topic=every_topic,
            _known={"/joint_states": "joint_states"},
            get_topic_names_and_types=lambda: TYPES,
            get_publishers_info_by_topic=lambda topic: (
                [] if topic == "/nobody" else [SimpleNamespace(qos_profile=QoSProfile(depth=1))]
            ),
            get_logger=lambda: SimpleNamespace(warning=told.append),
            _write=lambda *_: None,
        )
        for _ in range(2):  # it looks again and again, and says it once
            RecordNode.join(recorder)
    unknown = ["/arm/feedback", "/own", "/newer"] if every_topic else []
    assert [text.partition(":")[0] for text in told] == unknown
    assert heard == (["/joint_states", "/extra"] if every_topic else ["/joint_states"])
