"""Nothing that must go on stands still because someone sets the wall clock."""

from __future__ import annotations

import threading
import time
from itertools import count

import pytest

pytest.importorskip("rclpy")

from pam_gap.experiments.play_node import PlayNode
from pam_ros import steady_timers
from pam_ros.steady_timers import TURN, SteadyTimers, turns

pytestmark = pytest.mark.system


class Clock:
    """Stands for the module `time` of the timers."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(steady_timers, "time", made)
    return made


def test_a_timer_is_called_once_a_period_and_what_was_missed_is_left_out(clock: Clock) -> None:
    timers, calls = SteadyTimers(), []
    timers.add(0.5, lambda: calls.append(clock.now))
    for _ in range(100):
        timers.call_due()
        clock.now += 0.01
    assert calls == pytest.approx([100.5], abs=0.011)
    calls.clear()
    clock.now = 150.0
    for _ in range(3):
        timers.call_due()
    assert calls == [150.0]
    clock.now = 150.6
    timers.call_due()
    assert calls == [150.0, 150.6]


def test_a_cancelled_timer_waits_for_its_reset(clock: Clock) -> None:
    timers, calls = SteadyTimers(), []
    timer = timers.add(0.5, lambda: calls.append(clock.now))
    timer.cancel()
    clock.now += 10.0
    timers.call_due()
    assert not calls
    timer.reset()
    assert timers.until_next() == pytest.approx(0.5)
    clock.now += 0.5
    timers.call_due()
    assert len(calls) == 1


def test_a_timer_that_is_called_late_keeps_its_grid(clock: Clock) -> None:
    timers = SteadyTimers()
    timer = timers.add(0.5, lambda: None)
    clock.now = 100.625
    timers.call_due()
    assert timer.due == 101.0
    clock.now = 101.5  # exactly one period late
    timers.call_due()
    assert timer.due == 102.0


def test_without_timers_the_next_turn_is_not_far(clock: Clock) -> None:
    assert SteadyTimers().until_next() == TURN


class ExecutorOfWaits:
    """Notes how long it may wait."""

    def __init__(self) -> None:
        self.waits: list[float] = []

    def get_nodes(self) -> list[object]:
        return []

    def wake(self) -> None:
        """Nobody sleeps here."""

    def spin_once(self, timeout_sec: float) -> None:
        self.waits.append(timeout_sec)


def test_the_executor_waits_until_the_next_timer_and_without_timers_for_a_turn() -> None:
    executor, timers, left = ExecutorOfWaits(), SteadyTimers(), count()
    timers.add(0.02, lambda: None)
    for _ in turns(executor, timers, lambda: next(left) < 2):
        pass
    assert all(0.0 < wait <= 0.02 for wait in executor.waits)
    executor.waits.clear()
    for _ in turns(executor, None, lambda: next(left) < 5):
        pass
    assert set(executor.waits) == {TURN}


class StuckExecutor:
    """Waits until it is woken, as rclpy's does after the wall clock was set back."""

    def __init__(self) -> None:
        self._woken = threading.Event()
        self.wakes = 0

    def get_nodes(self) -> list[object]:
        return []

    def wake(self) -> None:
        self.wakes += 1
        self._woken.set()

    def spin_once(self, timeout_sec: float) -> None:
        assert 0.0 < timeout_sec <= TURN
        assert self._woken.wait(5.0), "nobody wakes it"
        self._woken.clear()


def test_an_executor_that_waits_for_ever_is_woken_and_the_timers_go_on() -> None:
    """Else neither SIGTERM nor the driver's state would be noticed for an hour."""
    executor, timers, calls, left = StuckExecutor(), SteadyTimers(), [], count()
    timers.add(0.01, lambda: calls.append(time.monotonic()))
    began = time.monotonic()
    for _ in turns(executor, timers, lambda: next(left) < 4):
        pass
    assert len(calls) == 4
    assert time.monotonic() - began < 3.0
    time.sleep(2.0 * TURN)
    wakes = executor.wakes
    time.sleep(2.0 * TURN)
    assert executor.wakes == wakes, "an executor that has ended is left alone"


def test_an_experiment_is_played_by_a_clock_that_nobody_can_set() -> None:
    before = time.monotonic()
    assert before <= PlayNode._now() <= time.monotonic()
