"""Drawn muscles on a bench: their logs and rig files are those of one muscle."""

from __future__ import annotations

import numpy as np
import pytest

from pam_check.calibration.bench_diagnoses import HELD, HOW, draw_bench, hidden_effects
from pam_model.effects import EFFECTS


def test_a_single_muscle_has_no_effect_of_a_joint() -> None:
    names = hidden_effects()
    assert {"hysteresis", "threshold_pressure", "valve_dead_zone"} <= {*names}
    assert not [name for name in names if EFFECTS[name].scope == "joint"]


@pytest.mark.parametrize("how", HOW)
def test_a_drawn_bench_is_logged_without_a_joint(how: str) -> None:
    bench = draw_bench(np.random.default_rng(3), "pressure_gain", how)
    (muscle,) = bench.rig.muscle_names
    assert bench.rig.joints == ()
    assert len(bench.logs) == (len(HELD) if how == "held" else 1)
    lengths = [log[f"muscle_states.{muscle}.position"] for log in bench.logs]
    rest = bench.rig.muscle(muscle).rest_length
    assert all(0.6 * rest < length.min() <= length.max() < 1.1 * rest for length in lengths)
    for log in bench.logs:
        assert {name.split(".")[1] for name in log.columns if name != "time"} == {muscle}
        if how == "held":
            assert np.ptp(log[f"muscle_states.{muscle}.position"]) == 0.0
