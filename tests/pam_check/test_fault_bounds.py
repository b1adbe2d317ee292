"""What a trial of the fault campaign may do at most, from the limits in the rig file."""

from __future__ import annotations

import dataclasses
import math

import pytest

from pam_check.fault_kinds.fault_kind import LOWERING
from pam_check.fault_kinds.kinds import KINDS
from pam_check.faults.campaign import in_a_fork
from pam_check.faults.rig_bounds import EMPTY, bounds_of
from pam_check.faults.trial import Trial, problem_of, run_trial, speed_bound
from pam_check.faults.unavoidable_speed import RECOGNISED, burst_speed, stuck_valve_speed
from pam_model.identify.size import size_joint, sized_rig
from pam_model.rig import load_rig
from support.fault_kinds import kind_called


def within(chain) -> Trial:
    """A trial of `vent_called` that is exactly at every bound."""
    bounds = bounds_of(chain.rig)
    kind = kind_called("vent_called")
    vented = kind.bound + LOWERING
    return Trial(
        kind.name,
        {},
        ["vented"],
        stopped_after=0.0,
        safe_after=vented,
        empty_after=vented + bounds.exhaust_time,
        peak_pressure=bounds.pressure,
        peak_force=bounds.force,
        peak_speed=bounds.speed,
        farthest=bounds.position[0],
        peak_error=bounds.tracking_error,
    )


@pytest.mark.parametrize(
    ("field", "change", "found"),
    [
        ("empty_after", 0.01, "20 kPa"),
        ("peak_pressure", 1e3, "kPa in a muscle"),
        ("peak_force", 1.0, "N in a muscle"),
        ("peak_speed", 0.1, "rad/s"),
        ("farthest", -0.01, "joint at -1.06 rad"),
        ("peak_error", 0.001, "angle off by"),
    ],
)
def test_a_trial_beyond_a_limit_of_the_rig_is_out_of_bounds(chain, field, change, found):
    kind = kind_called("vent_called")
    trial = within(chain)
    assert problem_of(chain, kind, trial) == ""
    setattr(trial, field, getattr(trial, field) + change)
    assert found in problem_of(chain, kind, trial)


def test_muscles_that_never_get_empty_are_out_of_bounds(chain):
    """Vented valves are not enough: a muscle that keeps its air still pulls."""
    kind = kind_called("vent_called")
    trial = within(chain)
    trial.empty_after = None
    assert "20 kPa" in problem_of(chain, kind, trial)
    keeps = dataclasses.replace(kind, keeps_air=True)
    assert problem_of(chain, keeps, trial) == ""


def test_the_largest_force_is_that_of_the_longest_muscle_at_the_largest_pressure(rig):
    """F = p (3 L^2 - b^2)/(4 pi n^2) at 605 kPa and L = 0.255 m."""
    length, thread, turns = 0.225 + 0.03, 0.2758, 1.856
    force = 605e3 * (3.0 * length**2 - thread**2) / (4.0 * math.pi * turns**2)
    assert bounds_of(rig).force == pytest.approx(force)


def test_the_time_to_empty_a_muscle_is_that_of_choked_flow_and_a_tail(rig):
    """While the flow is choked, the pressure falls with the time constant V/(R T C rho)."""
    muscle = rig.muscles[0]
    volume = rig.force_model(muscle.name).volume(0.195) + muscle.dead_volume
    time_constant = volume / (287.05 * 293.15 * 1.185 * muscle.valve.sonic_conductance)
    choked = time_constant * math.log(701325.0 / (101325.0 / 0.3))
    tail = time_constant * math.log(101325.0 / 0.3 / (101325.0 + EMPTY))
    assert choked + tail < bounds_of(rig).exhaust_time < choked + 2.0 * tail


def test_a_trial_measures_when_the_muscles_are_empty_and_how_the_joint_moves(chain):
    """Numbers of a vent in motion lie where the physics of the elbow put them."""
    trial = in_a_fork(lambda: run_trial(chain, kind_called("vent_called"), {}, 1))
    assert trial.problem == ""
    assert trial.stopped_after < 0.02
    assert 0.2 < trial.empty_after < LOWERING + bounds_of(chain.rig).exhaust_time
    assert 0.0 < trial.way < 2.0 * 0.5
    assert 100.0 < trial.peak_force < bounds_of(chain.rig).force
    assert 0.0 < trial.peak_speed < chain.rig.joints[0].max_velocity


def test_a_blocked_exhaust_is_seen_in_the_muscle_although_the_valves_are_vented(chain):
    """The board's report alone would call this rig safe."""

    def blocked() -> Trial:
        for address, board in chain.sim.boards.items():
            for place in range(len(board.valves)):
                chain.sim.faults.valves[address, place] = 0.0
        return run_trial(chain, kind_called("vent_called"), {}, 1)

    trial = in_a_fork(blocked)
    assert trial.safe_after < LOWERING
    assert "20 kPa" in trial.problem


def test_a_valve_stuck_open_drives_a_held_joint_beyond_its_limit_although_the_other_valve_shuts(
    rig,
):
    """7.6 rad/s from 0.8 rad: what the driver may do at most, at once, is not enough."""
    assert stuck_valve_speed(rig) == pytest.approx(7.6, abs=0.1)
    slow = rig
    for muscle in rig.muscles:
        valve = dataclasses.replace(muscle.valve, sonic_conductance=1e-9)
        slow = slow.with_muscle(dataclasses.replace(muscle, valve=valve))
    assert stuck_valve_speed(slow) < rig.joints[0].max_velocity


def test_a_large_hole_drives_a_strong_joint_beyond_its_limit_although_both_valves_vent(
    rig, tmp_path
):
    """The air of the other muscle is what drives it; a hole as small as a leak does not."""
    size = size_joint(30.0, 1.0, 3.0, 5e5, 0.3)
    path = tmp_path / "rig.yaml"
    path.write_text(sized_rig(size, 1.0, 5e5, 0.12).text(), encoding="utf-8")
    strong = load_rig(path)
    limit = strong.joints[0].max_velocity
    hole = 2.5 * strong.muscles[0].valve.sonic_conductance
    assert burst_speed(strong, hole, 0.35) > 1.2 * limit
    assert burst_speed(strong, 0.2 * hole, 0.35) < limit
    assert burst_speed(rig, 1e-8, 0.35) < 1.05 * rig.joints[0].max_velocity


def test_only_air_that_nothing_stops_may_exceed_the_speed_limit(chain):
    faster = {kind.name for kind in KINDS if kind.air_drives}
    stuck = {"valve_stuck_open", "valve_stuck_open_while_held"}
    bursts = {"muscle_burst", "muscle_burst_while_held", "measurement_gaps_with_burst"}
    assert faster == stuck | bursts
    bounds = bounds_of(chain.rig)
    kind = kind_called("valve_stuck_open_while_held")
    assert speed_bound(kind, {}, chain.rig, bounds) == RECOGNISED * stuck_valve_speed(chain.rig)
    trial = within(chain)
    trial.kind, trial.noticed = kind.name, ["pressure_implausible"]
    trial.safe_after = kind.bound
    trial.peak_speed = RECOGNISED * stuck_valve_speed(chain.rig)
    assert problem_of(chain, kind, trial) == ""
    trial.peak_speed += 0.01
    assert "rad/s" in problem_of(chain, kind, trial)
    # from nearer, the elbow does not become faster than it may anyway
    assert speed_bound(kind_called("valve_stuck_open"), {}, chain.rig, bounds) == bounds.speed
