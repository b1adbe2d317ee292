"""Two joints on one reservoir: what one joint draws, the other one lacks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pam_model.gas import GAS_CONSTANT, mass_flow
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.robot_plant import RobotPlant
from pam_model.plant.simulate import Plant, initial_state
from pam_model.rig import Rig, load_rig

ELBOW = Path(__file__).parents[2] / "config/elbow.yaml"
DROOP = {"supply_droop": {"conductance": 8e-10, "volume": 4e-4}}
OPEN, SHUT, EXHAUST = (1.0, 0.0), (0.0, 0.0), (-1.0, -1.0)
TIME = 0.2  # s


@pytest.fixture(scope="module")
def rig() -> Rig:
    return replace(load_rig(ELBOW), effects=DROOP)


def made(rig: Rig, count: int) -> RobotPlant:
    """Equal joints that cannot move, with their valves at rest."""
    parameters = PlantParameters.from_rig(rig).forced({"joint.inertia": 1e7})
    return RobotPlant([parameters] * count, states=[initial_state(parameters)] * count)


def by_formula(rig: Rig, drawing: int) -> tuple[float, float]:
    """Pressures of the reservoir and of the muscles that fill [Pa absolute], by another solver."""
    gas, muscle = rig.gas, rig.muscles[0]
    valve, droop = muscle.valve, DROOP["supply_droop"]
    volume = float(rig.force_model(muscle.name).volume(muscle.neutral_length)) + muscle.dead_volume
    heat = gas.polytropic_exponent * GAS_CONSTANT * gas.temperature

    def rates(_: float, state: np.ndarray) -> list[float]:
        reservoir, inside, spool = state.tolist()
        drawn = float(
            mass_flow(
                spool * valve.sonic_conductance,
                valve.critical_ratio,
                reservoir,
                inside,
                gas.temperature,
            )
        )
        refill = float(
            mass_flow(
                droop["conductance"],
                valve.critical_ratio,
                rig.supply_pressure,
                reservoir,
                gas.temperature,
            )
        )
        return [
            heat * (refill - drawing * drawn) / droop["volume"],
            heat * drawn / volume,
            (1.0 - spool) / valve.time_constant,
        ]

    begin = [rig.supply_pressure, gas.ambient_pressure, 0.0]
    found = solve_ivp(rates, (0.0, TIME), begin, rtol=1e-9, atol=1e-3).y[:, -1]
    return float(found[0]), float(found[1])


@pytest.mark.parametrize("drawing", [1, 2, 3])
def test_joints_that_draw_together_sag_together(rig: Rig, drawing: int) -> None:
    """The sum of all flows counts, and the whole reservoir, however many joints there are."""
    plant = made(rig, 3)
    commands = [OPEN] * drawing + [SHUT] * (3 - drawing)
    for _ in range(round(TIME / 1e-3)):
        readings = plant.step(commands, 1e-3)
    reservoir, inside = by_formula(rig, drawing)
    assert plant.reservoir_pressure == pytest.approx(reservoir, rel=1e-5)
    for joint in range(drawing):
        assert readings[joint][1] + rig.gas.ambient_pressure == pytest.approx(inside, rel=1e-5)
    assert {one.reservoir_pressure for one in plant.joints} == {plant.reservoir_pressure}


def test_calls_for_long_times_share_the_gas_as_well(rig: Rig) -> None:
    often, rarely = made(rig, 2), made(rig, 2)
    for _ in range(200):
        often.step([OPEN, SHUT], 1e-3)
    for _ in range(4):
        rarely.step([OPEN, SHUT], 0.05)
    assert rarely.reservoir_pressure == pytest.approx(often.reservoir_pressure, rel=1e-9)


def test_one_joint_has_the_whole_reservoir(rig: Rig) -> None:

    parameters = PlantParameters.from_rig(rig)
    alone, robot = Plant(parameters), RobotPlant([parameters])
    for _ in range(50):
        assert robot.step([OPEN], 2e-3) == [alone.step(OPEN, 2e-3)]
    assert robot.reservoir_pressure == alone.reservoir_pressure < rig.supply_pressure


def test_an_ideal_supply_never_sags(rig: Rig) -> None:
    plant = made(rig.without_effects(), 2)
    plant.step([OPEN, OPEN], 0.1)
    assert plant.reservoir_pressure == rig.supply_pressure
