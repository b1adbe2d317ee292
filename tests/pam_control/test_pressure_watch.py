"""The gain of a pressure loop that chatters is lowered, and that of no other."""

from __future__ import annotations

import math
import random

from pam_control.feedback.pressure_watch import (
    LEAST_FACTOR,
    LEAST_SHARE,
    begin_watch,
    watch_pressure,
)
from pam_control.rows.loop_rows import N_NUMBERS, N_STATE, N_THRESHOLD, V_FACTOR

STEP = 0.002


def watched(error, seconds=1.0):
    """State of the loop after a while."""
    numbers, state = [0.0] * N_NUMBERS, [0.0] * N_STATE
    numbers[N_THRESHOLD] = LEAST_SHARE * 6e5
    begin_watch(state)
    for cycle in range(round(seconds / STEP)):
        watch_pressure(numbers, state, error(cycle * STEP), STEP)
    return state


def factor_after(error, seconds=1.0):
    return watched(error, seconds)[V_FACTOR]


def wave(frequency, amplitude=2e4):
    return lambda t: amplitude * math.sin(2.0 * math.pi * frequency * t)


def test_chatter_lowers_the_gain_and_never_below_its_floor():
    for frequency in (12.0, 40.0, 80.0):
        assert factor_after(wave(frequency), 0.4) < 1.0
        assert factor_after(wave(frequency), 5.0) == LEAST_FACTOR


def test_a_motion_of_the_joint_is_no_chatter():
    assert factor_after(wave(3.0, 1e5), 5.0) == 1.0


def test_an_oscillation_that_fades_is_no_chatter():
    assert factor_after(lambda t: wave(30.0, 1e5)(t) * math.exp(-30.0 * t)) == 1.0


def test_noise_is_no_chatter():
    noise = random.Random(1)
    assert factor_after(lambda _: noise.gauss(0.0, 500.0), 5.0) == 1.0


def test_the_gain_returns_when_the_joint_is_taken_over_anew():
    state = watched(wave(40.0))
    assert state[V_FACTOR] < 1.0
    begin_watch(state)
    assert state[V_FACTOR] == 1.0
