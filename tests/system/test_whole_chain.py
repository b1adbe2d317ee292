"""The four nodes together over a loopback bus: they move joints, and nothing bad gets through."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from pam_driver.boards.pam_board.codec import Measurement
from support.reruns import HOST_STALLS

from .conftest import RATE

pytestmark = pytest.mark.system
ROOT = Path(__file__).parents[2]


@pytest.mark.rerun_because(HOST_STALLS)
def test_step_is_tracked_and_stiffness_delivered(suite):
    stiffness = suite.probe.listen(Float64MultiArray, "joint_stiffness")
    suite.move({"elbow": 0.3}, 0.5)
    suite.wait_until_at("elbow", 0.3)

    command = Float64MultiArray(data=[18.0])
    suite.probe.publisher(Float64MultiArray, "pam_controller/stiffness_commands").publish(command)
    suite.wait(
        "18 N m/rad",
        lambda: len(stiffness) > 20 and all(abs(m.data[0] - 18.0) < 0.9 for m in stiffness[-20:]),
    )
    suite.wait_until_at("elbow", 0.3)
    start = suite.frames.now
    _, measured = suite.frames.wait_for(
        "a measurement", lambda _, message: isinstance(message, Measurement), 5.0, start
    )
    assert measured.position == pytest.approx(suite.position("elbow"), abs=0.02)


@pytest.mark.long("test_mixed_rig moves two joints on two boards without processes")
@pytest.mark.rerun_because(HOST_STALLS)
def test_two_joints_on_two_boards_move_apart(make_suite):
    suite = make_suite(ROOT / "config" / "two_joints.yaml")
    first, second = suite.positions[-1].name
    suite.move({first: 0.2, second: -0.25})
    suite.wait_until_at(first, 0.2)
    suite.wait_until_at(second, -0.25)
    boards = {
        board: suite.frames.heard(Measurement, suite.frames.now - 1.0, board) for board in (0, 1)
    }
    angles = {board: heard[-1][1].position for board, heard in boards.items()}
    assert sorted(angles.values()) == pytest.approx([-0.25, 0.2], abs=0.03)


def trajectory(names: list[str], *positions: list[float], seconds: float = 1.0) -> JointTrajectory:
    message = JointTrajectory(joint_names=names)
    for index, values in enumerate(positions):
        point = JointTrajectoryPoint(positions=values)
        point.time_from_start.sec = int(seconds * (index + 1))
        message.points.append(point)
    return message


def stream(names: list[str], position: list[float], velocity: tuple[float, ...] = ()) -> JointState:
    return JointState(name=names, position=position, velocity=list(velocity))


NAN, INF = math.nan, math.inf
BAD_INPUTS = {
    "trajectory with NaN": ("joint_trajectory", trajectory(["elbow"], [NAN])),
    "trajectory with infinity": ("joint_trajectory", trajectory(["elbow"], [INF])),
    "trajectory of another joint": ("joint_trajectory", trajectory(["knee"], [0.1])),
    "trajectory with two values": ("joint_trajectory", trajectory(["elbow"], [0.1, 0.2])),
    "trajectory without values": ("joint_trajectory", trajectory(["elbow"], [])),
    "trajectory outside the limits": ("joint_trajectory", trajectory(["elbow"], [3.0])),
    "trajectory back in time": (
        "joint_trajectory",
        trajectory(["elbow"], [0.1], [0.2], seconds=0.0),
    ),
    "joint named twice": ("joint_trajectory", trajectory(["elbow", "elbow"], [0.1, 0.1])),
    "streamed NaN": ("commands", stream(["elbow"], [NAN])),
    "streamed infinity": ("commands", stream(["elbow"], [-INF])),
    "streamed other joint": ("commands", stream(["knee"], [0.1])),
    "streamed without name": ("commands", stream([], [0.1])),
    "streamed two values": ("commands", stream(["elbow"], [0.1, 0.2])),
    "streamed infinite velocity": ("commands", stream(["elbow"], [0.1], (INF,))),
    "stiffness NaN": ("stiffness_commands", Float64MultiArray(data=[NAN])),
    "stiffness infinite": ("stiffness_commands", Float64MultiArray(data=[INF])),
    "stiffness negative": ("stiffness_commands", Float64MultiArray(data=[-5.0])),
    "two stiffnesses": ("stiffness_commands", Float64MultiArray(data=[10.0, 10.0])),
    "no stiffness": ("stiffness_commands", Float64MultiArray(data=[])),
}


@pytest.mark.rerun_because(HOST_STALLS)
def test_bad_input_is_refused_by_name_and_moves_nothing(suite):
    suite.move({"elbow": 0.2}, 0.5)
    suite.wait_until_at("elbow", 0.2)
    diagnostics = suite.probe.listen(DiagnosticArray, "/diagnostics")
    references = suite.probe.listen(JointState, "pam_controller/reference")

    def rejected() -> int:
        counts = [
            int(pair.value)
            for message in list(diagnostics)
            for status in message.status
            if status.name == "pam_controller: commands"
            for pair in status.values
            if pair.key == "rejected messages"
        ]
        return counts[-1] if counts else -1

    before = suite.wait("a count of rejections", lambda: rejected() + 1) - 1
    settled = len(references)
    waiting: dict[str, list[object]] = {}
    for topic, message in BAD_INPUTS.values():
        waiting.setdefault(topic, []).append(message)
    number = 0
    while waiting:
        # the queue of a topic holds one message: the next must not push it out
        for topic in list(waiting):
            message = waiting[topic].pop()
            suite.probe.publisher(type(message), f"pam_controller/{topic}").publish(message)
            number += 1
            if not waiting[topic]:
                del waiting[topic]
        # the log names only the first of each kind
        suite.wait("a count of them", lambda number=number: rejected() >= before + number)
    assert "rejected" in suite.chain.processes["controller"].output
    assert {round(message.position[0], 6) for message in references[settled:]} == {0.2}
    suite.wait_until_at("elbow", 0.2)
    assert suite.driver_state() == "active"


def recorded(path: Path) -> dict[str, tuple[str, list[tuple[float, float | None]]]]:
    """Topic -> type and (reception, stamp) of each message, by the public reader alone."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    found: dict[str, tuple[str, list[tuple[float, float | None]]]] = {}
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        for connection, received, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            header = getattr(message, "header", None)
            stamp = header.stamp.sec + 1e-9 * header.stamp.nanosec if header else None
            entry = found.setdefault(connection.topic, (connection.msgtype, []))
            entry[1].append((received * 1e-9, stamp))
    return found


