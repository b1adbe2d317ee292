"""A regulator has two poles with a damping: in the plant, in what a driver expects, in a file."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pam_model.errors import RigError
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import initial_state, simulate
from pam_model.rig import Rig, load_rig, save_rig
from pam_model.robot import compose
from pam_model.views.expected_pressure import ExpectedPressure

ROOT = Path(__file__).parents[2]
CORNER = 74.0  # rad/s, measured on a real regulator; its damping was 0.65
START, STEP_TO = 1.0e5, 2.0e5  # Pa
PERIOD = 1e-3  # s


def regulated(damping: float | None, conductance: float = 1e-6) -> Rig:
    """The elbow with regulators whose open valve is no limit."""
    rig = load_rig(ROOT / "config" / "elbow.yaml")
    for muscle in rig.muscles:
        valve = replace(
            muscle.valve, kind="pressure_regulator", time_constant=1.0 / CORNER, full_scale=6e5,
            sonic_conductance=conductance, damping=damping,
        )  # fmt: skip
        rig = rig.with_muscle(replace(muscle, valve=valve))
    return rig


def step_response(damping: float, time: np.ndarray) -> np.ndarray:
    """Of w^2/(s^2 + 2 damping w s + w^2), from START to STEP_TO."""
    x = CORNER * time
    if damping == 1.0:
        left = (1.0 + x) * np.exp(-x)
    else:
        swing = np.sqrt(complex(damping**2 - 1.0))
        slow, fast = -damping + swing, -damping - swing
        left = ((fast * np.exp(slow * x) - slow * np.exp(fast * x)) / (fast - slow)).real
    return STEP_TO - (STEP_TO - START) * left


@pytest.mark.parametrize("damping", [None, 0.3, 0.65, 1.0, 1.6])
def test_the_plant_answers_a_step_as_two_poles_of_this_damping_do(damping: float | None) -> None:
    parameters = PlantParameters.from_rig(regulated(damping))
    start = initial_state(parameters, pressures=(START, START), commands=(START, START))
    made = simulate(parameters, np.full((200, 2), STEP_TO), PERIOD, start, step=2.5e-4)
    wanted = step_response(damping or 1.0, made.time)
    assert np.abs(made["agonist.pressure"] - wanted).max() < 50.0


@pytest.mark.parametrize("damping", [0.65, 1.0])
def test_the_pressure_that_a_driver_expects_overshoots_alike(damping: float) -> None:
    robot = compose(regulated(damping, 3e-8))
    expected = ExpectedPressure(robot, robot.muscles[0], PERIOD)
    ambient = robot.gas.ambient_pressure
    state = expected.init().known(START + ambient)._replace(spool=START / 6e5)
    pressures = []
    for _ in range(200):
        pressures.append(state.inside - ambient)
        state = expected.step(state, STEP_TO / 6e5, [0.0], [0.0], math.nan)
    wanted = step_response(damping, PERIOD * np.arange(200))
    # the view opens the valve over a band of 20 kPa, so it is a little late
    assert np.abs(np.array(pressures) - wanted).max() < 0.02 * (STEP_TO - START)
    overshoot = max(pressures) / STEP_TO - 1.0
    assert (overshoot > 0.02) == (damping < 1.0)


def test_slow_commands_are_followed_late_by_twice_damping_over_corner() -> None:
    valve = compose(regulated(0.65)).muscles[0].valve
    assert valve.follows_after == pytest.approx(2.0 * 0.65 / CORNER)
    time = PERIOD * np.arange(600)
    parameters = PlantParameters.from_rig(regulated(0.65))
    start = initial_state(parameters, pressures=(START, START), commands=(START, START))
    ramp = START + 1e5 * np.repeat(time[:, None], 2, axis=1)
    made = simulate(parameters, ramp, PERIOD, start, step=2.5e-4)
    behind = (ramp[-1, 0] - made["agonist.pressure"][-1]) / 1e5
    assert behind == pytest.approx(valve.follows_after + 0.5 * PERIOD, abs=1e-5)  # held commands


def test_a_file_keeps_it_and_refuses_it_for_a_flow_valve(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    save_rig(regulated(0.65), path)
    assert load_rig(path) == regulated(0.65)
    save_rig(regulated(None), path)
    assert "damping" not in path.read_text()
    text = (ROOT / "config" / "elbow.yaml").read_text()
    path.write_text(text.replace("kind: flow", "kind: flow\n        damping: 0.7"))
    with pytest.raises(RigError, match=r"elbow_flexor.valve.damping = 0.7: only a pressure_regul"):
        load_rig(path)


@pytest.mark.parametrize("damping", [0.3, 0.45, 0.65, 1.6])
def test_a_regulator_whose_flow_is_limited_does_not_wind_up(damping: float) -> None:
    """With a damping below 0.5 the pressure that its outlet follows grew without an end."""
    parameters = PlantParameters.from_rig(regulated(damping, 4e-9))
    start = initial_state(parameters, pressures=(0.0, 0.0), commands=(0.0, 0.0))
    made = simulate(parameters, np.full((1500, 2), STEP_TO), PERIOD, start, step=2.5e-4)
    overshoot = math.exp(-math.pi * damping / math.sqrt(1.0 - damping**2)) if damping < 1.0 else 0.0
    for side in ("agonist", "antagonist"):
        pressure = made[f"{side}.pressure"]
        assert pressure.max() <= (1.0 + overshoot) * STEP_TO + 1e3
        assert np.abs(pressure[-500:] - STEP_TO).max() < 100.0
