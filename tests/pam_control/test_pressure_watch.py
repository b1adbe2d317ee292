"""The gain of a pressure loop that chatters is lowered, and that of no other."""

from __future__ import annotations

import math
import random

from pam_control.feedback.pressure_watch import LEAST_FACTOR, PressureWatch

STEP = 0.002


def factor_after(error, seconds=1.0):
    watch = PressureWatch(6e5)
    for cycle in range(round(seconds / STEP)):
        watch.update(error(cycle * STEP), STEP)
    return watch.factor


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
    watch = PressureWatch(6e5)
    for cycle in range(500):
        watch.update(wave(40.0)(cycle * STEP), STEP)
    assert watch.factor < 1.0
    watch.reset()
    assert watch.factor == 1.0
