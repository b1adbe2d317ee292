"""A recorder that is killed outright leaves a bag that the diagnosis reads."""

from __future__ import annotations

import math
import signal
from pathlib import Path

import pytest
from sensor_msgs.msg import JointState

from pam_demo.processes import NodeProcess
from pam_demo.programs import RECORDER, recorder_words
from pam_gap.recordings.import_recording import import_recording
from support.rigs import ELBOW

SEVERAL_CHUNKS = 3  # one is written each second
AT_ONCE = 5  # at most what the queue holds


@pytest.mark.system
def test_a_killed_recorder_leaves_a_readable_bag(probe, ros_environment, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    sent: list[JointState] = []
    sizes: set[int] = set()
    publisher = probe.node.create_publisher(JointState, "joint_states", 10)
    recorder = NodeProcess(
        RECORDER, environment=ros_environment, arguments=recorder_words(ELBOW, bag)
    )
    try:
        probe.wait_for("the recorder", publisher.get_subscription_count, 30.0)

        def publish() -> bool:
            recorder.check()
            for _ in range(AT_ONCE):
                message = JointState(name=["elbow"], position=[math.sin(0.01 * len(sent))])
                message.header.stamp = probe.node.get_clock().now().to_msg()
                publisher.publish(message)
                sent.append(message)
            sizes.update(file.stat().st_size for file in bag.glob("*.mcap"))
            return len(sizes) > SEVERAL_CHUNKS

        probe.wait_for("what the system holds", publish, 60.0)
        recorder.send(signal.SIGKILL)
        assert recorder.wait(10.0) == -signal.SIGKILL
    finally:
        recorder.kill()
    assert not (bag / "metadata.yaml").exists()
    recording = import_recording(bag)
    assert "never finished" in recording.repairs[0] or "ends in the middle" in recording.repairs[0]
    shown = recording.values["joint_states.elbow.position"]
    known = [message.position[0] for message in sent]
    assert len(shown) > 100
    assert abs(shown[0] - min(known, key=lambda value: abs(value - shown[0]))) < 1e-6
