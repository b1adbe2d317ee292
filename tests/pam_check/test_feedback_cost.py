"""The table of what more feedback costs: more of it rejects more, and moves the valves more."""

from pathlib import Path

import numpy as np
import pytest

from pam_check.control.closed_loop import PERIOD, TOLD, RunTrace, true_rig
from pam_check.control.feedback_cost import VARIANTS, air_taken, measured
from pam_check.control.rough_control import RoughControl
from pam_model.rig import load_rig

pytest.importorskip("numba", reason="the truth plant is some 300 times slower without numba")


@pytest.fixture(scope="module")
def rough():
    return RoughControl(load_rig(Path(__file__).parents[2] / "config" / "elbow.yaml"), TOLD, 5)


def test_the_default_feedback_yields_much_less_than_one_set_without_a_lead(rough):
    named = {variant.name: variant for variant in VARIANTS}
    before, now = (measured(rough, named[name], 5) for name in ("one set, lead 0", "default"))
    assert now.sensitivity < 0.7 * before.sensitivity
    assert max(np.divide(now.compliance[:2], before.compliance[:2])) < 0.7
    assert now.strokes < 1.5 * before.strokes
    assert now.air < 1.1 * before.air
    assert now.error < 1.1 * before.error


def test_a_valve_that_is_open_to_a_low_pressure_takes_its_sonic_flow(rough):
    _, muscles = true_rig(rough.rig)
    trace = RunTrace(100)
    trace.pressures[:] = 0.0
    trace.commands[:, 0] = 0.5
    flow = 0.5 * muscles[0].sonic_conductance * rough.rig.supply_pressure * 1e3
    assert air_taken(trace, muscles, rough.rig) == pytest.approx(flow)
    assert trace.position.size * PERIOD > 0.0
