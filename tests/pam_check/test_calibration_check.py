"""The check of calibrations: what it draws is off as it says, and its comparison sees errors."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from pam_check.blind.cases import to_table
from pam_check.blind.truth_plant import run_truth
from pam_check.blind.variety import Variety
from pam_check.calibration.campaign import (
    TOLERANCES,
    as_recording,
    compare,
    over_deviation,
    score,
    torque_per_pressure,
)
from pam_check.calibration.drawn_rig import (
    EXCHANGES,
    LENGTHS,
    OF_JOINT,
    OF_LENGTH,
    THIRD,
    CalibrationRig,
    draw_rig,
    draw_true_rig,
    exchange,
    motion,
    written_numbers,
)
from pam_gap.calibration.calibration import (
    DETERMINED,
    KEPT,
    CalibratedNumber,
    calibrate_joint,
)
from pam_model.rig.partial import load_partial_rig


@pytest.fixture(scope="module")
def drawn() -> CalibrationRig:
    return draw_rig(np.random.default_rng(4))


def _written(drawn: CalibrationRig, key: str) -> float | None:
    tree: object = drawn.parameters
    for step in key.split("."):
        assert isinstance(tree, dict)
        if step not in tree:
            return None
        tree = tree[step]
    assert isinstance(tree, float)
    return tree


def test_every_number_of_the_rig_file_is_off_within_what_is_said(drawn: CalibrationRig) -> None:
    off = {}
    for key, true in drawn.truth.items():
        written = _written(drawn, key)
        if written is not None and true and not key.endswith(("angle", "neutral_length")):
            off[key] = abs(written / true - 1.0)
    lengths = {
        k: v for k, v in off.items() if k.rpartition(".")[2] in (*OF_LENGTH, "pulley_radius")
    }
    others = {k: v for k, v in off.items() if k not in lengths and k != "supply_pressure"}
    assert all(0.0 < v <= LENGTHS * 1.001 for v in lengths.values())
    assert all(0.0 < v <= THIRD * 1.001 for v in others.values())
    assert any(v > 0.1 for v in others.values())
    assert any(name in k for k in others for name in OF_JOINT)


def test_the_log_is_as_the_pages_ask_for(drawn: CalibrationRig) -> None:
    time = drawn.log["time"].to_numpy()
    assert time[-1] - time[0] == pytest.approx(40.0, abs=0.1)
    assert np.median(np.diff(time)) <= 1.0 / 200.0 + 1e-5
    assert drawn.withheld["time"].iloc[-1] == pytest.approx(20.0, abs=0.1)


@pytest.mark.parametrize("what", EXCHANGES)
def test_an_exchange_changes_the_log_and_undoes_itself(drawn: CalibrationRig, what: str) -> None:
    once = exchange(drawn.log, what)
    assert not once[sorted(once)].equals(drawn.log[sorted(drawn.log)])
    twice = exchange(once, what)
    assert twice[sorted(twice)].equals(drawn.log[sorted(drawn.log)])


def test_the_comparison_sees_errors_and_ratios(drawn: CalibrationRig) -> None:
    found = [
        CalibratedNumber(
            key, "-", "body", true, true * (1.1 if key == "elbow.inertia" else 1.0),
            0.99 * true, 1.01 * true, KEPT if key == "supply_pressure" else DETERMINED,
            (0.99 * true, 1.01 * true) if key == "elbow.inertia" else None,
        )
        for key, true in drawn.truth.items()
    ]  # fmt: skip
    rows = {row.key: row for row in compare(0, found, drawn.truth)}
    assert rows["elbow.inertia"].error == pytest.approx(0.1)
    assert rows["elbow.inertia"].ratio_error == pytest.approx(0.1)
    assert math.isnan(rows["elbow_flexor.turns"].ratio_error)
    rigs = [{"exchanged": "", "refused": False, "told": False, "before": 1.0, "after": 0.1,
             "tried": [True, False],
             "seconds": 1.0}]  # fmt: skip
    result = score(list(rows.values()), rigs)
    assert result["determined"] < 0.01
    assert result["relative"] == pytest.approx(0.1)
    assert result["exchanges_tried"] == [1, 2]
    assert result["by_number"]["inertia"]["error"] == pytest.approx(0.1)
    assert result["by_number"]["inertia"]["ratio_covered"] == 1.0
    assert result["by_number"]["turns"]["count"] == 2.0
    assert result["by_number"]["supply_pressure"]["kept"] == 1.0


def test_the_torque_per_pressure_grows_with_the_pulley(drawn: CalibrationRig) -> None:
    truth = dict(drawn.truth)
    base = torque_per_pressure(truth)
    truth["elbow.pulley_radius"] *= 2.0
    assert torque_per_pressure(truth) == pytest.approx(2.0 * base)
    assert over_deviation(1.0, 1.1, (1.05, 1.1 + 1.645)) == pytest.approx(0.1 / (0.05 / 1.645))


DAMPING = 0.65
SMALL_STEP = 8e3
"""Steps of the set points [Pa] that the flow of air does not limit, so that the damping shows."""


def small_steps(random: np.random.Generator, count: int, period: float) -> np.ndarray:
    """Steps up and down of `SMALL_STEP`, each held for 0.15 to 0.5 s, after 2.5 s of rest."""
    found, at = np.zeros(count), round(2.5 / period)
    while at < count:
        held = round(random.uniform(0.15, 0.5) / period)
        found[at : at + held] = SMALL_STEP * random.choice([-1.0, 1.0])
        at += held
    return found


@pytest.fixture(scope="module")
def with_small_steps(tmp_path_factory: pytest.TempPathFactory) -> dict[str, CalibratedNumber]:
    """A rig whose regulators have two poles with a damping of 0.65, which its file leaves out."""
    kind, period = Variety(regulator_time=1.0 / 74.0), 0.002
    random = np.random.default_rng(8)
    true = draw_true_rig(random, kind)
    first, second = (m._replace(regulator_damping=DAMPING) for m in true.muscles)
    played = motion(random, true.believed, period, 20.0)
    count = len(played.level)
    played = replace(
        played,
        difference=played.difference + small_steps(np.random.default_rng(1), count, period),
        level=played.level + small_steps(np.random.default_rng(2), count, period),
    )
    made = run_truth(true.joint, (first, second), played, true.sensors, random, supply=true.supply)
    tree = written_numbers(random, true.joint, first, second)
    path = tmp_path_factory.mktemp("damping") / "rig.yaml"
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": tree}}))
    found = calibrate_joint(
        load_partial_rig(path), 0, [as_recording(to_table(made, False), "log")], said=TOLERANCES
    )
    assert found.rig is not None
    numbers = {one.key: one for one in found.numbers}
    for muscle, own in (("elbow_flexor", first), ("elbow_extensor", second)):
        lag = numbers[f"{muscle}.valve.time_constant"]
        assert lag.value == pytest.approx(own.time_constant, rel=0.12)
        damping = numbers[f"{muscle}.valve.damping"]
        assert damping.written is None
        assert found.rig.muscle(muscle).valve.damping == damping.value
    return numbers


@pytest.mark.long("the plant's and the design's tests of the damping stand for the whole fit")
@pytest.mark.parametrize("muscle", ["elbow_flexor", "elbow_extensor"])
def test_small_steps_show_the_damping_of_regulators_of_the_independent_plant(
    with_small_steps: dict[str, CalibratedNumber], muscle: str
) -> None:
    damping = with_small_steps[f"{muscle}.valve.damping"]
    assert damping.status != KEPT
    assert damping.high - damping.low < 0.3
    assert damping.value == pytest.approx(DAMPING, abs=0.15)


@pytest.mark.long("the plant's and the design's tests of the damping stand for the whole fit")
@pytest.mark.xfail(strict=True, reason="docs/from_log_to_rig.md: it is found a tenth too large")
@pytest.mark.parametrize("muscle", ["elbow_flexor", "elbow_extensor"])
def test_a_calibration_finds_the_damping_of_regulators_of_the_independent_plant(
    with_small_steps: dict[str, CalibratedNumber], muscle: str
) -> None:
    damping = with_small_steps[f"{muscle}.valve.damping"]
    assert damping.value == pytest.approx(DAMPING, abs=0.05)


@pytest.mark.long("a whole calibration of a drawn robot")
def test_the_inner_loop_of_a_regulator_is_not_taken_for_friction_of_the_joint(
    tmp_path: Path,
) -> None:
    """Its lag is as long as either pole; along predicted pressures, friction was 83 % too large."""
    drawn = draw_rig(np.random.default_rng([461211, 8]))
    path = tmp_path / "rig.yaml"
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": dict(drawn.parameters)}}))
    partial = load_partial_rig(path)
    assert {muscle.valve.kind for muscle in partial.rig.muscles} == {"pressure_regulator"}
    found = calibrate_joint(partial, 0, [as_recording(drawn.log, "log")], said=TOLERANCES)
    rows = {row.key: row for row in compare(0, found.numbers, drawn.truth)}
    assert rows["elbow.inertia"].ratio_error == pytest.approx(0.0, abs=0.02)
    assert rows["elbow.viscous_friction"].ratio_error == pytest.approx(0.0, abs=0.05)