JOINT_STATE = "sensor_msgs/msg/JointState"
# topic: type, rate it is meant to have [1/s]
LISTED = {
    "/pressure_states": (JOINT_STATE, RATE),
    "/elbow_flexor/pressure": ("sensor_msgs/msg/FluidPressure", 10.0),
    "/elbow_extensor/pressure": ("sensor_msgs/msg/FluidPressure", 10.0),
    "/joint_states": (JOINT_STATE, RATE),
    "/valve_commands": (JOINT_STATE, RATE),
    "/muscle_states": (JOINT_STATE, 100.0),
    "/joint_estimates": (JOINT_STATE, 100.0),
    "/joint_stiffness": ("std_msgs/msg/Float64MultiArray", 100.0),
    "/pam_controller/reference": (JOINT_STATE, 100.0),
    "/pam_controller/error": (JOINT_STATE, 100.0),
    "/diagnostics": ("diagnostic_msgs/msg/DiagnosticArray", 4.0),
}


@pytest.mark.rerun_because(HOST_STALLS)
def test_a_recording_opens_with_a_public_reader(suite, tmp_path: Path):
    from pam_demo.processes import NodeProcess
    from pam_demo.programs import RECORDER, recorder_words

    bag = tmp_path / "bag"
    words = recorder_words(suite.chain.params_files[0], bag)
    recorder = NodeProcess(RECORDER, environment=suite.chain.environment, arguments=words)
    with recorder:
        recorder.wait_for_output("recording", 30.0)
        suite.wait("the recorder subscribed", lambda: subscribed(suite), 30.0)
        suite.move({"elbow": 0.3}, 0.5)
        suite.wait_until_at("elbow", 0.3)
        heard = suite.probe.listen(DiagnosticArray, "/diagnostics")
        suite.wait("three seconds of diagnostics", lambda: len(heard) > 12)
        assert recorder.stop() == 0
    assert list(bag.glob("*.mcap"))
    topics = recorded(bag)
    for topic, (kind, rate) in LISTED.items():
        assert topic in topics, f"{topic} is not in the recording"
        assert topics[topic][0] == kind
        entries = topics[topic][1]
        span = entries[-1][0] - entries[0][0]
        # a busy host may halve a rate; what is wrong by more is wrong
        assert 0.3 * rate < (len(entries) - 1) / span < 2.0 * rate, topic
        stamps = [stamp for _, stamp in entries if stamp is not None]
        if topic != "/diagnostics":  # which has many senders
            # at first a reader may hear a sender by two transports, one behind the other
            joined = stamps[10:]
            assert joined == sorted(joined), topic
        ages = [received - stamp for received, stamp in entries if stamp is not None]
        assert all(-0.01 < age < 1.0 for age in ages), topic


def subscribed(suite: object) -> bool:
    """Whether somebody beside this test and the nodes listens to the driver."""
    node = suite.probe.node  # type: ignore[attr-defined]
    infos = node.get_subscriptions_info_by_topic("/joint_stiffness")
    return any(info.node_name == "pam_record" for info in infos)
