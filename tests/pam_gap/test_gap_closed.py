"""The gap closed on a second motion, and the interval that is to cover it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pam_check.blind.untouched import untouched_closed
from pam_gap.inference.confidence import Interval, for_another_motion
from pam_gap.inference.held_out import HeldOut
from pam_gap.inference.hypothesis import Hypothesis
from pam_gap.prediction.fit import PlantFit
from pam_gap.rules import DEFAULT

RULES = DEFAULT.decision


def held_out(rms: float) -> HeldOut:
    sums = np.full((20, 5), 10.0 * rms**2)
    result = PlantFit(np.zeros(0), np.zeros((0, 5)), 0.0, np.zeros((0, 5, 0)), 0)
    return HeldOut.of(Hypothesis((), result, np.ones(5)), sums, np.full((20, 5), 10.0))


def test_interval_is_wider_by_a_factor_of_what_is_left() -> None:
    present = np.ones(5, dtype=bool)
    wide = for_another_motion(
        Interval(0.9, 0.89, 0.91), held_out(1000.0), np.ones(5), present, RULES
    )
    assert wide.value == 0.9
    assert (1.0 - wide.low) / 0.1 == pytest.approx(0.1 / (1.0 - wide.high), rel=0.01)
    assert wide.low < 0.8
    assert 0.95 < wide.high < 1.0


def test_interval_of_a_small_gap_knows_how_little_the_floor_is_known() -> None:
    present = np.ones(5, dtype=bool)
    near = for_another_motion(Interval(1.0, 1.0, 1.0), held_out(3.0), np.ones(5), present, RULES)
    far = for_another_motion(Interval(1.0, 1.0, 1.0), held_out(300.0), np.ones(5), present, RULES)
    assert near.high == far.high == 1.0
    assert near.low < far.low < 1.0


def test_interval_never_shrinks() -> None:
    present = np.ones(5, dtype=bool)
    wide = for_another_motion(Interval(0.5, -0.2, 0.99), held_out(30.0), np.ones(5), present, RULES)
    assert wide.low <= -0.2
    assert wide.high >= 0.99


def test_the_true_rig_closes_the_gap_of_another_motion(tmp_path: Path) -> None:
    """A rig file with the true payload closes it; one with nothing added closes nothing."""
    pytest.importorskip("numba", reason="the truth plant is some 300 times slower without numba")
    from pam_check.blind.cases import rig_parameters, to_table
    from pam_check.blind.truth_plant import (
        PressureExcitation,
        Sensors,
        TruthJoint,
        TruthMuscle,
        run_truth,
    )
    from pam_model.rig import rig_from_parameters, save_rig

    joint = TruthJoint(0.03, 0.05, 0.25, 4.9, 0.0, -1.0, 1.0, 293.15, 101325.0, 701325.0)
    muscle = TruthMuscle(0.2758, 1.856, 0.24996, 0.225, 2e-5, 4e-9, 0.3, 0.005)
    loaded = joint._replace(gravity_torque=6.0, inertia=0.08)
    time = np.arange(3000) * 0.004
    swing = 6e4 * np.sin(2.0 * np.pi * 0.4 * time) * np.clip(time - 0.5, 0.0, 1.0)
    motion = PressureExcitation(np.full(time.size, 2.4e5), swing, np.zeros(time.size), 0.004)
    made = run_truth(loaded, (muscle, muscle), motion, Sensors(), np.random.default_rng(0))
    to_table(made, False).to_csv(tmp_path / "recording.csv.gz", index=False)
    for name, believed in (("written", joint), ("improved", loaded)):
        save_rig(
            rig_from_parameters(rig_parameters(believed, muscle, 0.0)), tmp_path / f"{name}.yaml"
        )
    recording = tmp_path / "recording.csv.gz"
    written, improved = tmp_path / "written.yaml", tmp_path / "improved.yaml"
    assert untouched_closed(written, improved, recording) > 0.95
    assert untouched_closed(written, written, recording) == pytest.approx(0.0, abs=1e-6)


def test_the_interval_of_a_rig_with_a_background_lies_lower() -> None:
    """Beside a background, another motion leaves more of the gap than the recording does."""
    present, closed = np.ones(5, dtype=bool), Interval(0.9, 0.89, 0.91)
    before, floor = held_out(1000.0), np.ones(5)
    plain = for_another_motion(closed, before, floor, present, RULES)
    rough = for_another_motion(closed, before, floor, present, RULES, has_background=True)
    assert rough.low < plain.low
    assert rough.low + rough.high < plain.low + plain.high
    assert rough.low < closed.value < rough.high
