"""A "no" that came and went between two cycles acts as one that was seen.

Whoever forbids may say so for one message or frame, while the driver stands still or others flood
the topic. The cases are drawn: when it is said, how long the driver pauses, how fast others
publish.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy")

from pam_driver.boards.pam_board.codec import BoardCodec, BoardFault, BoardState, Status
from pam_driver.boards.pam_board.messages import Measurement, SafetyInput
from pam_driver.boards.protocol import EMERGENCY_STOP, ENABLING_SWITCH, Condition
from pam_driver.can_bus.bus import BusState, ReceivedFrame, SendOutcome
from pam_driver.driver import Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.people_inputs import PeopleInputs
from pam_driver.safety.since_judged import SinceJudged
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand
from pam_model.rig import People, Rig
from pam_ros.polled_topic import EVERY, PolledTopic

from .fake_board import FakeBoard

NAMES = ("elbow_flexor", "elbow_extensor")
VENTS = {SafetyState.VENTING, SafetyState.VENTED}
PRESSES = 1000
CYCLE = 0.002


class End:
    """One end of a bus without hardware; frames wait until they are read."""

    state = BusState.ERROR_ACTIVE

    def __init__(self) -> None:
        self.waiting: list[ReceivedFrame] = []
        self.far: End = self

    def receive_all(self, now: float) -> list[ReceivedFrame]:
        waiting, self.waiting = self.waiting, []
        return waiting

    def send(self, frame_id: int, data: bytes, now: float) -> SendOutcome:
        self.far.waiting.append(ReceivedFrame(frame_id, data, now))
        return SendOutcome.SENT


class Queue:
    """A subscription of the middleware: it keeps the last messages, and drops older ones."""

    def __init__(self) -> None:
        self.waiting: deque[bytes] = deque()

    def create_subscription(self, kind: Any, topic: str, take: Any, qos: Any, raw: bool) -> Any:
        self.waiting = deque(maxlen=qos.depth)
        subscription = SimpleNamespace(handle=self, callback=take)
        self._subscriptions = [subscription]
        return subscription

    def resolve_topic_name(self, topic: str) -> str:
        return topic

    def get_name(self) -> str:
        return "driver"

    get_namespace = get_logger = get_clock = get_name

    def create_timer(self, *_: object, **__: object) -> None: ...

    def __enter__(self) -> None: ...

    def __exit__(self, *error: object) -> None: ...

    def take_message(self, kind: Any, raw: bool) -> Any:
        if not self.waiting:
            return None
        return self.waiting.popleft(), {"received_timestamp": 0}


class Bench:
    """A driver with one board and the topics of people, on a clock of its own."""

    def __init__(self, rig: Rig, codec: BoardCodec, people: People) -> None:
        near, far = End(), End()
        near.far, far.far = far, near
        self.rig = replace(rig, people=people)
        self.codec = codec
        self.driver = Driver(self.rig, near, DriverSettings())
        self.board = FakeBoard(far, codec)  # type: ignore[arg-type]
        self.queue = Queue()
        self.topics = []
        for name in self.driver.people.topics:
            self.topics.append(self._topic(name))
        self.now = 100.0

    def _topic(self, name: str) -> PolledTopic:
        def hear(data: bytes) -> None:
            self.driver.people.hear_topic(name, data == b"1", self.now)

        return PolledTopic(self.queue, None, name, hear, read=bytes, overflow=lambda: hear(b"0"))

    def say(self, permits: bool) -> None:
        self.queue.waiting.append(b"1" if permits else b"0")

    def cycle(self, pause: float = CYCLE, command: bool = False) -> None:
        """One cycle of the driver after a pause; its board goes on all the time."""
        for _ in range(round(pause / CYCLE)):
            self.now += CYCLE
            self.board.step(self.now)
        if command:
            named = NamedCommand(NAMES, (0.1, 0.1))
            self.driver.set_commands(named, self.now)
        for topic in self.topics:
            topic.poll()
        self.driver.cycle(self.now, self.now)

    def start(self) -> None:
        """From wherever it is to moving air."""
        self.driver.clear_faults(self.now)
        for _ in range(50):
            self.say(True)
            self.cycle()
            if not self.driver.activation_problem(self.now):
                break
        self.driver.activate(self.now)
        for _ in range(3):
            self.say(True)
            self.cycle(command=True)
        assert self.driver.state is SafetyState.ACTIVE, self.driver.faults


def pressed_once(bench: Bench, draw: random.Random, say: Any, most: int = 3 * EVERY) -> None:
    """Permissions at a drawn rate, and one "no" at a drawn moment between two drawn cycles."""
    pause = draw.choice((CYCLE, 0.004, 0.02, draw.choice((0.07, draw.uniform(0.004, 0.07)))))
    flood = draw.choice((1, 2, 10, 100, most))  # messages between two cycles
    press = draw.randrange(flood)
    for number in range(flood):
        if number == press:
            say(False)
        say(True)
    if pause < 0.05:
        bench.cycle(pause, command=True)
    else:  # no command came during the pause either
        bench.cycle(pause)


@pytest.mark.parametrize("seed", range(10))
def test_an_emergency_stop_of_one_message_is_latched_each_time(
    rig: Rig, codec: BoardCodec, seed: int
) -> None:
    """1000 presses, during pauses and floods; those that are lost in a flood count, too."""
    bench, draw = Bench(rig, codec, People(emergency_stop_topic=True)), random.Random(seed)
    for number in range(PRESSES // 10):
        bench.start()
        pressed_once(bench, draw, bench.say)
        assert bench.driver.state is SafetyState.FAULT, number
        kinds = {fault.kind for fault in bench.driver.faults}
        assert EMERGENCY_STOP in kinds, (number, bench.driver.faults)
        bench.board.step(bench.now)
        assert not any(bench.board.air)


def test_an_enabling_switch_released_for_one_message_vents_each_time(
    rig: Rig, codec: BoardCodec
) -> None:
    bench, draw = Bench(rig, codec, People(enabling_switch_topic=True)), random.Random(1)
    for number in range(100):
        bench.start()
        pressed_once(bench, draw, bench.say)
        assert bench.driver.state in VENTS | {SafetyState.FAULT}, number
        assert bench.driver.state in VENTS or bench.driver.faults[0].kind == "driver_paused"
        assert "the enabling switch is released" in bench.driver.vent_reason


def status(bench: Bench, **changes: Any) -> None:
    """The board sends another status at once."""
    good = {
        "state": bench.board.state,
        "faults": BoardFault(0),
        "command_counter": bench.board._heard or 0,
        "supply_pressure": 701_320.0,
        "rejected_frames": 0,
        **bench.board.inputs,
    }
    bench.board.port.send(*bench.codec.encode(0, Status(**{**good, **changes})), bench.now)


@pytest.mark.parametrize("name", [EMERGENCY_STOP, ENABLING_SWITCH])
def test_an_input_of_a_board_that_forbids_in_one_frame_acts_each_time(
    rig: Rig, codec: BoardCodec, name: str
) -> None:
    bench, draw = Bench(rig, codec, People()), random.Random(2)
    permit, forbid = SafetyInput.PERMIT, SafetyInput.STOP
    bench.board.inputs[name] = permit
    for number in range(100):
        bench.start()
        pressed_once(
            bench, draw, lambda permits: status(bench, **{name: permit if permits else forbid}), 256
        )
        if name == EMERGENCY_STOP:
            assert EMERGENCY_STOP in {fault.kind for fault in bench.driver.faults}, number
        else:
            assert bench.driver.state in VENTS, number


def frame(bench: Bench, pressure: float, angle: float) -> None:
    """A measurement between two of the board."""
    bench.board.counter = (bench.board.counter + 1) & 0xFF
    message = Measurement((pressure, 0.0), angle, bench.board.counter)
    bench.board.port.send(*bench.codec.encode(0, message), bench.now)


PASSING = {
    "board_fault": lambda bench: status(bench, faults=BoardFault.SUPPLY),
    "board_fault by state": lambda bench: status(bench, state=BoardState.FAULT),
    "board_not_active": lambda bench: status(bench, state=BoardState.VENTED),
    "over_pressure": lambda bench: frame(bench, 690e3, 0.0),
    "position_limit": lambda bench: frame(bench, 0.0, 2.5),
}


@pytest.mark.parametrize("what", PASSING)
def test_what_a_board_reports_in_passing_is_a_fault(rig: Rig, codec: BoardCodec, what: str) -> None:
    bench = Bench(rig, codec, People())
    bench.start()
    for _ in range(300):
        bench.cycle(command=True)
    assert bench.driver.state is SafetyState.ACTIVE, bench.driver.faults
    PASSING[what](bench)
    bench.board._sent.clear()  # the next frames say that all is well
    bench.cycle(command=True)
    assert what.split(maxsplit=1)[0] in {fault.kind for fault in bench.driver.faults}


def conditions() -> Iterator[Condition]:
    yield Condition("a", "x", "now")


def test_what_was_kept_is_told_once_beside_what_holds() -> None:
    kept = SinceJudged()
    kept.keep([Condition("a", "x", "before"), Condition("b", "x", "first")])
    kept.keep([Condition("b", "x", "second")])
    assert [str(one) for one in kept.added_to(conditions())] == ["x: now", "x: first"]
    assert [one.kind for one in kept.added_to((), "a")] == ["a"]
    kept.judged()
    assert [one.text for one in kept.added_to(conditions())] == ["now"]


def test_a_no_is_heard_by_who_asks_before_the_next_cycle() -> None:
    people = PeopleInputs(People(emergency_stop_topic=True), {})
    people.hear_topic(EMERGENCY_STOP, False, 1.0)
    people.hear_topic(EMERGENCY_STOP, True, 1.0)
    assert people.pressed(1.0)
    people.judged()
    assert not people.pressed(1.0)
