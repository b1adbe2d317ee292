"""The periodic loop: it keeps its grid, tells of its errors, and ends when told."""

import json
import os
import subprocess
import sys
import threading
import time

import pytest

from pam_ros.periodic import PeriodicLoop, take_priority

pytestmark = pytest.mark.system

WAIT = 10.0


class Count:
    """A step that counts, and says when it has been called often enough."""

    def __init__(self, enough: int) -> None:
        self.enough = enough
        self.times: list[float] = []
        self.done = threading.Event()

    def __call__(self, now: float) -> None:
        self.times.append(now)
        if len(self.times) >= self.enough:
            self.done.set()


def test_calls_at_deadlines_until_stopped() -> None:
    count = Count(20)
    loop = PeriodicLoop(count, 0.005)
    loop.start()
    assert count.done.wait(WAIT)
    assert loop.running
    loop.stop()
    assert not loop.running
    calls = len(count.times)
    statistics = loop.statistics
    assert statistics.cycles == calls >= 20
    # never early: call i is not before deadline i of a grid that starts with the loop
    first = count.times[0] - statistics.worst_lateness
    for index, now in enumerate(count.times):
        assert now >= first + index * 0.005 - 1e-9
    time.sleep(0.02)
    assert len(count.times) == calls


def test_missed_deadlines_are_skipped_and_the_grid_is_kept() -> None:
    count = Count(4)

    def step(now: float) -> None:
        count(now)
        if len(count.times) == 1:
            time.sleep(0.115)

    loop = PeriodicLoop(step, 0.02)
    loop.start()
    assert count.done.wait(WAIT)
    loop.stop()
    assert loop.statistics.skipped >= 5
    # no burst: the second call is on the grid, after the five deadlines that passed
    assert count.times[1] - count.times[0] >= 0.115


def test_a_call_that_ends_a_little_too_late_costs_no_cycle() -> None:
    """The next one begins at once, by less than half a period late, and the grid is kept."""
    count = Count(3)

    def step(now: float) -> None:
        count(now)
        if len(count.times) == 1:
            time.sleep(0.22)

    loop = PeriodicLoop(step, 0.2)
    loop.start()
    assert count.done.wait(WAIT)
    loop.stop()
    assert (loop.statistics.skipped, loop.statistics.late) == (0, 0)
    assert 0.22 <= count.times[1] - count.times[0] < 0.3
    assert count.times[2] - count.times[0] >= 0.4


def test_exception_ends_the_loop_and_comes_out_of_the_next_call() -> None:
    called = threading.Event()

    def step(now: float) -> None:
        called.set()
        raise ValueError("broken pipe")

    loop = PeriodicLoop(step, 0.001, name="test loop")
    loop.start()
    assert called.wait(WAIT)
    deadline = time.monotonic() + WAIT
    while loop.running and time.monotonic() < deadline:
        time.sleep(0.001)
    with pytest.raises(ValueError, match="broken pipe"):
        loop.check()
    with pytest.raises(ValueError, match="broken pipe"):
        loop.check()
    loop.stop()


def test_stop_raises_what_nobody_has_seen() -> None:
    called = threading.Event()

    def step(now: float) -> None:
        called.set()
        raise ValueError("unseen")

    loop = PeriodicLoop(step, 0.001)
    loop.start()
    assert called.wait(WAIT)
    with pytest.raises(ValueError, match="unseen"):
        loop.stop()


def test_stop_gives_up_on_a_step_that_hangs() -> None:
    entered, release = threading.Event(), threading.Event()

    def step(now: float) -> None:
        entered.set()
        release.wait(WAIT)

    loop = PeriodicLoop(step, 0.001, name="hanging loop")
    loop.start()
    assert entered.wait(WAIT)
    with pytest.raises(TimeoutError, match="hanging loop did not end within"):
        loop.stop(timeout=0.01)
    release.set()
    loop.stop()
    assert not loop.running


def test_long_period_does_not_hold_up_stop() -> None:
    count = Count(1)
    loop = PeriodicLoop(count, 3600.0)
    loop.start()
    assert count.done.wait(WAIT)
    loop.stop(timeout=WAIT)
    assert len(count.times) == 1


def test_stop_from_inside_and_restart() -> None:
    loop: PeriodicLoop
    ended = threading.Event()

    def step(now: float) -> None:
        loop.stop()
        ended.set()

    loop = PeriodicLoop(step, 0.001)
    for _ in range(2):
        ended.clear()
        loop.start()
        assert ended.wait(WAIT)
        loop.stop()
        assert loop.statistics.cycles == 1


def test_stop_before_start_does_nothing() -> None:
    PeriodicLoop(lambda now: None, 0.1).stop()


def test_start_twice_is_refused() -> None:
    loop = PeriodicLoop(lambda now: None, 0.01, name="busy")
    loop.start()
    with pytest.raises(RuntimeError, match="busy is already running"):
        loop.start()
    loop.stop()


@pytest.mark.parametrize("period", [0.0, -1.0, float("nan"), float("inf")])
def test_period_must_be_positive(period: float) -> None:
    with pytest.raises(ValueError, match="must be above 0"):
        PeriodicLoop(lambda now: None, period)


PRIORITIES = """
import os, threading, time
from pathlib import Path
from pam_ros.periodic import PeriodicLoop

done = threading.Event()
ending = threading.Event()
other = threading.Thread(target=ending.wait)
other.start()
loop = PeriodicLoop(lambda now: done.set(), 0.001, priority=3)
loop.start()
done.wait(10.0)
before = os.sched_getscheduler(0)
loop.share_priority()
tasks = [int(task.name) for task in Path("/proc/self/task").iterdir()]
print(loop.statistics.priority, before, sorted(os.sched_getparam(t).sched_priority for t in tasks))
loop.stop()
ending.set()
"""


def test_loop_and_its_neighbours_take_the_priorities_they_are_granted() -> None:
    # a process of its own: this one's threads are to stay ordinary
    run = subprocess.run(
        [sys.executable, "-c", PRIORITIES], capture_output=True, text=True, timeout=60, check=True
    )
    granted, before, priorities = run.stdout.split(" ", 2)
    assert int(before) == os.SCHED_OTHER
    assert granted in {"0", "3"}
    assert json.loads(priorities) == ([1, 1, 3] if granted == "3" else [0, 0, 0])


def test_a_system_that_grants_no_priority_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    assert take_priority(5) == 0
    assert take_priority(0) == 0


def test_a_loop_with_a_real_time_priority_keeps_its_memory_in_ram():
    program = (
        "from pam_ros.periodic import PeriodicLoop, take_priority\n"
        "from pam_ros.memory_lock import lock_memory\n"
        "locked = lambda: int(open('/proc/self/status').read().split('VmLck:')[1].split()[0])\n"
        "none = PeriodicLoop(lambda now: None, 0.01, 'none', 0); none.share_priority()\n"
        "print(locked())\n"
        "PeriodicLoop(lambda now: None, 0.01, 'some', 2).share_priority()\n"
        "print(locked(), lock_memory())\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    without, locked, permitted = run.stdout.split()
    if permitted == "False":
        pytest.skip("this system permits no locked memory (RLIMIT_MEMLOCK)")
    assert int(without) == 0
    assert int(locked) > 1000
