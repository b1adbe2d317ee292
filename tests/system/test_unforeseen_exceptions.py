"""An exception in any callback or loop of any node ends the node; none is swallowed.

The nodes are found in the packages, and their callbacks in the nodes, so that a new one is tested
by itself. What the driver does with the arm then is in tests/pam_driver/test_driver_breaks.py.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy")

import rclpy
from rcl_interfaces.srv import SetParameters
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState

import pam_bringup
import pam_control
import pam_demo
import pam_driver
import pam_gap
import pam_model
import pam_sim
from pam_demo.chain import private_domain
from pam_gap.experiments.excitations import Menu
from pam_gap.experiments.files import write_experiment
from pam_model.rig import load_rig
from pam_ros.node_end import end_node
from pam_ros.periodic import PeriodicLoop
from pam_ros.steady_timers import turns
from support.rigs import CONFIG

pytestmark = pytest.mark.system

PACKAGES = (pam_model, pam_driver, pam_control, pam_sim, pam_gap, pam_demo, pam_bringup)
PATIENCE = 30.0
ELBOW = CONFIG / "elbow.yaml"
# rclpy's own services, whose callbacks are rclpy's
OF_RCLPY = ("parameter", "get_type_description", "_state", "available_", "transition_graph")


class NoWriter:
    """Where a recorder would write."""

    def add_connection(self, *_: object, **__: object) -> None: ...


MADE_WITH: dict[str, Callable[[type], Any]] = {
    "RecordNode": lambda kind: kind("", NoWriter(), SimpleNamespace()),
    "Recorder": lambda kind: kind(NoWriter()),
    "ViewerNode": lambda kind: kind("", SimpleNamespace()),
    "PlayerNode": lambda kind: kind(("elbow",)),
    "RosPortNode": lambda kind: kind(load_rig(ELBOW), "elbow", 0.002),
}
PARAMETERS: dict[str, dict[str, object]] = {
    "DriverNode": {
        "bus.interface": "virtual",
        "bus.channel": uuid.uuid4().hex,
        "people.emergency_stop_topic": "true",
        "people.enabling_switch_topic": "true",
        "people.full_speed_topic": "true",
    },
    "RigNode": {"bus.interface": "virtual", "bus.channel": uuid.uuid4().hex},
}


class UnforeseenError(Exception):
    """Nobody foresaw it."""


def node_classes() -> dict[str, type]:
    """Every class of a node in the packages."""
    found = {}
    for package in PACKAGES:
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if module.name.endswith("_node"):
                members = inspect.getmembers(importlib.import_module(module.name), inspect.isclass)
                found |= {n: c for n, c in members if issubclass(c, Node) and c is not Node}
    return {name: kind for name, kind in found.items() if kind.__module__.startswith("pam_")}


CLASSES = node_classes()


def boom(*_: object) -> None:
    raise UnforeseenError


class Callbacks:
    """The callbacks of a node: how each is replaced, restored and provoked."""

    def __init__(self, node: Any, peer: Node, loops: list[PeriodicLoop]) -> None:
        self.node, self.peer, self.loops = node, peer, loops
        self.kept: list[Any] = []

    def all(self) -> Iterator[tuple[str, Any, str, Callable[[], object]]]:
        """Name, owner and attribute of each callback, and what makes it called."""
        polled = getattr(self.node, "polled_topics", [])
        for subscription in self.node.subscriptions:
            yield self._subscription(subscription, subscription, "callback")
        for topic in polled:
            yield self._subscription(topic.subscription, topic, "_take")
        for service in self.node.services:
            if not any(word in service.srv_name for word in OF_RCLPY):
                client = self.peer.create_client(
                    service.srv_type, self.node.resolve_service_name(service.srv_name)
                )
                self.kept.append(client)
                request = service.srv_type.Request()
                ask = self._asking(client, request)
                yield f"service {service.srv_name}", service, "callback", ask
        for timer in self.node.timers:
            timer.timer_period_ns = 1_000_000
            yield f"timer {timer}", timer, "callback", lambda: None
        for timer in getattr(getattr(self.node, "steady_timers", None), "_timers", []):
            yield f"steady timer {timer.callback}", timer, "callback", self._due(timer)
        for loop in self.loops:
            yield f"loop {loop._name}", loop, "_step", lambda: None
        if self.node._on_set_parameters_callbacks:
            name = f"{self.node.get_fully_qualified_name()}/set_parameters"
            client = self.peer.create_client(SetParameters, name)
            self.kept.append(client)
            number = next(iter(self.node._parameters.values()))
            request = SetParameters.Request(parameters=[number.to_parameter_msg()])
            ask = self._asking(client, request)
            yield "parameters", self.node, "_on_set_parameters_callbacks", ask

    def _subscription(self, subscription: Any, owner: Any, attribute: str) -> Any:
        kind, name = subscription.msg_type, subscription.topic_name
        publisher = self.peer.create_publisher(kind, name, subscription.qos_profile)
        self.kept.append(publisher)
        return f"topic {name}", owner, attribute, lambda: publisher.publish(kind())

    @staticmethod
    def _asking(client: Any, request: Any) -> Callable[[], None]:
        asked: list[object] = []

        def ask() -> None:
            if not asked and client.service_is_ready():
                asked.append(client.call_async(request))

        return ask

    @staticmethod
    def _due(timer: Any) -> Callable[[], None]:
        def make_due() -> None:
            timer.due = 0.0

        return make_due


def raises(node: Any, provoke: Callable[[], object]) -> bool:
    """Whether the main loop of the node raises UnforeseenError."""
    loop = getattr(node, "loop", None)
    check = getattr(node, "check", loop.check if loop is not None else lambda: None)
    executor = EventsExecutor()
    executor.add_node(node)
    deadline = time.monotonic() + PATIENCE
    try:
        for _ in turns(
            executor, getattr(node, "steady_timers", None), lambda: time.monotonic() < deadline
        ):
            provoke()
            check()
    except UnforeseenError:
        return True
    finally:
        executor.remove_node(node)
        executor.shutdown()
    return False


@pytest.fixture(autouse=True)
def _ends() -> Iterator[None]:
    yield
    rclpy.try_shutdown()


@pytest.fixture
def loops(monkeypatch: pytest.MonkeyPatch) -> list[PeriodicLoop]:
    """The loops that are made."""
    made: list[PeriodicLoop] = []
    start = PeriodicLoop.start

    def noting(self: PeriodicLoop) -> None:
        if self not in made:
            made.append(self)
        start(self)

    monkeypatch.setattr(PeriodicLoop, "start", noting)
    return made


def make(name: str, tmp_path: Path) -> Any:
    words = ["--ros-args", "--params-file", str(ELBOW)]
    words += [w for k, v in PARAMETERS.get(name, {}).items() for w in ("-p", f"{k}:={v}")]
    if name == "PlayNode":
        words += ["-p", f"experiment:={experiment(tmp_path)}"]
    domain = int(private_domain()["ROS_DOMAIN_ID"])
    with_words = name not in MADE_WITH
    rclpy.init(args=words if with_words else [], domain_id=domain)
    kind = CLASSES[name]
    return MADE_WITH.get(name, lambda kind: kind())(kind)


@pytest.mark.parametrize("name", sorted(CLASSES))
def test_an_exception_in_a_callback_or_loop_reaches_the_main_loop(
    name: str, tmp_path: Path, loops: list[PeriodicLoop], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    node = make(name, tmp_path)
    if name == "DriverNode":
        assert node.autostart()
    peer = Node("peer")
    swallowed, tried = [], []
    try:
        if name in {"RecordNode", "Recorder"}:
            topic = peer.create_publisher(*measurement())
            join = getattr(node, "join", None) or node.join_new_topics
            while not list(node.subscriptions):
                topic.publish(measurement()[0]())
                join()
        for what, owner, attribute, provoke in Callbacks(node, peer, loops).all():
            before = getattr(owner, attribute)
            setattr(owner, attribute, [boom] if isinstance(before, list) else boom)
            tried.append(what)
            print(what, time.monotonic())
            if not raises(node, provoke):
                swallowed.append(what)
                print("SWALLOWED", what)
            setattr(owner, attribute, before)
            for loop in loops:
                if not loop.running:
                    loop._error = None
                    loop._thread = None
                    loop.start()
            if name == "DriverNode":
                node._driver.broken = None
    finally:
        if name == "DriverNode":
            node.close()
        end_node(node)
        end_node(peer)
    assert not swallowed
    assert tried


def measurement() -> tuple[Any, str, int]:
    return JointState, "joint_states", 1


def experiment(folder: Path) -> Path:
    """An experiment as a diagnosis proposes it."""
    rig = load_rig(ELBOW)
    swing = next(e for e in Menu(rig, 0, 0.01).entries() if e.name == "vented_swing")
    write_experiment(folder, rig, 0, swing, {})
    return folder
