"""A calibration finds the numbers of a rig file that is off, and says what it cannot find."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from pam_gap.__main__ import main
from pam_gap.calibration.calibration import (
    DETERMINED,
    KEPT,
    NARROWED,
    CalibratedNumber,
    Calibration,
    calibrate_joint,
    one_valve_reversed,
    rounded,
)
from pam_gap.calibration.calibration_rules import DEFAULT
from pam_gap.calibration.free_numbers import (
    BODY,
    GAS,
    STATICS,
    Said,
    free_numbers,
    ordinary_numbers,
)
from pam_gap.calibration.intervals import Knowledge
from pam_gap.calibration.known_rig import as_known
from pam_gap.calibration.last_steps import FittedPoint, last_steps
from pam_gap.calibration.staged_fit import motion_records, without_false_stops
from pam_gap.inference.hypothesis import HypothesisFitter
from pam_gap.prediction.channel_order import POSITION
from pam_gap.prediction.directions import valve_phase
from pam_gap.prediction.fit import Array, FreeParameter, Scaling, mean_squares
from pam_gap.prediction.gap_figures import noise_level
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import Recording
from pam_model.effects import EFFECTS
from pam_model.identify.joint_regression import body_regression, ridge, valve_regression
from pam_model.plant.parameters import NAMES, bounds_of, neutral_values
from pam_model.rig import Rig, load_rig, save_rig
from pam_model.rig.partial import PartialRig, load_partial_rig
from support.page_plots import plots_and_missing_places

from .conftest import Maker

SAID = Said(1.0 / 3.0, 0.05)
OTHERS = 1.3
"""Pressures that do not follow the commands, over those that do."""
OFF = {
    "inertia": 1.25,
    "viscous_friction": 0.75,
    "gravity_torque": 0.8,
    "pulley_radius": 1.03,
    "sonic_conductance": 0.8,
    "time_constant": 1.3,
    "dead_volume": 1.2,
    "neutral_length": 0.99,
    "turns": 1.02,
}

ORDINARY = {
    "hysteresis.amplitude": 0.01,
    "creep.ratio": 0.02,
    "creep.time_constant": 3.0,
    "coulomb_friction.torque": 0.03,
    "leakage.conductance": 5e-12,
}
"""What a good rig has a little of."""


def rough(rig: Rig) -> Rig:
    """The rig file of an owner: numbers off by a fifth and more, lengths by some per cent."""

    def changed(part: object) -> Mapping[str, float]:
        return {k: getattr(part, k) * f for k, f in OFF.items() if hasattr(part, k)}

    for joint in rig.joints:
        rig = rig.with_joint(replace(joint, **changed(joint)))
    for muscle in rig.muscles:
        valve = replace(muscle.valve, **changed(muscle.valve))
        rig = rig.with_muscle(replace(muscle, valve=valve, **changed(muscle)))
    return rig


@pytest.fixture(scope="module")
def log(record: Maker) -> Recording:
    return record(ORDINARY, duration=16.0)


@pytest.fixture(scope="module")
def found(rig: Rig, log: Recording) -> Calibration:
    partial = PartialRig(rough(rig))
    return calibrate_joint(partial, 0, [log], [log], said=SAID)


def _torque_per_pressure(rig: Rig) -> float:
    joint = rig.joints[0]
    pulls = [
        float(rig.force_model(name).force(1e5, rig.muscle(name).neutral_length))
        for name in joint.muscles
    ]
    return joint.pulley_radius * sum(pulls)


@pytest.mark.parametrize(
    ("key", "within"),
    [("inertia", 0.04), ("viscous_friction", 0.1), ("gravity_torque", 0.06)],
)
def test_ratios_to_the_torque_per_pressure_are_found(
    rig: Rig, found: Calibration, key: str, within: float
) -> None:
    assert found.rig is not None
    scale = _torque_per_pressure(found.rig) / _torque_per_pressure(rig)
    value = getattr(found.rig.joints[0], key) / scale
    assert value == pytest.approx(getattr(rig.joints[0], key), rel=within)


def test_intervals_hold_and_what_is_kept_is_as_written(rig: Rig, found: Calibration) -> None:
    true, written = (_flat(one) for one in (rig, rough(rig)))
    assert any(one.status == DETERMINED for one in found.numbers)
    stated = [one for one in found.numbers if one.key in true]
    holds = [one.low <= true[one.key] <= one.high for one in stated if one.status != KEPT]
    assert np.mean(holds) >= 0.8
    for one in stated:
        if one.status == KEPT:
            assert one.value == pytest.approx(written[one.key])


PRIOR = 0.15
"""Deviation of the logarithm of each of the numbers below, before the log."""


def _known() -> Knowledge:
    """A log that knows the product of two numbers to 0.1 %, and nothing of a third."""
    free = tuple(FreeParameter(n, 0.1, 10.0, 0.1, PRIOR / 7.0, 1.0, True) for n in ("a", "b", "c"))
    product = np.array([1.0, 1.0, 0.0])
    hessian = 49.0 * (0.1 / 1e-3) ** 2 * np.outer(product, product)
    score = 49.0 * hessian
    values = np.array([1.2, 0.9, 1.0])
    return Knowledge(free, values, hessian, score, Scaling(free).weight ** 2, 49.0)


def test_combinations_are_fixed_and_one_number_is_kept() -> None:
    known = _known()
    assert known.before == pytest.approx(np.full(3, PRIOR))
    kept = known.kept(dict.fromkeys(range(3), 0.7))
    assert set(kept) >= {2} and len(kept) == 2  # the other of a and b follows from the product
    values = known.given(kept)
    assert values[kept] == pytest.approx(np.ones(2))
    assert values[0] * values[1] == pytest.approx(1.2 * 0.9, rel=1e-3)


def test_a_number_that_follows_from_a_kept_one_has_its_error() -> None:
    """Intervals were those of a fit in which both are free, and too narrow by a factor of 1.4."""
    known = _known()
    both = np.sqrt(np.diag(known.covariance()))
    assert both[:2] == pytest.approx(np.full(2, PRIOR / np.sqrt(2.0)), rel=1e-3)
    covariance = known.covariance([1])
    assert np.sqrt(np.diag(covariance)) == pytest.approx(np.full(3, PRIOR), rel=1e-3)
    product = np.array([1.0, 1.0, 0.0])
    assert np.sqrt(product @ covariance @ product) == pytest.approx(1e-3, rel=0.05)


GROWTH = {
    "pulley_radius": 1, "thread_length": 1, "neutral_length": 1, "rest_length": 1,
    "inertia": 3, "viscous_friction": 3, "gravity_torque": 3, "dead_volume": 3,
    "sonic_conductance": 3,
}  # fmt: skip
"""Power with which numbers grow with the lengths of a robot whose log stays as it is."""


def _all_larger(vector: Array, factor: float) -> Array:
    powers = [GROWTH.get(name.rpartition(".")[2], 0) for name in NAMES]
    larger: Array = vector * factor ** np.array(powers, dtype=float)
    return larger


def test_the_size_of_a_robot_is_not_in_its_log(rig: Rig, log: Recording) -> None:
    """A fixed least dead volume gave a small robot volumes and forces that were 20 % off."""
    problem = PredictionProblem(rig, 0, [log])
    large = problem.base.values
    some, other = problem.errors(np.array([large, _all_larger(large, 0.1)]))
    assert other[problem.counted][:, :3] == pytest.approx(some[problem.counted][:, :3], abs=1e-4)


def test_the_last_steps_find_the_size_that_the_rig_file_says(rig: Rig, record: Maker) -> None:
    """A log without forces says nothing of it, and damped steps ended long before it."""
    problem = PredictionProblem(rig, 0, [record({}, duration=8.0)])
    start = dict(zip(NAMES, problem.base.values.tolist(), strict=True))
    numbers = [
        one
        for one in free_numbers(
            PartialRig(rig), rig.joints[0], start, SAID, DEFAULT, has_commands=True
        )
        if one.name.rpartition(".")[2] in GROWTH
    ]
    floor = noise_level(problem, problem.base.values)
    fitter = HypothesisFitter(problem, floor, [one.nuisance(DEFAULT) for one in numbers])
    growth = np.array([GROWTH[one.name.rpartition(".")[2]] for one in numbers])
    true = np.array([start[one.name] for one in numbers])
    begin = FittedPoint(true * 1.03**growth, np.zeros(0), np.zeros(0))
    point, jacobian = last_steps(fitter, begin, (), DEFAULT)
    free = [one.free for one in fitter.nuisances]
    weight = Scaling(free).weight / Scaling(free).size
    # where what was written decides, its pull along the combination is 0
    pull = weight**2 * np.log(point.values / true)
    written = (weight**2 * growth**2).sum()
    assert abs(growth @ pull) / written < 0.002
    slope = jacobian @ (growth / Scaling(free).size)
    weights = 1.0 / np.maximum(mean_squares(point.errors, problem.counted), floor)
    seen = np.nansum(weights * np.square(slope[problem.counted]))
    assert seen < 0.05 * written


def test_a_stop_that_the_log_passes_is_not_simulated(rig: Rig, record: Maker) -> None:
    """The zero of an encoder was 5 mrad off, and a gravity torque 27 %, 26 deviations."""
    joint, log = rig.joints[0], record({}, duration=8.0)
    angles = log.values[f"joint_states.{joint.name}.position"]
    low, high = float(np.min(angles)), float(np.max(angles))
    narrow = rig.with_joint(replace(joint, position_limits=(0.98 * low, 0.98 * high)))
    wide = rig.with_joint(replace(joint, position_limits=(low - 0.1, high + 0.1)))
    some, other = (PredictionProblem(one, 0, [log]) for one in (narrow, wide))
    assert without_false_stops(other, DEFAULT) is other
    stopped = some.errors(some.base.values[None])[0, some.counted, POSITION]
    freed = without_false_stops(some, DEFAULT)
    right, free = (
        one.errors(one.base.values[None])[0, one.counted, POSITION] for one in (other, freed)
    )
    assert free == pytest.approx(right, abs=1e-6)
    assert np.max(np.abs(stopped - right)) > 10.0


def test_the_prediction_gets_better(found: Calibration) -> None:
    angles = [
        f for f in found.withheld if f.channel.endswith("position") and f.horizon == "free run"
    ]
    assert angles
    assert all(f.after < 0.3 * f.before for f in angles)


def test_a_missing_inertia_is_found(rig: Rig, log: Recording) -> None:
    problem = PredictionProblem(rough(rig), 0, [log])
    lengths = {"joint.pulley_radius": 0.03, "agonist.neutral_length": 0.03}
    regression = body_regression(problem.rig, 0, motion_records(problem), lengths)
    scale = _torque_per_pressure(problem.rig) / _torque_per_pressure(rig)
    inertia = regression["joint.inertia"] / scale
    assert inertia == pytest.approx(rig.joints[0].inertia, rel=0.25)


def test_the_conductance_begins_in_the_right_valley(rig: Rig, log: Recording) -> None:
    problem = PredictionProblem(rough(rig), 0, [log])
    conductance = valve_regression(problem.rig, 0, 0, motion_records(problem))
    true = rig.muscles[0].valve.sonic_conductance
    assert conductance["valve.sonic_conductance"] == pytest.approx(true, rel=0.15)


def test_a_lag_of_the_valve_counts_as_an_effect_and_as_a_number(rig: Rig, log: Recording) -> None:
    """The gas balance read the written lag alone, and began with half of the conductance."""
    muscle, lag = rig.muscles[0], 0.03
    added = replace(muscle, effects={"valve_lag": {"extra_time_constant": lag}})
    slower = replace(muscle.valve, time_constant=muscle.valve.time_constant + lag)
    records = motion_records(PredictionProblem(rig, 0, [log]))
    found = [
        valve_regression(rig.with_muscle(changed), 0, 0, records)
        for changed in (added, replace(muscle, valve=slower))
    ]
    assert found[0] == pytest.approx(found[1], rel=1e-9)


def test_a_calibrated_rig_file_says_how_well_its_numbers_are_known(rig: Rig) -> None:
    """Also if the tolerance in the rough file, 2 % by default, is less than what was said."""

    def number(key: str, stage: str, reach: float, status: str = NARROWED) -> CalibratedNumber:
        return CalibratedNumber(key, "-", stage, 1.0, 2.0, 2.0 - reach, 2.0 + reach, status)

    numbers = [
        number("elbow.inertia", BODY, 0.2),
        number("a.valve.critical_ratio", GAS, 0.9, KEPT),
        number("a.turns", STATICS, 0.02),
    ]
    found = as_known(replace(rig, parameter_tolerance=0.02), numbers, Said(0.3, 0.05))
    assert found.parameter_tolerance == pytest.approx(0.1)
    assert found.length_tolerance == pytest.approx(0.01)
    wide = as_known(rig, [number("elbow.inertia", BODY, 1.9)], Said(0.3, 0.05))
    assert wide.parameter_tolerance == pytest.approx(0.3)


def test_a_number_has_no_more_digits_than_its_interval_supports() -> None:
    assert rounded(5.1220951314342984e-09, 4.77e-09, 5.5e-09) == 5.1221e-09
    assert rounded(-2.377e-06, -0.0167, 0.0166) == 0.0
    assert rounded(745812.34567, 722000.0, 746000.0) == 745810.0
    assert rounded(0.3, 0.3, 0.3) == 0.3
    assert rounded(4.0321e-08, 1e-08, 6e-04) == 4.032e-08  # no volume becomes 0


@pytest.mark.filterwarnings("error")
def test_a_sum_without_weights_ties_nothing() -> None:
    """Muscles whose torque does not depend on their lengths leave the tie empty."""
    generator = np.random.default_rng(3)
    columns = generator.standard_normal((200, 2))
    target = columns @ [3e4, -2e4]
    known, _ = ridge(columns, target, [np.inf, np.inf], np.zeros(2))
    assert known == pytest.approx([3e4, -2e4])


@pytest.mark.parametrize("turned", ["sign", "hoses", "valve"])
def test_an_exchange_is_named_and_gives_no_rig_file(rig: Rig, log: Recording, turned: str) -> None:
    values = dict(log.values)
    first, second = rig.joints[0].muscles
    if turned == "sign":
        values["joint_states.elbow.position"] = -values["joint_states.elbow.position"]
    elif turned == "valve":
        values[f"valve_commands.{second}"] = -values[f"valve_commands.{second}"]
    else:
        for kind in ("valve_commands.", "pressure_states."):
            pair = (kind + first, kind + second)
            values[pair[0]], values[pair[1]] = values[pair[1]], values[pair[0]]
    partial = PartialRig(rough(rig))
    answer = calibrate_joint(partial, 0, [replace(log, values=values)], said=SAID)
    assert answer.rig is None
    assert answer.wiring and answer.refused == answer.wiring
    assert "exchanged" in answer.wiring[0] or "reversed" in answer.wiring[0]


def test_one_reversed_valve_is_named_although_others_move_the_joint(
    rig: Rig, log: Recording
) -> None:
    """Half of the pressure rate was the motion's, and the robot was calibrated with the sign."""
    random, values = np.random.default_rng(1), dict(log.values)
    for name in rig.joints[0].muscles:
        key = f"pressure_states.{name}"
        push = np.cumsum(random.normal(size=log.time.size))
        values[key] = values[key] + OTHERS * np.ptp(values[key]) / np.ptp(push) * push
    second = f"valve_commands.{rig.joints[0].muscles[1]}"
    assert (
        one_valve_reversed(PredictionProblem(rig, 0, [replace(log, values=values)]), DEFAULT) == ()
    )
    values[second] = -values[second]
    problem = PredictionProblem(rig, 0, [replace(log, values=values)])
    coherence = [valve_phase(problem, side, DEFAULT.slow_band).coherence for side in (0, 1)]
    assert min(coherence) < problem.rules.recording.direction_coherence
    (answer,) = one_valve_reversed(problem, DEFAULT)
    assert rig.joints[0].muscles[1] in answer and "reversed" in answer


