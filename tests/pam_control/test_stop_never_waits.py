"""Nothing that takes longer than a cycle is done where `~/stop` would wait for it.

The node runs in this process, without a bus; its executor's thread is that of the test. Work that
is slow is made endless here, until the test lets it go: no time is measured.
"""

from __future__ import annotations

import dataclasses
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy")

from rclpy.parameter import Parameter as RosParameter  # noqa: E402
from rclpy.serialization import serialize_message  # noqa: E402
from std_msgs.msg import Float64MultiArray  # noqa: E402
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint  # noqa: E402

from pam_control import adapted_rig, operator_services  # noqa: E402
from pam_control.control_step import Measurement  # noqa: E402
from pam_control.controller_node import ControllerNode  # noqa: E402
from pam_control.loop_design import LoopDesign, PreparedSettings  # noqa: E402
from pam_control.reference_limits import ReferenceLimits  # noqa: E402
from pam_control.settings import ControlSettings  # noqa: E402
from pam_demo.chain import private_domain  # noqa: E402
from pam_ros.start import start_ros  # noqa: E402
from pam_ros.unforeseen import guard_callbacks, raise_handed_over  # noqa: E402
from support.rigs import ELBOW  # noqa: E402

PATIENCE = 60.0  # s


@pytest.fixture(scope="module")
def node(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ControllerNode]:
    folder = tmp_path_factory.mktemp("files")
    patch = pytest.MonkeyPatch()
    for key, value in private_domain().items():
        patch.setenv(key, value)
    start_ros(["--ros-args", "--params-file", str(ELBOW), "-p", f"files.folder:={folder}"])
    made = ControllerNode()
    made.loop.stop(timeout=5.0)  # the test makes the steps
    yield made
    made.destroy_node()
    rclpy.try_shutdown()
    patch.undo()


@pytest.fixture
def active(node: ControllerNode) -> ControllerNode:
    """It controls a joint that rests."""
    settle(node)
    node._controller.guard.clear()
    step(node)
    return node


def step(node: ControllerNode) -> None:
    now = node._now()
    output = node._controller.step(now, Measurement([0.0], [2e5, 2e5], now, now))
    assert output.commands is not None, output.reason


def settle(node: ControllerNode) -> None:
    """What is slow has ended."""
    works = (node._designing, node._planning, node._foreseeing, node._writing)
    until(node, lambda: not any(each.busy for each in works))


