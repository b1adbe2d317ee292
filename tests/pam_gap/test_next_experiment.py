"""The menu, the choice from it, its files, and the hidden rig that carries it out."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from pam_check.blind.experiments import ambiguity
from pam_gap.experiments.excitations import Excitation, Menu, smooth_path
from pam_gap.experiments.files import COMMANDS, DETAILS, TRAJECTORY, read_experiment
from pam_gap.experiments.loop import ExperimentLoop, loop_gain
from pam_gap.experiments.next_experiment import (
    ExperimentPlanner,
    difference_after_refit,
    propose,
    simulate_excitation,
)
from pam_gap.inference.candidates import candidates_for
from pam_gap.inference.hypothesis import Hypothesis, HypothesisFitter
from pam_gap.prediction.problem import PredictionProblem, as_mounted
from pam_gap.recordings.recording import LOCKED, TURNED_OVER, Recording
from pam_model.errors import PamError
from pam_model.plant.parameters import INDEX
from pam_model.rig import load_rig

# Without nuisances a fit has a few lanes instead of twenty.
ELBOW = replace(
    load_rig(Path(__file__).parents[2] / "config" / "elbow.yaml"), parameter_tolerance=0.0
)
SAMPLE_TIME = 0.005
MENU = {e.name: e for e in Menu(ELBOW, 0, SAMPLE_TIME).entries()}


def seed_recording() -> Recording:
    """A recording that gives a problem its channels and noise: a chirp of the elbow as written."""
    count = MENU["chirp"].time.size
    names = [
        *(f"pressure_states.{m}" for m in ELBOW.muscle_names),
        *(f"valve_commands.{m}" for m in ELBOW.muscle_names),
        "joint_states.elbow.position",
    ]
    noise = np.random.default_rng(0).standard_normal((5, count))
    scale = (150.0, 150.0, 1e-3, 1e-3, 2e-4)
    values = {n: s * e for n, s, e in zip(names, scale, noise, strict=True)}
    valid = {n: np.ones(count, dtype=np.bool_) for n in names}
    return Recording(Path("noise"), SAMPLE_TIME, MENU["chirp"].time, values, valid, ())


@pytest.fixture(scope="module")
def fitter() -> HypothesisFitter:
    template = PredictionProblem(ELBOW, 0, [seed_recording()])
    payload = template.base.replaced({"payload.mass": 0.5, "payload.distance": 0.3}).values
    recorded = simulate_excitation(template, payload, MENU["holds"])
    problem = PredictionProblem(ELBOW, 0, [recorded])
    return HypothesisFitter(problem, np.ones(5))


def fitted(fitter: HypothesisFitter, *effects: str) -> list[Hypothesis]:
    nominal = fitter.fit_nominal().result.values
    found = []
    for effect in effects:
        candidate = next(c for c in candidates_for(ELBOW, ELBOW.joints[0]) if c.label == effect)
        start = np.concatenate([nominal, candidate.starts[0]])
        found.append(fitter.fit((candidate,), start, max_iterations=4))
    return found


def test_every_excitation_is_safe_and_starts_at_rest() -> None:
    assert {e.mounting for e in MENU.values()} == {"", TURNED_OVER, LOCKED}
    low, high = ELBOW.joints[0].position_limits
    for e in MENU.values():
        pressures = np.stack([e.level + e.difference, e.level - e.difference])
        assert pressures.min() >= 0.0, e.name
        assert pressures.max() <= 0.8 * 6e5, e.name
        assert low < e.position.min() <= e.position.max() < high, e.name
        settled = e.time < 1.5
        assert np.ptp(e.position[settled]) == 0.0, e.name
        assert e.position[0] == 0.0, e.name


def test_moves_are_smooth() -> None:
    time = np.arange(0.0, 4.0, 0.001)
    path = smooth_path(time, [(0.0, 0.0), (1.0, 0.5), (2.5, -0.5)], 0.5)
    assert path[0] == 0.0
    assert path[2000] == pytest.approx(0.5)
    assert path[-1] == pytest.approx(-0.5)
    assert np.abs(np.diff(path, 2)).max() < 5.78 * 1.0 / 0.5**2 * 1e-6 * 1.01


def test_static_pressures_hold_the_arm_in_either_mounting(fitter: HypothesisFitter) -> None:
    """The plant under an excitation comes to the angles it refers to, gravity either way."""
    for name in ("holds", "turned_over"):
        e = MENU[name]
        recorded = simulate_excitation(fitter.problem, fitter.problem.base.values, e)
        position = recorded.values["joint_states.elbow.position"]
        for end in (4.9, 7.9):
            k = round(end / SAMPLE_TIME)
            assert position[k] == pytest.approx(e.position[k], abs=0.05), (name, end)
        assert recorded.mounting == e.mounting


def test_locked_joint_does_not_move(fitter: HypothesisFitter) -> None:
    recorded = simulate_excitation(fitter.problem, fitter.problem.base.values, MENU["locked_joint"])
    assert np.abs(recorded.values["joint_states.elbow.position"]).max() < 2e-3
    assert np.ptp(recorded.values["pressure_states.elbow_flexor"]) > 1e5


def test_a_mounted_recording_is_predicted_as_mounted(fitter: HypothesisFitter) -> None:
    base = fitter.problem.base.values
    for name in ("turned_over", "locked_joint"):
        recorded = simulate_excitation(fitter.problem, base, MENU[name])
        problem = PredictionProblem(ELBOW, 0, [recorded])
        error = problem.errors(base[None])[0][problem.counted][:, :3]
        seen = error[np.isfinite(error)]  # a locked joint's angle has no vote
        assert seen.size >= 2 * len(error)
        assert np.sqrt(np.mean(seen**2)) < 3.0, name
    turned = as_mounted(base[None], TURNED_OVER)[0, INDEX["joint.gravity_angle"]]
    assert turned == pytest.approx(base[INDEX["joint.gravity_angle"]] + math.pi)


def test_turning_over_parts_gravity_from_stiffness(fitter: HypothesisFitter) -> None:
    """A payload pulls the other way then, an elastic bladder does not."""
    planner = ExperimentPlanner(fitter, fitted(fitter, "payload", "bladder_elasticity"))
    menu = [MENU[n] for n in ("locked_joint", "leak_down", "turned_over", "co_contraction_sweep")]
    ranking = planner.choose(menu)
    expected = {s.excitation.name: s.smallest for s in ranking}
    assert ranking[0].excitation.name == "turned_over"
    assert ranking[0].is_decisive
    # Nothing moves the payload of a locked joint, and no bladder stretches there.
    assert expected["locked_joint"] < 0.1


def test_what_a_refit_takes_away_does_not_count(fitter: HypothesisFitter) -> None:
    """Two fits of one effect at other values are one explanation: nothing parts them."""
    payload = fitted(fitter, "payload")[0]
    free, _, _ = fitter.problem_parts(payload.members)
    at = next(i for i, p in enumerate(free) if p.name == "mass")
    moved = payload.result.values.copy()
    moved[at] *= 1.02
    other = fitter.fit(payload.members, moved, max_iterations=0)
    other.result.columns, other.result.reused = payload.result.columns, payload.result.reused
    alone = ExperimentPlanner(fitter, [payload, other]).separation(MENU["turned_over"])
    rival = ExperimentPlanner(fitter, [payload, *fitted(fitter, "bladder_elasticity")])
    assert alone.smallest < 0.2 * rival.separation(MENU["turned_over"]).smallest


def test_one_survivor_needs_no_experiment(fitter: HypothesisFitter) -> None:
    assert propose(fitter, fitted(fitter, "payload")) is None


def test_files_say_what_is_played(fitter: HypothesisFitter, tmp_path: Path) -> None:
    proposal = propose(fitter, fitted(fitter, "payload", "bladder_elasticity"))
    assert proposal is not None
    proposal.write(tmp_path)
    details = json.loads((tmp_path / DETAILS).read_text())
    assert [entry["name"] for entry in details["menu"]] == [
        s.excitation.name for s in proposal.ranking
    ]
    message = yaml.safe_load((tmp_path / TRAJECTORY).read_text())
    assert message["joint_names"] == ["elbow"]
    times = [
        p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"]
        for p in message["points"]
    ]
    assert all(b > a for a, b in pairwise(times))
    assert message["points"][-1]["velocities"] == [0.0]
    again, wanted = read_experiment(tmp_path), proposal.best.excitation
    for field in ("position", "level", "difference", "time"):
        np.testing.assert_allclose(
            getattr(again, field), getattr(wanted, field), rtol=1e-4, atol=1e-5 * 6e5
            if field in ("level", "difference") else 1e-5,
        )  # fmt: skip
    assert (again.mounting, again.open_from) == (wanted.mounting, wanted.open_from)


def test_broken_files_are_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(PamError, match=DETAILS):
        read_experiment(tmp_path)
    (tmp_path / DETAILS).write_text("{}")
    (tmp_path / COMMANDS).write_text("time,position\n0,0\n")
    with pytest.raises(PamError, match="not a proposed experiment"):
        read_experiment(tmp_path)


def test_loop_drives_towards_the_reference_and_hands_over() -> None:
    e = MENU["vented_swing"]
    loop = ExperimentLoop(ELBOW, 0, e)
    first, second = loop.start_pressures
    low = loop.commands(-1.0, 0.0, (first - 5e4, second + 5e4))
    assert low[0] > 0.0 > low[1]
    assert low[0] == pytest.approx(loop_gain(ELBOW, 0) * 5e4, rel=1e-6)
    assert loop.commands(e.open_from + 0.1, 0.0, (first, second)) == (-1.0, -1.0)


def hidden_rig() -> Any:
    pytest.importorskip("numba", reason="the truth plant is some 300 times slower without numba")
    from pam_check.blind.truth_plant import Sensors, TruthJoint, TruthMuscle

    joint = TruthJoint(0.03, 0.05, 0.25, 4.9, 0.0, -1.0, 1.0, 293.15, 101325.0, 701325.0)
    muscle = TruthMuscle(0.2758, 1.856, 0.24996, 0.225, 2e-5, 4e-9, 0.3, 0.005)
    return joint, (muscle, muscle), Sensors()


@pytest.mark.parametrize("name", ["turned_over", "locked_joint", "vented_swing", "leak_down"])
def test_hidden_rig_carries_it_out(name: str) -> None:
    from pam_check.blind.carry_out import carry_out

    e: Excitation = MENU[name]
    joint, muscles, sensors = hidden_rig()
    made = carry_out(joint, muscles, sensors, e, seed=4)
    assert made.position.size == e.time.size
    if name == "locked_joint":
        assert np.abs(made.true_position).max() < 1e-3
    elif name == "turned_over":
        k = round(4.9 / SAMPLE_TIME)
        assert made.true_position[k] == pytest.approx(e.position[k], abs=0.05)
    else:
        opened = e.time >= e.open_from
        assert (made.commands[opened] == np.array(e.open_commands)).all()
        plain = carry_out(joint, muscles, sensors, MENU["leak_down"], seed=4)
        if name == "vented_swing":
            assert made.true_pressures[-1].max() < 5e3
        else:
            # Shut chambers of a tight rig: same gas, so pressures hold once the joint rests.
            late = plain.true_pressures[e.time > 10.0]
            assert np.ptp(late, axis=0).max() < 500.0


def test_ambiguity_counts_the_largest_set() -> None:
    assert ambiguity({"indistinguishable": []}) == 1
    assert ambiguity({"indistinguishable": [["a", "b"], ["c", "d", "e"]]}) == 3


@pytest.mark.parametrize("unit", [1e-7, 1.0, 1e7])
def test_a_refit_does_not_depend_on_the_units_of_its_parameters(unit: float) -> None:
    """With another unit, a parameter's slopes must not drop below what counts as undetermined."""
    random = np.random.default_rng(3)
    jacobian = random.standard_normal((200, 2, 3))
    apart = jacobian @ np.array([0.4, -1.2, 0.7]) + 1e-3 * random.standard_normal((200, 2))
    rows, weights = np.ones(200, dtype=bool), np.ones(2)
    units = np.array([unit, 1.0, 1.0])
    left = difference_after_refit(apart, jacobian * units, rows, weights, np.zeros((3, 3)), 2.0)
    flat = jacobian.reshape(-1, 3)
    best = np.linalg.lstsq(flat, apart.ravel(), rcond=None)[0]
    assert left.ravel() == pytest.approx(apart.ravel() - flat @ best, abs=1e-9)
