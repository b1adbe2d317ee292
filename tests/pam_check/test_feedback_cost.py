"""The table of what more feedback costs: more of it rejects more, and moves the valves more."""

from pathlib import Path

import numpy as np
import pytest

from pam_check.control.closed_loop import PERIOD, TOLD, RunTrace, play, true_rig
from pam_check.control.feedback_cost import VARIANTS, Variant, air_taken, measured
from pam_check.control.hidden_rigs import NOTHING
from pam_check.control.rough_control import RoughControl
from pam_control.controller import Controller
from pam_model.rig import load_rig

pytest.importorskip("numba", reason="the truth plant is some 300 times slower without numba")


@pytest.fixture(scope="module")
def rough():
    return RoughControl(load_rig(Path(__file__).parents[2] / "config" / "elbow.yaml"), TOLD, 5)


def test_the_default_feedback_yields_much_less_than_one_set_without_a_lead(rough):
    named = {variant.name: variant for variant in VARIANTS}
    before, now = (measured(rough, named[name], 5) for name in ("one set, filtered", "default"))
    assert now.sensitivity < 0.6 * before.sensitivity
    assert max(np.divide(now.compliance[:2], before.compliance[:2])) < 0.55
    assert now.strokes < 1.8 * before.strokes
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


def test_an_observed_motion_rejects_more_for_the_same_strokes(rough):
    """Against the filter of 5 ms, which moves the valves twice as much."""
    named = {variant.name: variant for variant in VARIANTS}
    filtered, now = (measured(rough, named[n], 5) for n in ("filter 5 ms, lead 0.5", "default"))
    assert max(np.divide(now.compliance, filtered.compliance)) < 0.97
    assert now.strokes < 0.6 * filtered.strokes


def test_the_longest_delay_is_where_the_loop_begins_to_swing(rough):
    """Seen on the independent plant: a delay that is longer makes the joint swing at rest."""
    found = measured(rough, Variant("default"), 5)
    assert 0.015 < found.longest_delay < 0.03
    joint, muscles = rough.hidden(NOTHING)
    at_rest = []
    for late in (found.longest_delay - 0.006, found.longest_delay + 0.006):
        slow = tuple(muscle._replace(command_delay=late) for muscle in muscles)
        settings = TOLD.replace(adaptation=False)
        controller = Controller(rough.rig, settings, rough.designs)
        played, _ = play(controller, joint, slow, rough.motions["arm"], 5)
        at_rest.append(bool(played.swings or played.softened or played.stopped))
    assert at_rest == [False, True]