def test_from_files_to_a_rig_file_that_every_tool_reads(
    rig: Rig, log: Recording, tmp_path: Path
) -> None:
    path, table, out = tmp_path / "rough.yaml", tmp_path / "log.csv", tmp_path / "out"
    save_rig(rough(rig), path)
    tree = yaml.safe_load(path.read_text(encoding="utf-8"))
    parameters = tree["/**"]["ros__parameters"]
    del parameters["elbow"]["viscous_friction"]
    parameters["elbow"]["inertia"] = {"between": [0.005, 0.5]}
    path.write_text(yaml.safe_dump(tree), encoding="utf-8")
    pd.DataFrame({"time": log.time, **log.values}).to_csv(table, index=False)
    assert main(["calibrate", str(table), "--rig", str(path), "--out", str(out)]) == 0
    calibrated = load_rig(out / "calibrated.yaml")
    scale = _torque_per_pressure(calibrated) / _torque_per_pressure(rig)
    inertia = calibrated.joints[0].inertia / scale
    assert inertia == pytest.approx(rig.joints[0].inertia, rel=0.05)
    text = (out / "calibrated.yaml").read_text(encoding="utf-8")
    assert "it was missing" in text and "90 %:" in text
    answer = json.loads((out / "calibration.json").read_text(encoding="utf-8"))
    assert {one["key"] for one in answer["numbers"]} >= {"elbow.inertia", "supply_pressure"}
    page = (out / "calibration.html").read_text(encoding="utf-8")
    assert "Calibration of elbow" in page and "elbow.<wbr>inertia" in page
    assert plots_and_missing_places(page) == (6, [])
    assert load_partial_rig(path).missing >= {"elbow.viscous_friction"}


