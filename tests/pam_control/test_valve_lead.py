"""The spool follows the wanted opening as the gain design and the look-ahead assume."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest

from pam_control.feedback.valve_lead import lead_command
from pam_control.rows.loop_rows import N_LAG, N_NUMBERS, N_STATE, V_LAGGED

STEP = 0.002  # s
LAG = 0.005  # s


def lead_of(lag):
    """The commands for a valve with a lag [s]."""
    numbers, state = [0.0] * N_NUMBERS, [0.0] * N_STATE
    numbers[N_LAG], state[V_LAGGED] = lag, math.nan
    return partial(lead_command, numbers, state)


@pytest.mark.parametrize("ratio", [0.2, 0.4, 0.7, 1.0])
def test_the_lag_that_is_left_of_the_valve_is_the_share_that_was_asked_for(ratio):
    """On a ramp, which shows the delay of commands and spool together."""
    lead, spool, fine = lead_of(LAG), 0.0, 200
    for k in range(200):
        command = lead(0.01 * k, ratio, STEP)
        for _ in range(fine):
            spool += STEP / fine / LAG * (command - spool)
    late = 199.0 - spool / 0.01  # steps; the command is held for one
    assert (late + 1.0) * STEP == pytest.approx(ratio * LAG + 0.5 * STEP, abs=0.5 * STEP + 1e-4)


@pytest.mark.parametrize("ratio", [0.4, 0.7])
def test_the_filter_is_the_one_of_its_formula(ratio):
    lead, slow = lead_of(LAG), 1e-5
    times = np.arange(0.0, 0.6, slow)
    wave = [lead(math.sin(30.0 * t), ratio, slow) for t in times.tolist()]
    given = np.array(wave[-20000:]) @ np.exp(-30j * times[-20000:])
    asked = np.sin(30.0 * times[-20000:]) @ np.exp(-30j * times[-20000:])
    formula = (30j * LAG + 1.0) / (30j * ratio * LAG + 1.0)
    assert given / asked == pytest.approx(formula, rel=0.02)


def test_a_valve_without_lag_gets_what_is_wanted():
    assert lead_of(0.0)(0.3, 0.7, STEP) == 0.3


def test_the_first_opening_is_no_step():
    assert lead_of(LAG)(0.3, 0.7, STEP) == pytest.approx(0.3)
