"""Bounds of effects and models do not cut off what a rig of any usual size has."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pam_gap.inference.candidates import rig_scales
from pam_model.effects import EFFECTS
from pam_model.muscle_sizes import SIZES
from pam_model.muscles.force_model import registered_models
from pam_model.rig import Rig, load_rig
from pam_model.rig.from_datasheet import BraidFromDatasheet


def of_size(rig: Rig, size: str, length: float) -> Rig:
    """The rig with muscles of a size of a maker and of this length [m]."""
    braid = BraidFromDatasheet.of_size(size, length)
    for muscle in rig.muscles:
        rig = rig.with_muscle(
            replace(
                muscle,
                thread_length=braid.thread_length,
                turns=braid.turns,
                rest_length=length,
                neutral_length=0.9 * length,
            )
        )
    return rig


@pytest.mark.parametrize("length", [0.06, 0.3, 1.0])
@pytest.mark.parametrize("size", ["DMSP-10", "DMSP-20", "DMSP-40"])
def test_the_range_that_is_searched_is_not_cut_off(rig_path, size: str, length: float) -> None:
    """A bladder of a short, thick muscle is stiffer than any number that an elbow has."""
    assert size in SIZES
    rig = of_size(load_rig(rig_path), size, length)
    scales = rig_scales(rig, rig.joints[0])
    cut = [
        (effect.name, key, searched.low, searched.high)
        for effect in EFFECTS.values()
        for key, searched in effect.search.ranges(scales).items()
        if not (
            effect.parameters[key].low
            <= searched.low
            <= searched.high
            <= effect.parameters[key].high
        )
    ]
    assert cut == []


def test_one_number_has_one_bound_in_all_models() -> None:
    """The factor of the ends is called k, or is a part of it."""
    caps = EFFECTS["end_caps"].parameters["factor"]
    models = registered_models()
    for model, key in (
        ("tondu_lopez", "k"),
        ("tondu_lopez_pressure_factor", "constant_factor"),
    ):
        bounds = models[model].model.parameters[key]
        assert bounds.low < 1.0
        assert bounds.high >= caps.high
