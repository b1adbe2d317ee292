"""The observer of each muscle's gas and the balance of each joint, on the simulated plant."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pam_driver.safety.pressure_plausibility import OBSERVER_GAIN, PressurePlausibility
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import Plant, initial_state
from pam_model.rig import Plausibility, Rig, load_rig

ELBOW = Path(__file__).parents[2] / "config/elbow.yaml"
PERIOD = 0.002
Spoil = Callable[[float, list[float]], list[float]]


@pytest.fixture(scope="module")
def rig() -> Rig:
    return load_rig(ELBOW)


def worst(
    rig: Rig,
    *,
    effects: dict[str, float] | None = None,
    told: Spoil = lambda time, commands: commands,
    shown: Spoil = lambda time, pressures: pressures,
    goal: tuple[float, float] = (2e5, 2e5),
    duration: float = 2.0,
) -> dict[tuple[str, str], float]:
    """The greatest deviation by kind and subject; `told` is what valves do instead."""
    plausibility = PressurePlausibility(rig, PERIOD)
    parameters = PlantParameters.from_rig(rig).replaced(effects or {})
    plant = Plant(parameters, state=initial_state(parameters, pressures=(2e5, 2e5)))
    found: dict[tuple[str, str], float] = {}
    pressures, position = [2e5, 2e5], 0.0
    for k in range(round(duration / PERIOD)):
        time = k * PERIOD
        swing = 0.12 * math.sin(2.0 * math.pi * 1.2 * time)
        commands = [
            max(-1.0, min(1.0, 2e-6 * (g - p) + s))
            for g, p, s in zip(goal, pressures, (swing, -swing), strict=True)
        ]
        before = position
        position, *true = plant.step(told(time, list(commands)), PERIOD)
        pressures = list(true)
        velocity = (position - before) / PERIOD
        plausibility.update(
            commands, shown(time, list(pressures)), [position], [velocity], [math.nan] * 2
        )
        for one in plausibility.deviations():
            key = (one.kind, one.subject)
            found[key] = max(found.get(key, 0.0), one.size)
    return found


@pytest.mark.parametrize(
    "effects",
    [
        {},
        {"valve_dead_zone.overlap": 0.05},
        {"hysteresis.amplitude": 0.08},
        {"thermal.conductance": 0.02},
        {"pressure_gain.gain": 1.03},
        {"payload.mass": 0.5, "payload.distance": 0.2},
    ],
    ids=str,
)
def test_a_healthy_rig_is_no_suspect(rig: Rig, effects: dict[str, float]) -> None:
    assert worst(rig, effects=effects) == {}


def test_a_burst_muscle(rig: Rig) -> None:
    found = worst(rig, effects={"agonist.leakage.conductance": 5e-9})
    assert found["pressure_implausible", "elbow_flexor"] > 1.0


@pytest.mark.parametrize("opening", [1.0, -1.0])
def test_a_valve_stuck_open(rig: Rig, opening: float) -> None:
    def told(time: float, commands: list[float]) -> list[float]:
        return [commands[0], opening] if time > 0.5 else commands

    found = worst(rig, told=told)
    assert found["pressure_implausible", "elbow_extensor"] > 1.0


def test_a_sensor_that_drifts_shows_in_the_torque(rig: Rig) -> None:
    def shown(time: float, pressures: list[float]) -> list[float]:
        return [pressures[0] + 1e5 * max(time - 0.3, 0.0), pressures[1]]

    found = worst(rig, shown=shown)
    assert found["torque_implausible", "elbow"] > 1.0


def test_swapped_sensors(rig: Rig) -> None:
    found = worst(rig, shown=lambda time, p: p[::-1] if time > 0.4 else p, goal=(2.5e5, 1.5e5))
    assert found["torque_implausible", "elbow"] > 1.0


def test_the_residual_of_a_leak_is_its_rate_over_the_gain(rig: Rig) -> None:
    """Valve shut, joint held, a ramp into a first-order lag: by hand."""
    plausibility = PressurePlausibility(rig, PERIOD)
    rate, count = 4.5e5, 300
    for k in range(count):
        pressure = 6e5 - rate * k * PERIOD
        plausibility.update([0.0, 0.0], [pressure, 2e5], [0.0], [0.0], [math.nan] * 2)
    size = next(d for d in plausibility.deviations() if d.subject == "elbow_flexor").size
    settled = 1.0 - math.exp(-OBSERVER_GAIN * count * PERIOD)
    expected = rate / OBSERVER_GAIN * settled / rig.plausibility.pressure_residual
    assert size == pytest.approx(expected, rel=0.02)


def test_missing_values_are_not_judged_and_it_begins_anew(rig: Rig) -> None:
    plausibility = PressurePlausibility(rig, PERIOD)
    nothing = [math.nan, math.nan]
    plausibility.update([1.0, 1.0], [2e5, 2e5], [0.0], [0.0], nothing)
    for _ in range(50):
        plausibility.update([1.0, 1.0], nothing, [math.nan], [math.nan], nothing)
    assert list(plausibility.deviations()) == []
    plausibility.update([0.0, 0.0], [6e5, 0.0], [0.0], [0.0], nothing)
    assert all(one.kind == "torque_implausible" for one in plausibility.deviations())


def test_limits_come_from_the_rig_file(rig: Rig) -> None:
    wide = replace(rig, plausibility=Plausibility(pressure_residual=1e6, torque_share=50.0))
    assert worst(wide, effects={"agonist.leakage.conductance": 5e-9}) == {}


def test_regulators_are_followed(rig: Rig) -> None:
    regulated: Any = rig
    for muscle in rig.muscles:
        valve = replace(muscle.valve, kind="pressure_regulator", full_scale=6e5, time_constant=0.02)
        regulated = regulated.with_muscle(replace(muscle, valve=valve))
    plausibility = PressurePlausibility(regulated, PERIOD)
    parameters = PlantParameters.from_rig(regulated)
    plant = Plant(parameters, state=initial_state(parameters))
    for k in range(1000):
        level = 2e5 if k < 500 else 3.5e5
        position, *pressures = plant.step([level, level], PERIOD)
        fractions = [level / 6e5] * 2
        plausibility.update(fractions, pressures, [position], [0.0], [math.nan] * 2)
        assert not [one for one in plausibility.deviations() if one.size >= 1.0]
    for _ in range(200):
        plausibility.update([0.9, 0.5], [3.5e5, 3.5e5], [0.0], [0.0], [math.nan] * 2)
    assert [d.subject for d in plausibility.deviations() if d.size >= 1.0] == ["elbow_flexor"]
