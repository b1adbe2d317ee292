"""A loop that follows the phase of its inputs, on a clock of the test."""

from __future__ import annotations

import random

import pytest

from pam_ros.periodic import PeriodicLoop
from pam_ros.phase_follower import WAIT, PhaseFollower

PERIOD = 0.002


def ages(first_phase: float, cycles: int, drift: float = 0.0, jitter: float = 0.0) -> list[float]:
    """The ages of the newest input at the begin of each cycle [s].

    The inputs come once in a period, whose length differs from that of the loop by the share
    `drift`, and each of them up to `jitter` late.
    """
    loop = PeriodicLoop(lambda now: None, PERIOD)
    follower, draw = PhaseFollower(loop), random.Random(0)
    every = PERIOD * (1.0 + drift)
    now, found = 10.0 * PERIOD + first_phase, []
    late = [draw.uniform(0.0, jitter) for _ in range(cycles * 5 + 100)]
    for _ in range(cycles):
        newest = int(now / every)
        while newest * every + late[newest] > now:
            newest -= 1
        found.append(now - newest * every - late[newest])
        follower.follow(found[-1])
        now += PERIOD + loop._shift
        loop._shift = 0.0
    return found


@pytest.mark.parametrize("phase", [0.0, 0.1, 0.3, 0.6, 0.9])
@pytest.mark.parametrize("drift", [0.0, 1e-4, -1e-4])
def test_a_cycle_begins_shortly_after_its_input_whatever_the_first_phase_is(
    phase: float, drift: float
) -> None:
    found = ages(phase * PERIOD, 1500, drift)
    assert found[-1] == pytest.approx(WAIT, abs=2e-5)


@pytest.mark.parametrize("ratio", [0.25, 0.5, 2.0, 5.0])
def test_boards_with_a_multiple_or_a_part_of_the_rate_are_followed(ratio: float) -> None:
    found = ages(0.7 * PERIOD, 6000, ratio - 1.0)
    every = min(ratio, 1.0) * PERIOD
    assert found[-1] % every == pytest.approx(WAIT % every, abs=4e-5)


@pytest.mark.parametrize("ratio", [0.37, 0.83, 1.37, 2.6])
def test_boards_with_any_other_rate_do_not_change_that_of_the_loop(ratio: float) -> None:
    """The phases then differ from cycle to cycle, and the shifts cancel out."""
    loop = PeriodicLoop(lambda now: None, PERIOD)
    follower, now, shifts = PhaseFollower(loop), 1.0, []
    for _ in range(5000):
        follower.follow(now % (ratio * PERIOD))
        shifts.append(loop._shift)
        now += PERIOD + loop._shift
        loop._shift = 0.0
    assert abs(sum(shifts)) / len(shifts) < 2e-3 * PERIOD


def test_jitter_of_the_inputs_does_not_make_the_loop_jump_between_two_of_them() -> None:
    found = ages(0.5 * PERIOD, 3000, jitter=0.0003)
    assert all(0.0 <= age < WAIT + 0.0004 for age in found[1000:])


def test_the_time_between_two_cycles_changes_by_a_fiftieth_at_most() -> None:
    loop = PeriodicLoop(lambda now: None, PERIOD)
    for age in (0.0, 0.0003, 0.001, 0.0019, 0.0035):
        loop._shift = 0.0
        PhaseFollower(loop).follow(age)
        assert abs(loop._shift) <= 0.02 * PERIOD + 1e-12


@pytest.mark.parametrize("age", [-0.001, 0.1, float("nan"), float("inf")])
def test_an_input_that_is_missing_or_old_shifts_nothing(age: float) -> None:
    loop = PeriodicLoop(lambda now: None, PERIOD)
    PhaseFollower(loop).follow(age)
    assert loop._shift == 0.0


def test_a_shift_moves_all_later_deadlines_of_a_running_loop() -> None:
    begun: list[float] = []

    def step(now: float) -> None:
        begun.append(now)
        if len(begun) == 2:
            loop.shift(0.15)
        if len(begun) == 4:
            raise StopIteration

    loop = PeriodicLoop(step, 0.02)
    loop.start()
    with pytest.raises(StopIteration):
        while True:
            loop.check()
    assert begun[2] - begun[1] >= 0.17 - 0.02  # the call before may have begun late
    assert begun[3] - begun[0] >= 3 * 0.02 + 0.15 - 0.005
