"""The observer of the gas and the balance of the joint on the simulated plant: who is a suspect."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from pam_driver.safety.limits_by_size import pressure_residual
from pam_driver.safety.pressure_plausibility import PressurePlausibility
from pam_model.effects import EFFECTS, Nothing
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import Plant, initial_state
from pam_model.rig import Plausibility, Rig
from pam_model.robot import compose

from .plausibility_bench import (
    PERIOD,
    worst,
)


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


NAMED = {
    "payload": {"mass": 4.5, "distance": 0.4},
    "pulley_radius": {"scale": 1.3},
    "viscous_friction": {"extra": 3.0},
    "coulomb_friction": {"torque": 3.0, "presliding_angle": 1e-3},
    "position_offset": {"offset": 0.3},
    "bladder_elasticity": {"linear": 4000.0},
    "end_caps": {"factor": 1.4},
    "threshold_pressure": {"pressure": 1e5},
    "cable_compliance": {"compliance": 2e-4},
    "valve_dead_zone": {"overlap": 0.25},
    "valve_null_offset": {"offset": 0.15},
    "valve_lag": {"extra_time_constant": 0.1},
    "exhaust_restriction": {"ratio": 0.3},
    "command_delay": {"delay": 0.08},
    "tube_restriction": {"conductance": 1e-9, "volume": 6e-6},
    "leakage": {"conductance": 2e-9},
    "dead_volume": {"extra_volume": 1e-3},
    "pressure_gain": {"gain": 1.4},
    "pressure_bias": {"bias": 8e4},
}


SMALL_LIMITS = Plausibility(pressure_residual=1e4, torque_share=0.05, warning_share=1e-3)


def told_by_the_file(rig: Rig, name: str, values: dict[str, float]) -> Rig:
    """The rig with an effect in its file, on both muscles or on the joint."""
    if EFFECTS[name].scope == "joint":
        return rig.with_joint(replace(rig.joints[0], effects={name: values}))
    for muscle in rig.muscles:
        rig = rig.with_muscle(replace(muscle, effects={name: values}))
    return rig


def worst_of_a_large_motion(rig: Rig, effects: dict[str, float] | None = None) -> dict[Any, float]:
    return worst(
        rig, effects=effects, goal=(2.6e5, 2.0e5), swing_size=0.3, settled=1.0, duration=2.5
    )


@pytest.fixture(scope="module")
def ideal(rig: Rig) -> dict[Any, float]:
    return worst_of_a_large_motion(replace(rig, plausibility=SMALL_LIMITS))


@pytest.mark.parametrize("name", NAMED)
def test_what_the_rig_file_names_is_no_suspicion(
    rig: Rig, name: str, ideal: dict[Any, float]
) -> None:
    """A large effect stands out of a rig whose file does not know it, and vanishes once it does."""
    sharp = replace(rig, plausibility=SMALL_LIMITS)
    hidden = {f"{name}.{key}": value for key, value in NAMED[name].items()}
    unknown = worst_of_a_large_motion(sharp, hidden)
    known = worst_of_a_large_motion(told_by_the_file(sharp, name, NAMED[name]))
    shown_by = max(unknown, key=unknown.__getitem__)
    assert unknown[shown_by] > 10.0 * ideal[shown_by]
    assert known.get(shown_by, 0.0) < 0.15 * unknown[shown_by]


def test_a_payload_in_the_rig_file_does_not_vent(rig: Rig) -> None:
    load = {"mass": 4.5, "distance": 0.4}
    hidden = {f"payload.{key}": value for key, value in load.items()}
    assert worst_of_a_large_motion(rig, hidden)["torque_implausible", "elbow"] > 1.0
    assert worst_of_a_large_motion(told_by_the_file(rig, "payload", load)) == {}


def test_every_effect_that_is_said_to_be_known_is_tried() -> None:
    said = {
        name for name, effect in EFFECTS.items() if not isinstance(effect.plausibility, Nothing)
    }
    # braid_extensibility changes the pull too little at any plausible size, and stribeck_friction
    # leaves the same room as coulomb_friction
    assert said - set(NAMED) == {"braid_extensibility", "stribeck_friction"}


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


def test_crossed_hoses_are_a_fault_of_both_muscles_before_either_has_deviated_by_its_limit(
    rig: Rig,
) -> None:
    """A driver that knows of one implausible muscle would brake with the wrong one."""
    plausibility = PressurePlausibility(compose(rig), PERIOD)
    parameters = PlantParameters.from_rig(rig)
    plant = Plant(parameters, state=initial_state(parameters, pressures=(1e5, 1e5)))
    largest = 0.0
    for _ in range(100):
        position, *pressures = plant.step([-0.5, 0.5], PERIOD)
        plausibility.update([0.5, -0.5], pressures, [position], [0.0], [math.nan] * 2)
        found = [d for d in plausibility.deviations() if d.kind == "pressure_implausible"]
        residuals = [float(d.text.split()[3]) for d in found]
        largest = max(map(abs, residuals), default=0.0)
        if any(d.size >= 1.0 for d in found):
            break
    assert [d.subject for d in found if d.size >= 1.0] == list(rig.muscle_names)
    assert largest < pressure_residual(compose(rig), compose(rig).muscles[0])


def test_regulators_are_followed(rig: Rig) -> None:
    regulated: Any = rig
    for muscle in rig.muscles:
        valve = replace(muscle.valve, kind="pressure_regulator", full_scale=6e5, time_constant=0.02)
        regulated = regulated.with_muscle(replace(muscle, valve=valve))
    plausibility = PressurePlausibility(compose(regulated), PERIOD)
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
