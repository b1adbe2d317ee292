"""The constants of several plants that are derived together are those of each plant alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pam_model.effects import EFFECTS
from pam_model.plant.constants import derive_constants
from pam_model.plant.numbers_of_lanes import columns_of, larger, law_where, rows_of, smaller
from pam_model.plant.parameters import INDEX, RIG_PLACES, PlantParameters, parameter_names
from pam_model.plant.sensors import sensor_constants
from pam_model.rig import load_rig

CONFIG = Path(__file__).parents[2] / "config"


def unlike_plants(parameters: PlantParameters) -> np.ndarray:
    """Plants with none, one and several effects, of which most have other rig numbers, too."""
    random = np.random.default_rng(5)
    stated = [k for k, place in enumerate(RIG_PLACES.values()) if place.section != "effect"]
    lanes = [parameters.values, parameters.values]
    for first in EFFECTS:
        values = parameters.values.copy()
        values[stated] *= random.uniform(0.9, 1.1, len(stated)) ** random.integers(0, 2)
        for name in {first, *random.choice(list(EFFECTS), 2)}:
            for key, size in EFFECTS[name].portrait.sizes.items():
                places = [INDEX[place] for place in parameter_names(name, key)]
                values[random.permutation(places)[: random.integers(1, 3)]] = size
        lanes.append(values)
    return np.array(lanes)


@pytest.mark.parametrize("rig", ["elbow", "elbow_canopen_regulator"])
def test_constants_of_a_batch_are_those_of_each_plant(rig: str) -> None:
    lanes = unlike_plants(PlantParameters.from_rig(load_rig(CONFIG / f"{rig}.yaml")))
    for derive in (derive_constants, sensor_constants):
        each = np.array([derive(values) for values in lanes])
        assert (np.ptp(each, axis=0) > 0.0).sum() > 4
        np.testing.assert_array_equal(derive(lanes), each)
        for one in range(3):
            np.testing.assert_array_equal(derive(lanes[one : one + 1]), each[one : one + 1])


def test_a_number_that_is_the_same_in_all_plants_stays_a_float() -> None:
    rows = np.array([[1.0, 2.0], [1.0, 3.0]])
    same, other = columns_of(rows)
    assert type(same) is float and other.tolist() == [2.0, 3.0]
    np.testing.assert_array_equal(rows_of([same, other], rows), rows)


def test_choices_are_those_of_python_also_for_what_is_not_a_number() -> None:
    pairs = [(1.0, 2.0), (2.0, 1.0), (np.nan, 1.0), (1.0, np.nan)]
    first, second = np.array(pairs).T
    np.testing.assert_array_equal(larger(first, second), [max(pair) for pair in pairs])
    np.testing.assert_array_equal(smaller(first, second), [min(pair) for pair in pairs])


def test_a_law_is_not_called_for_plants_that_do_not_have_it() -> None:
    is_on, size = np.array([0.0, 1.0]), np.array([0.0, 4.0])
    assert law_where(is_on, lambda x: 1.0 / x, size).tolist() == [0.0, 0.25]
    assert law_where(0.0, lambda x: 1.0 / x, size) == 0.0
