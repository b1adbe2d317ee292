"""The action FollowJointTrajectory of a running controller, as an action client sees it."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy")

from action_msgs.msg import GoalStatus  # noqa: E402
from builtin_interfaces.msg import Duration  # noqa: E402
from rclpy.action import ActionClient  # noqa: E402
from trajectory_msgs.msg import JointTrajectoryPoint  # noqa: E402

from pam_demo.chain import private_domain  # noqa: E402
from pam_model.rig import load_rig  # noqa: E402
from support.control_msgs_package import control_msgs_folder, missing_for_build  # noqa: E402
from support.processes import end  # noqa: E402
from support.reruns import HOST_STALLS  # noqa: E402

from .controller_bench import CONTROLLER, ELBOW, Bench, command, environment  # noqa: E402

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(bool(missing_for_build()), reason=f"control_msgs: {missing_for_build()}"),
]


class Client:
    """An action client beside the bench."""

    def __init__(self, bench: Bench) -> None:
        try:
            from control_msgs.action import FollowJointTrajectory
        except ImportError:  # no ROS installation with control_msgs
            sys.path.insert(0, str(control_msgs_folder()))
            from control_msgs.action import FollowJointTrajectory
        from control_msgs.msg import JointTolerance

        self.bench = bench
        self.kind, self.tolerance = FollowJointTrajectory, JointTolerance
        name = "pam_controller/follow_joint_trajectory"
        self.client = ActionClient(bench.node, FollowJointTrajectory, name)
        self.feedback: list = []

    def goal(self, position: float = 0.3, duration: float = 1.0, name: str = "elbow"):
        goal = self.kind.Goal()
        goal.trajectory.joint_names = [name]
        point = JointTrajectoryPoint(positions=[position], velocities=[0.0], accelerations=[0.0])
        point.time_from_start = seconds(duration)
        goal.trajectory.points = [point]
        return goal

    def send(self, goal):
        """Send a goal; returns the handle of the client once the goal was accepted."""
        self.bench.wait(self.client.server_is_ready, "the action server")
        self.feedback.clear()
        sent = self.client.send_goal_async(goal, lambda m: self.feedback.append(m.feedback))
        self.bench.wait(sent.done, "the goal to be accepted")
        assert sent.result().accepted
        return sent.result()

    def result(self, handle):
        future = handle.get_result_async()
        self.bench.wait(future.done, "the result")
        return future.result()


def seconds(duration: float) -> Duration:
    return Duration(sec=int(duration), nanosec=int((duration % 1.0) * 1e9))


@pytest.fixture(scope="module")
def client():
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    domain = int(private_domain()["ROS_DOMAIN_ID"])
    bench = Bench(domain)
    made = Client(bench)
    folder = str(control_msgs_folder())
    python_path = os.pathsep.join([*filter(None, [os.environ.get("PYTHONPATH")]), folder])
    process = subprocess.Popen(
        command(ELBOW, CONTROLLER, parameters={"loop.stale_after": 0.25}),
        env={**environment(domain), "PYTHONPATH": python_path},
    )
    try:
        bench.wait(lambda: bench.controls() or process.poll() is not None, "the controller")
        assert process.poll() is None
        bench.wait_until_heard()
        yield made
    finally:
        end(process)
        bench.close()


@pytest.mark.rerun_because(HOST_STALLS)
def test_a_goal_succeeds_and_feedback_names_desired_actual_and_error(client):
    goal = client.goal(0.3)
    goal.path_tolerance = [client.tolerance(name="elbow", position=0.2)]
    goal.goal_tolerance = [client.tolerance(name="elbow", position=0.02)]
    goal.goal_time_tolerance = seconds(5.0)
    answer = client.result(client.send(goal))
    assert answer.status == GoalStatus.STATUS_SUCCEEDED
    assert answer.result.error_code == client.kind.Result.SUCCESSFUL
    assert abs(client.bench.position - 0.3) < 0.03
    assert len(client.feedback) > 5
    last = client.feedback[-1]
    assert list(last.joint_names) == ["elbow"]
    off = last.desired.positions[0] - last.actual.positions[0]
    assert last.error.positions[0] == pytest.approx(off, abs=0.05)
    assert last.desired.time_from_start.sec + 1e-9 * last.desired.time_from_start.nanosec > 0.5


@pytest.mark.rerun_because(HOST_STALLS)
def test_cancel_brakes_within_the_limits_and_holds(client):
    handle = client.send(client.goal(-0.5, 2.0))
    bench = client.bench
    bench.wait(lambda: bench.references[-1].velocity[0] < -0.3, "the motion")
    before = len(bench.references)
    cancelled = handle.cancel_goal_async()
    bench.wait(cancelled.done, "the answer to the cancel request")
    assert client.result(handle).status == GoalStatus.STATUS_CANCELED
    bench.wait(lambda: bench.references[-1].velocity[0] == 0.0, "the stop")
    heard = bench.references[before:]
    times = np.array([m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in heard])
    speeds = np.array([m.velocity[0] for m in heard])
    # the reference belongs to a measurement whose time varies by a few milliseconds
    spaced = np.diff(times) > 0.005
    limit = load_rig(ELBOW).joints[0].max_acceleration
    assert np.abs(np.diff(speeds)[spaced] / np.diff(times)[spaced]).max() < 2.0 * limit
    assert bench.references[-1].position[0] > -0.45


@pytest.mark.rerun_because(HOST_STALLS)
def test_a_newer_goal_and_a_topic_trajectory_preempt(client):
    first = client.send(client.goal(0.5, 4.0))
    second = client.send(client.goal(0.2, 4.0))
    replaced = client.result(first)
    assert replaced.status == GoalStatus.STATUS_ABORTED
    assert replaced.result.error_code == client.kind.Result.INVALID_GOAL
    assert "newer goal" in replaced.result.error_string
    client.bench.send([0.1], 1.0)
    replaced = client.result(second)
    assert replaced.status == GoalStatus.STATUS_ABORTED
    assert "another trajectory" in replaced.result.error_string


@pytest.mark.rerun_because(HOST_STALLS)
def test_goals_that_cannot_be_meant_are_aborted_and_the_running_goal_goes_on(client):
    running = client.send(client.goal(0.25, 3.0))
    codes = client.kind.Result
    empty = client.goal()
    empty.trajectory.points = []
    old = client.goal()
    old.trajectory.header.stamp.sec = int(time.time()) - 60
    strange = client.goal()
    strange.path_tolerance = [client.tolerance(name="elbow", position=-3.0)]
    for goal, code, text in (
        (empty, codes.INVALID_GOAL, "no points"),
        (client.goal(name="knee"), codes.INVALID_JOINTS, "knee"),
        (old, codes.OLD_HEADER_TIMESTAMP, "ago"),
        (client.goal(position=9.0), codes.INVALID_GOAL, "position_limits"),
        (strange, codes.INVALID_GOAL, "position = -3"),
    ):
        answer = client.result(client.send(goal))
        assert answer.status == GoalStatus.STATUS_ABORTED
        assert answer.result.error_code == code
        assert text in answer.result.error_string
    assert client.result(running).status == GoalStatus.STATUS_SUCCEEDED


@pytest.mark.rerun_because(HOST_STALLS)
def test_tolerances_on_the_way_and_at_the_end_abort_with_their_code(client):
    goal = client.goal(-0.3, 0.5)
    goal.path_tolerance = [client.tolerance(name="elbow", position=1e-5)]
    answer = client.result(client.send(goal))
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert answer.result.error_code == client.kind.Result.PATH_TOLERANCE_VIOLATED
    goal = client.goal(0.0, 0.5)
    goal.goal_tolerance = [client.tolerance(name="elbow", position=1e-9)]
    goal.goal_time_tolerance = seconds(0.2)
    answer = client.result(client.send(goal))
    assert answer.result.error_code == client.kind.Result.GOAL_TOLERANCE_VIOLATED


def test_a_vent_of_the_driver_aborts_with_its_reason(client):
    bench = client.bench
    bench.activate()
    handle = client.send(client.goal(0.3, 5.0))
    bench.wait(lambda: client.feedback, "feedback")
    bench.say("vented", "a call of ~/vent")
    answer = client.result(handle)
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert "a call of ~/vent" in answer.result.error_string
    refused = client.result(client.send(client.goal(0.3)))
    assert "a call of ~/vent" in refused.result.error_string
