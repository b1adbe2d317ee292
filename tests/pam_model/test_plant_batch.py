"""A batch of joints with commands of their own gives what as many plants give."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pam_model.effects import EFFECTS
from pam_model.errors import PamError
from pam_model.plant.parameters import NAMES, PlantParameters
from pam_model.plant.plant_batch import PlantBatch
from pam_model.plant.simulate import Plant, vented_state
from pam_model.rig import load_rig
from support.rigs import ELBOW

PERIOD = 0.01  # s


def with_effects(names: tuple[str, ...]) -> PlantParameters:
    """The elbow with effects of the sizes that their pages show, on every joint and muscle."""
    rig = load_rig(ELBOW)
    of: dict[str, dict[str, Any]] = {"joint": {}, "muscle": {}, "rig": {}}
    for name in names:
        of[EFFECTS[name].scope][name] = dict(EFFECTS[name].portrait.sizes)
    muscles = tuple(replace(one, effects=of["muscle"]) for one in rig.muscles)
    rig = replace(rig, muscles=muscles, effects=of["rig"]).with_joint(
        replace(rig.joints[0], effects=of["joint"])
    )
    return PlantParameters.from_rig(rig)


def drawn(parameters: PlantParameters, count: int, seed: int) -> np.ndarray:
    """Numbers of `count` joints around these."""
    generator = np.random.default_rng(seed)
    values = np.repeat(parameters.values[None], count, axis=0)
    for name in ("joint.inertia", "joint.viscous_friction", "joint.gravity_torque"):
        values[:, NAMES.index(name)] *= generator.uniform(0.8, 1.2, count)
    return values


def plants(parameters: PlantParameters, values: np.ndarray) -> list[Plant]:
    made = [replace(parameters, values=row) for row in values]
    found = [Plant(one, state=vented_state(one)) for one in made]
    for one in found:
        one.observe(0.0)
    return found


def batch_of(parameters: PlantParameters, values: np.ndarray) -> PlantBatch:
    states = np.array([vented_state(replace(parameters, values=row)) for row in values])
    return PlantBatch(parameters, values, states, PERIOD)


DELAYS = ("command_delay", "position_delay", "pressure_lag", "pressure_gain", "position_offset")
MANY_LAWS = ("coulomb_friction", "payload", "hysteresis", "supply_droop")
COMPILED = pytest.mark.long(
    "a kernel that takes long to compile; those of fewer laws stay, and test_lanes holds every law"
)


@pytest.mark.parametrize(
    ("names", "count"),
    [
        ((), 1),
        ((), 20),
        (("coulomb_friction", "payload"), 20),
        (MANY_LAWS, 1),
        pytest.param(MANY_LAWS, 20, marks=COMPILED),
        (DELAYS, 1),
        (DELAYS, 20),
    ],
    ids=lambda value: ("+".join(value) or "none") if isinstance(value, tuple) else None,
)
def test_readings_are_those_of_single_plants(names: tuple[str, ...], count: int) -> None:
    parameters = with_effects(names)
    values = drawn(parameters, count, 3)
    batch, alone = batch_of(parameters, values), plants(parameters, values)
    batch.observe(np.full(count, True))
    generator = np.random.default_rng(4)
    commands = np.zeros((count, 2))
    for step in range(60):
        if step % 5 == 0:
            commands = generator.uniform(-1.0, 1.0, (count, 2))
        found = batch.step(commands)
        expected = [one.step(row, PERIOD) for one, row in zip(alone, commands, strict=True)]
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(batch.states, [one.state for one in alone], rtol=1e-9, atol=1e-9)
    assert np.ptp(found[:, 0]) > 0.1 or count == 1


def test_some_begin_anew_and_the_others_go_on() -> None:
    parameters = with_effects(("command_delay", "position_delay"))
    values = drawn(parameters, 20, 5)
    batch, alone = batch_of(parameters, values), plants(parameters, values)
    batch.observe(np.full(20, True))
    generator = np.random.default_rng(6)
    for step in range(40):
        if step == 17:
            chosen = np.arange(20) % 3 == 0
            longer = with_effects(("command_delay", "position_delay", "coulomb_friction"))
            values[chosen] = drawn(longer, 20, 7)[chosen]
            fresh = plants(parameters, values)
            alone = [
                new if anew else old for new, old, anew in zip(fresh, alone, chosen, strict=True)
            ]
            states = np.array([one.state for one in alone])[chosen]
            batch.restart(chosen, values[chosen], states)
            batch.observe(chosen)
        commands = generator.uniform(-1.0, 1.0, (20, 2))
        found = batch.step(commands)
        expected = [one.step(row, PERIOD) for one, row in zip(alone, commands, strict=True)]
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def test_a_wrong_shape_is_one_line() -> None:
    parameters = with_effects(())
    with pytest.raises(PamError, match=r"values .* expected \(n, "):
        PlantBatch(parameters, np.zeros((3, 2)), np.zeros((3, 2)), PERIOD)
