"""Serialized trajectories: read as rclpy reads them, refused when too long, outside the lock."""

import threading
from itertools import repeat
from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy")

from builtin_interfaces.msg import Duration, Time
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from pam_control.command_intake import CommandIntake
from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_control.references.trajectory import CommandError
from pam_control.settings import ControlSettings
from pam_control.trajectory_message import read_trajectory
from pam_ros.errors import MalformedMessageError

numbers = st.lists(st.floats(allow_nan=False), max_size=3)
points = st.builds(
    lambda p, v, a, e, sec, nano: JointTrajectoryPoint(
        positions=p,
        velocities=v,
        accelerations=a,
        effort=e,
        time_from_start=Duration(sec=sec, nanosec=nano),
    ),
    numbers, numbers, numbers, numbers,
    st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1),
)  # fmt: skip
text = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9)


@given(st.lists(text, max_size=3), st.lists(points, max_size=4), text)
def test_a_message_is_read_as_rclpy_would_read_it(names, sent, frame):
    message = JointTrajectory(joint_names=names, points=sent)
    message.header.frame_id = frame
    message.header.stamp = Time(sec=-3, nanosec=7)
    found = read_trajectory(serialize_message(message), 10)
    assert (found.seconds, found.nanoseconds, list(found.names)) == (-3, 7, names)
    assert len(found.points) == len(sent)
    for one, other in zip(found.points, sent, strict=True):
        assert list(one.positions) == list(other.positions)
        assert list(one.velocities) == list(other.velocities)
        assert list(one.accelerations) == list(other.accelerations)
        duration = other.time_from_start
        assert one.time_from_start == duration.sec + 1e-9 * duration.nanosec


@given(st.binary(max_size=200), st.integers(0, 100))
def test_any_bytes_are_read_or_refused(noise, cut):
    whole = serialize_message(long_trajectory(3))
    for data in (noise, whole[: -1 - cut], b"\0\1\0\0" + noise):
        try:
            read_trajectory(data, 10)
        except MalformedMessageError:
            pass
        except CommandError as error:
            assert "points" in str(error)


def long_trajectory(count):
    return JointTrajectory(
        joint_names=["elbow"],
        points=[
            JointTrajectoryPoint(
                positions=[0.2 * index / count],
                velocities=[0.0],
                accelerations=[0.0],
                time_from_start=Duration(sec=index // 100, nanosec=10_000_000 * (index % 100)),
            )
            for index in range(1, count + 1)
        ],
    )


class WatchedLock:
    """A lock that knows whether it is held."""

    def __init__(self):
        self._lock = threading.Lock()
        self.held = False
        self.times = 0

    def __enter__(self):
        self._lock.acquire()
        self.held = True
        self.times += 1

    def __exit__(self, *_):
        self.held = False
        self._lock.release()


@pytest.fixture(scope="module")
def controller(rig):
    return Controller(rig, ControlSettings())


@pytest.fixture
def intake(controller):
    controller.step(0.0, Measurement([0.0], [1e5, 1e5], 0.0, 0.0))
    said, around = [], SimpleNamespace(now=0.0, reasons=repeat(""))
    made = CommandIntake(
        controller, WatchedLock(), lambda: around.now, lambda: next(around.reasons), said.append
    )
    made.said, made.around = said, around
    return made


def test_30000_points_are_read_scaled_and_splined_while_the_lock_is_free(
    intake, controller, monkeypatch
):
    lock = intake._lock
    seen = []
    references = controller.references
    for name in ("plan", "join"):
        inner = getattr(references, name)

        def watched(*given, inner=inner, name=name, **named):
            seen.append((name, lock.held))
            return inner(*given, **named)

        monkeypatch.setattr(references, name, watched)
    data = serialize_message(long_trajectory(30_000))
    intake.trajectory(data, 50_000, lambda _: None)
    assert seen == [("plan", False), ("join", False)]
    assert lock.times > 0
    assert intake.said == []
    assert references.following("elbow") == "trajectory"


def test_too_many_points_are_refused_with_the_name_of_the_parameter(intake, controller):
    controller.references.hold({"elbow": 0.0})
    intake.trajectory(serialize_message(long_trajectory(101)), 100, lambda _: None)
    assert "it has 101 points, expected 100 at most (trajectory.max_points)" in intake.said[0]
    assert controller.references.following("elbow") == "hold"


def test_a_trajectory_that_is_slowed_down_is_told(intake):
    message = long_trajectory(1)
    message.points[0].positions = [0.9]
    intake.trajectory(serialize_message(message), 100, lambda _: None)
    assert "trajectory slowed down" in intake.said[0]
    assert intake.slowed == 1


def test_a_vent_while_a_trajectory_is_read_refuses_it(controller, intake):
    intake.around.reasons = iter(["", "the driver is vented"])
    controller.references.hold({"elbow": 0.0})
    intake.trajectory(serialize_message(long_trajectory(10)), 100, lambda _: None)
    assert "trajectory rejected: the driver is vented" in intake.said[0]
    assert controller.references.following("elbow") == "hold"


def test_a_stream_that_began_before_a_vent_does_not_move_the_joint_afterwards(controller, intake):
    """It may go on after a pause, or from where the joint is."""
    references = controller.references
    references.hold({"elbow": 0.0})
    intake.around.reasons = repeat("the driver is vented")
    intake.stream(["elbow"], [0.8], [])
    intake.around.reasons = repeat("")
    intake.stream(["elbow"], [0.8], [])
    assert "the stream began before elbow stopped" in intake.said[-1]
    assert references.following("elbow") == "hold"
    intake.stream(["elbow"], [0.04], [])
    assert references.following("elbow") == "stream"
    intake.stream(["elbow"], [0.8], [])
    references.stop(["elbow"], 0.0)
    intake.stream(["elbow"], [0.8], [])
    assert references.following("elbow") == "hold"
    intake.around.now = 1.0
    intake.stream(["elbow"], [0.8], [])
    assert references.following("elbow") == "stream"


def test_stiffness_is_refused_while_the_driver_is_vented_and_forgotten_by_a_vent(
    controller, intake
):
    intake.stiffness([19.0])
    assert controller.stiffness_commands == [19.0]
    controller.drop_commands()
    assert controller.stiffness_commands == [pytest.approx(14.0, rel=0.02)]
    intake.around.reasons = repeat("the driver is vented")
    intake.stiffness([19.0])
    assert "stiffness command rejected: the driver is vented" in intake.said[-1]
    assert controller.stiffness_commands == [pytest.approx(14.0, rel=0.02)]
