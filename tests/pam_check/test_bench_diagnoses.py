"""Drawn muscles on a bench: their logs and rig files are those of one muscle."""

from __future__ import annotations

import numpy as np
import pytest

from pam_check.calibration.bench_diagnoses import (
    HELD,
    HOW,
    NONE_EVERY,
    draw_bench,
    hidden_effects,
    way_of,
)
from pam_model.effects import EFFECTS
from pam_model.rig import rig_from_parameters


def test_a_single_muscle_has_no_effect_of_a_joint() -> None:
    names = hidden_effects()
    assert {"hysteresis", "threshold_pressure", "valve_dead_zone"} <= {*names}
    assert not [name for name in names if EFFECTS[name].scope == "joint"]


def test_every_way_is_tried_with_effects_and_without() -> None:
    numbers = range(24)
    assert {way_of(k, "creep") for k in numbers} == {*HOW} - {"held"}
    assert {way_of(k, "leakage") for k in numbers if k % NONE_EVERY != NONE_EVERY - 1} == {*HOW}
    assert {way_of(k, "") for k in numbers if k % NONE_EVERY == NONE_EVERY - 1} == {*HOW}


@pytest.mark.parametrize("how", HOW)
def test_a_drawn_bench_is_logged_without_a_joint(how: str) -> None:
    bench = draw_bench(np.random.default_rng(3), "pressure_gain", how)
    assert bench.parameters["joints"] == []
    rig = rig_from_parameters(bench.parameters)
    assert rig.muscle_names == (bench.muscle,)
    own = rig.muscle(bench.muscle)
    for logs in (bench.healthy, bench.logs):
        assert len(logs) == (len(HELD) if how == "held" else 1)
        for log in logs:
            length = log[f"muscle_states.{bench.muscle}.position"]
            names = {name.split(".")[1] for name in log.columns if name != "time"}
            assert names == {bench.muscle}
            assert 0.6 * own.rest_length < length.min() <= length.max() < 1.15 * own.rest_length
            assert (np.ptp(length) == 0.0) == (how == "held")


def test_a_load_pulls_against_the_muscle() -> None:
    """A weight's pull hardly depends on the length; a spring pulls more, the shorter the muscle."""
    slope = {}
    for how in ("weight", "spring"):
        bench = draw_bench(np.random.default_rng(5), "", how)
        log = bench.healthy[0]
        length = log[f"muscle_states.{bench.muscle}.position"].to_numpy()
        force = log[f"muscle_states.{bench.muscle}.effort"].to_numpy()
        slope[how] = np.polyfit(length, force, 1)[0] * np.ptp(length) / np.median(force)
        assert np.median(force) > 20.0
    assert slope["spring"] < -0.5
    assert abs(slope["weight"]) < 0.5 * abs(slope["spring"])