def test_what_the_log_does_not_determine_stays_open(
    rig: Rig, log: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The middle of a range, and a guess, stood in the file like known numbers."""
    path, table, out = tmp_path / "rough.yaml", tmp_path / "log.csv", tmp_path / "out"
    save_rig(rough(rig), path)
    tree = yaml.safe_load(path.read_text(encoding="utf-8"))
    parameters = tree["/**"]["ros__parameters"]
    flexor, extensor = (parameters[name] for name in rig.joints[0].muscles)
    flexor["valve"]["sonic_conductance"] = {"between": [1e-9, 9e-9]}
    del extensor["valve"]["sonic_conductance"], flexor["dead_volume"]
    parameters["elbow"]["inertia"] = {"between": [0.005, 0.5]}
    path.write_text(yaml.safe_dump(tree), encoding="utf-8")
    measured = {name: x for name, x in log.values.items() if not name.startswith("valve_")}
    pd.DataFrame({"time": log.time, **measured}).to_csv(table, index=False)
    assert main(["calibrate", str(table), "--rig", str(path), "--out", str(out)]) == 0
    left = load_partial_rig(out / "calibrated.yaml")
    one, other = (f"{name}.valve.sonic_conductance" for name in rig.joints[0].muscles)
    assert left.ranges == {one: (1e-9, 9e-9)}
    assert left.missing >= {other, f"{rig.joints[0].muscles[0]}.dead_volume"}
    assert left.is_rough
    told = capsys.readouterr().out
    assert f"{one}: 1e-09 to 9e-09 m^3/(s Pa), as written; would help: the commands" in told
    assert f"{other}: missing; would help: the commands of both valves" in told
    assert "calibrated.yaml is still rough" in told


def _flat(rig: Rig) -> dict[str, float]:
    """Every number of a rig file by its dotted key."""

    def walk(tree: Mapping[str, object], prefix: str) -> dict[str, float]:
        found: dict[str, float] = {}
        for key, value in tree.items():
            if isinstance(value, Mapping):
                found |= walk(value, f"{prefix}{key}.")
            elif isinstance(value, float):
                found[prefix + key] = value
        return found

    return walk(rig.to_parameters(), "")


@pytest.mark.parametrize("kind", ["flow", "pressure_regulator"])
def test_a_small_effect_is_sought_from_none_of_it_on(rig: Rig, kind: str) -> None:
    """An amount counts from the neutral value: an exhaust without any has a ratio of 1, not 0."""
    for muscle in rig.muscles:
        scale = muscle.max_pressure if kind == "pressure_regulator" else None
        valve = replace(muscle.valve, kind=kind, full_scale=scale)
        rig = rig.with_muscle(replace(muscle, valve=valve))
    found = ordinary_numbers(rig, rig.joints[0], DEFAULT, has_commands=True)
    assert found
    for one in found:
        low, high = bounds_of(one.name)
        assert low <= one.free.low < one.free.centre < one.free.high <= high, one.name
        effect, key = one.name.split(".")[-2:]
        if not EFFECTS[effect].parameters[key].is_shape:
            assert neutral_values()[one.name] in (one.free.low, one.free.high), one.name