def until(node: ControllerNode, condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        node.steady_timers.call_due()
        time.sleep(0.001)


def change(node: ControllerNode, name: str, value: object) -> Any:
    return node.set_parameters_atomically([RosParameter(name, value=value)])


def value_of(node: ControllerNode, name: str) -> Any:
    return node.get_parameter(name).value


def stop(node: ControllerNode) -> Any:
    return node.operator_services.on_stop(None, SimpleNamespace(success=False, message=""))


def trajectory(*positions: float) -> bytes:
    message = JointTrajectory(joint_names=["elbow"])
    for number, position in enumerate(positions, 1):
        point = JointTrajectoryPoint(positions=[position])
        point.time_from_start.sec = number
        message.points.append(point)
    return bytes(serialize_message(message))


class Gate:
    """Work that begins and does not end before it is let go."""

    def __init__(self, work: Callable[..., Any]) -> None:
        self.begun, self.open = threading.Event(), threading.Event()
        self._work = work

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        assert threading.current_thread() is not threading.main_thread(), "stop would wait"
        self.begun.set()
        assert self.open.wait(PATIENCE)
        return self._work(*arguments, **named)


def gated_design(monkeypatch: pytest.MonkeyPatch) -> Gate:
    """Every design waits for this gate."""
    gate = Gate(LoopDesign._designed_and_checked)

    def design(*arguments: Any) -> PreparedSettings:
        return gate(*arguments)

    monkeypatch.setattr(LoopDesign, "_designed_and_checked", design)
    return gate


def test_a_design_that_takes_for_ever_keeps_nobody_waiting(
    active: ControllerNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = active
    gate = gated_design(monkeypatch)
    before = value_of(node, "design.extra_delay")
    result = change(node, "design.extra_delay", 0.012)
    assert result.successful
    assert "being designed" in result.reason
    assert gate.begun.wait(PATIENCE)
    assert stop(node).success
    assert node._changes.values["design.extra_delay"] == before
    assert node._controller.settings.extra_delay == before
    assert "design.extra_delay for" in loop_values(node)["being designed"]
    assert "being designed" in change(node, "stream.timeout", 0.3).reason  # in its turn
    gate.open.set()
    settle(node)
    assert node._controller.settings.extra_delay == 0.012
    assert node._controller.settings.stream_timeout == 0.3
    assert loop_values(node)["being designed"] == "nothing"
    assert not change(node, "stream.timeout", 0.2).reason  # at once


def loop_values(node: ControllerNode) -> dict[str, str]:
    status = node._health.statuses(node._now(), "", "", node.loop, (0.0, 0.0))[0]
    return {pair.key: pair.value for pair in status.values}


def test_a_design_that_is_not_safe_is_told_and_taken_back(active: ControllerNode) -> None:
    node = active
    before = value_of(node, "gains.elbow.derivative")
    assert "being designed" in change(node, "gains.elbow.derivative", 8.0).reason
    assert value_of(node, "gains.elbow.derivative") == 8.0
    settle(node)
    assert value_of(node, "gains.elbow.derivative") == before
    assert "phase margin" in loop_values(node)["last change refused"]
    assert change(node, "stream.timeout", 0.25).successful
    assert loop_values(node)["last change refused"] == "none"


def test_too_many_changes_are_refused(
    active: ControllerNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = active
    gate = gated_design(monkeypatch)
    results = [change(node, "design.extra_delay", 0.011 + 1e-5 * i) for i in range(20)]
    assert [each.successful for each in results].count(True) == 8
    assert "8 changes wait for a design" in results[-1].reason
    monkeypatch.setattr(LoopDesign, "_designed_and_checked", gate._work)
    gate.open.set()
    settle(node)
    assert node._controller.settings.extra_delay == pytest.approx(0.01107)
    assert value_of(node, "design.extra_delay") == pytest.approx(0.01107)


@pytest.mark.parametrize("how", ["stop", "empty trajectory", "stream", "driver"])
def test_a_stop_undoes_a_trajectory_that_is_still_being_planned(
    active: ControllerNode, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    node = active
    gate = Gate(node._controller.references.plan)
    monkeypatch.setattr(node._controller.references, "plan", gate)
    node.reference_topics.on_trajectory(trajectory(0.1, 0.5))
    assert gate.begun.wait(PATIENCE)
    if how == "stop":
        assert stop(node).success
    elif how == "empty trajectory":
        node.reference_topics.on_trajectory(trajectory())
    elif how == "stream":
        node.reference_topics.on_stream(
            SimpleNamespace(name=["elbow"], position=[0.01], velocity=[])
        )
    else:
        with node._lock:
            node._controller.drop_commands()
            node.intake.supersede()
        step(node)
    rejected = node.intake.rejected
    gate.open.set()
    settle(node)
    assert node._controller.references.following("elbow") != "trajectory"
    assert node.intake.rejected == rejected + 1
    assert "another command for elbow, such as a stop," in node.intake.last_rejection[0]


def test_trajectories_are_followed_in_their_order(active: ControllerNode) -> None:
    node = active
    for goal in (0.1, 0.2, 0.3):
        node.reference_topics.on_trajectory(trajectory(goal))
    settle(node)
    assert node._controller.references.spline("elbow").end_position == pytest.approx(0.3)


def test_a_flood_of_trajectories_is_refused(
    active: ControllerNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = active
    gate = Gate(node._controller.references.plan)
    monkeypatch.setattr(node._controller.references, "plan", gate)
    rejected = node.intake.rejected
    for _ in range(50):
        node.reference_topics.on_trajectory(trajectory(0.1))
    assert node.intake.rejected == rejected + 40
    assert stop(node).success
    gate.open.set()
    settle(node)


def test_limits_for_a_new_stiffness_are_computed_elsewhere(
    active: ControllerNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = active
    gate = Gate(node._controller.limits._limits._limits)
    monkeypatch.setattr(node._controller.limits._limits, "_limits", gate)
    node.reference_topics.on_stiffness(Float64MultiArray(data=[5.37]))
    assert gate.begun.wait(PATIENCE)
    node.reference_topics.on_stiffness(Float64MultiArray(data=[7.93]))  # known or not: in its turn
    assert stop(node).success
    gate.open.set()
    settle(node)
    assert node._controller.stiffness_commands == [7.93]
    node.reference_topics.on_stiffness(Float64MultiArray(data=[5.37]))  # known now: at once
    assert node._controller.stiffness_commands == [5.37]


def test_a_rig_file_is_written_elsewhere_and_only_in_the_folder(
    active: ControllerNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = active
    made = adapted_rig.AdaptedRig(node.rig, ("a number",), ())
    monkeypatch.setattr(operator_services, "adapted_rig", lambda *_: made)
    gate = Gate(operator_services.save_adapted_rig)
    monkeypatch.setattr(operator_services, "save_adapted_rig", gate)
    assert change(node, "adaptation.rig_file", "learnt.yaml").successful
    answer = node.operator_services.on_save(None, SimpleNamespace(success=False, message=""))
    assert answer.success
    assert "being written" in answer.message
    assert stop(node).success
    gate.open.set()
    settle(node)
    assert (Path(value_of(node, "files.folder")) / "learnt.yaml").is_file()


OUTSIDE = ["/etc/passwd", "../x", "a/../../x", "~/x", "link/x", "", "\0", "x" * 5000]


@pytest.mark.parametrize("name", OUTSIDE)
def test_no_parameter_names_a_file_outside_of_the_folder(active: ControllerNode, name: str) -> None:
    """Every text that may change is tried; the name of a motion is no file."""
    node = active
    folder = Path(value_of(node, "files.folder"))
    if not (folder / "link").exists():
        (folder / "link").symlink_to("/tmp")
    texts = [p.name for p in node._table if isinstance(p.default, str) and p.changeable]
    assert {"learning.file", "adaptation.rig_file", "learning.motion"} == set(texts)
    for key in ("learning.file", "adaptation.rig_file"):
        assert change(node, key, "").successful
        result = change(node, key, name)
        if name not in ("", "x" * 5000):
            assert not result.successful
            assert f"must be the name of a file in {folder}" in result.reason
            assert len(result.reason) < 400
        settle(node)


ANOTHER = {"law": None, "learning.file": "kept.json", "adaptation.rig_file": "new.yaml"}


def test_no_parameter_keeps_a_stop_waiting(
    active: ControllerNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every parameter that may change: its design, its files, its reading are done elsewhere."""
    node = active
    here: list[str] = []

    def as_asked(_: LoopDesign, settings: ControlSettings) -> PreparedSettings:
        """In place of a design, which takes its time."""
        return dataclasses.replace(node._controller.prepared, asked=settings)

    monkeypatch.setattr(LoopDesign, "_designed_and_checked", as_asked)
    for owner, name in (
        (LoopDesign, "_designed_and_checked"),
        (LoopDesign, "_with_learning"),
        (ReferenceLimits, "foresee"),
    ):
        work = getattr(owner, name)

        def elsewhere(*arguments: Any, _work: Any = work, _name: str = name, **named: Any) -> Any:
            if threading.current_thread() is threading.main_thread():
                here.append(_name)
            return _work(*arguments, **named)

        monkeypatch.setattr(owner, name, elsewhere)
    watching = True

    def opened(event: str, arguments: tuple[Any, ...]) -> None:
        if watching and event == "open" and threading.current_thread() is threading.main_thread():
            here.append(f"open {arguments[0]}")

    sys.addaudithook(opened)
    try:
        assert change(node, "learning.motion", "reach").successful
        for parameter in node._table:
            if not parameter.changeable:
                continue
            former = value_of(node, parameter.name)
            for value in (another(parameter, former), former):
                change(node, parameter.name, value)
                assert not here, (parameter.name, here)
    finally:
        watching = False
        settle(node)
        change(node, "learning.motion", "")
        settle(node)


def another(parameter: Any, former: Any) -> Any:
    """Another value that a user may set."""
    if isinstance(former, bool):
        return not former
    if isinstance(former, str):
        return ANOTHER.get(parameter.name, "reach")
    if isinstance(former, int):
        return min(former + 1, int(parameter.high))
    return former * 1.01 if 0.0 < former * 1.01 <= parameter.high else max(0.02, parameter.low)


def test_a_trajectory_that_ends_too_early_is_counted_as_malformed(active: ControllerNode) -> None:
    """It is read in another thread, and must not end the node from there."""
    node = active
    guard_callbacks(node)  # as the main loop does
    (take,) = [
        one.callback for one in node.subscriptions if one.topic_name.endswith("joint_trajectory")
    ]
    before = node.reference_topics.trajectories.count
    take(trajectory(0.1, 0.2)[:-40])
    settle(node)
    take(trajectory()[:10])  # a stop is read at once
    raise_handed_over()
    assert node.reference_topics.trajectories.count == before + 2
