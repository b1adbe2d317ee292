"""A process starts by itself only if that was asked for, and only while nothing has stopped it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pytest

from pam_driver.boards.protocol import Condition
from pam_driver.driver import ActivationError
from pam_driver.safety.states import SafetyState
from pam_driver.start_up import Advice, StartStep, StartUp

UNTIL = 5.0  # s
MISSING = "no answer from board 0"
BURST = Condition("burst", "biceps", "no pressure")


@dataclass
class Robot:
    """The part of a driver that a start looks at, and what it is told to do."""

    missing: str = ""
    conditions: list[Condition] = field(default_factory=list)
    faults: list[Condition] = field(default_factory=list)
    state: SafetyState = SafetyState.VENTED
    boards_keep_fault: bool = True
    told: list[tuple[str, float]] = field(default_factory=list)

    def activation_problem(self, now: float) -> str:
        return f"{self.missing} at {now} s" if self.missing else ""

    def activate(self, now: float) -> None:
        self.told.append(("activate", now))

    def clear_faults(self, now: float) -> None:
        self.told.append(("clear", now))


def begun(*, activates: bool) -> StartUp:
    start = StartUp()
    start.begin(UNTIL, activates)
    return start


def step(start: StartUp, robot: Any, now: float) -> StartStep:
    return start.step(robot, now)


WAITING = StartStep(Advice.WAIT)


def test_a_start_that_has_not_begun_or_has_ended_waits_for_ever() -> None:
    start = StartUp()
    assert step(start, Robot(), 1e9) == WAITING
    start.begin(UNTIL, True)
    start.end()
    assert step(start, Robot(), 1.0) == WAITING
    assert not start.cancel()


@pytest.mark.parametrize(("activates", "advice"), [(True, Advice.ACTIVATE), (False, Advice.READY)])
def test_the_process_activates_once_and_only_if_asked(activates: bool, advice: Advice) -> None:
    start, robot = begun(activates=activates), Robot(missing=MISSING)
    assert step(start, robot, 1.0) == StartStep(Advice.WAIT, f"{MISSING} at 1.0 s")
    robot.missing = ""
    assert step(start, robot, 2.0) == StartStep(advice)
    assert step(start, robot, 2.0) == WAITING, "a second start by itself"


def test_boards_that_come_too_late_do_not_start_the_robot() -> None:
    start, robot = begun(activates=True), Robot(missing=MISSING)
    assert step(start, robot, UNTIL).advice is Advice.WAIT
    late = UNTIL + 0.1
    assert step(start, robot, late) == StartStep(Advice.GIVE_UP, f"{MISSING} at {late} s")
    robot.missing = ""
    assert step(start, robot, late) == WAITING


@pytest.mark.parametrize("place", ["faults", "conditions"])
def test_a_fault_cancels_the_activation_for_good(place: str) -> None:
    fault = BURST if place == "faults" else Condition("board_fault", "0", "over-pressure")
    start, robot = begun(activates=True), Robot(**{place: [fault]})
    assert step(start, robot, 1.0) == StartStep(Advice.CANCELLED, str(fault))
    robot.faults, robot.conditions = [], []
    assert step(start, robot, 1.5) == StartStep(Advice.READY)


def test_other_conditions_and_faults_without_a_request_do_not_cancel() -> None:
    unmeasured = Condition("no_reading", "biceps", "no pressure yet")
    start = begun(activates=True)
    assert step(start, Robot(conditions=[unmeasured]), 1.0) == StartStep(Advice.ACTIVATE)
    assert step(begun(activates=False), Robot(faults=[BURST]), 1.0) == StartStep(Advice.READY)


def test_cancelling_tells_whether_an_activation_was_waiting() -> None:
    start = begun(activates=True)
    assert start.cancel()
    assert not start.cancel()
    assert step(start, Robot(), 1.0) == StartStep(Advice.READY)
    assert not begun(activates=False).cancel()
    assert not StartUp().cancel()


@pytest.mark.parametrize(
    ("state", "kept", "latched"),
    [
        (SafetyState.FAULT, True, ""),
        (SafetyState.FAULT, False, f"{BURST}; {BURST}"),
        (SafetyState.FAULT_LOWERING, True, f"{BURST}; {BURST}"),
        (SafetyState.FAULT_LOWERING, False, f"{BURST}; {BURST}"),
        (SafetyState.VENTED, False, ""),
    ],
)
def test_a_fault_that_no_board_keeps_outlives_a_clean_up(
    state: SafetyState, kept: bool, latched: str
) -> None:
    start = begun(activates=True)
    robot: Any = Robot(state=state, boards_keep_fault=kept, faults=[BURST, BURST])
    start.leave(robot)
    assert start.latched == latched
    assert not start.cancel(), "the start that was waiting has ended with the driver"
    again: Any = Robot()
    if latched:
        assert latched in start.problem(again, 1.0)
        assert "~/clear_faults" in start.problem(again, 1.0)
        with pytest.raises(ActivationError, match="still latched"):
            start.activate(again, 1.0)
        assert again.told == []
        start.clear_faults(again, 2.0)
        assert start.latched == ""
    start.activate(again, 3.0)
    assert again.told == [("clear", 2.0)] * bool(latched) + [("activate", 3.0)]
    assert start.problem(again, 3.0) == ""
    again.missing = MISSING
    assert start.problem(again, 4.0) == f"{MISSING} at 4.0 s"
