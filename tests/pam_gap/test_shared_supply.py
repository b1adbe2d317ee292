"""Joints that share a reservoir: what the other one draws is an input of the diagnosis."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pam_gap.diagnosis_engine import DiagnosisOptions, JointDiagnosis
from pam_gap.prediction.channel_order import BOTH_PRESSURES
from pam_gap.prediction.channels import drawn_by_others
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import Recording
from pam_model.gas import GAS_CONSTANT, reference_density, reference_flow
from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.robot_plant import RobotPlant
from pam_model.plant.simulate import simulate
from pam_model.rig import Rig, load_rig
from pam_model.robot import compose
from pam_model.views.air_drawn import air_drawn
from pam_model.views.gas_volume import neutral_gas_volume

ELBOW = load_rig(Path(__file__).parents[2] / "config" / "elbow.yaml")
SAMPLE_TIME, DURATION = 0.004, 10.0  # s
DROOP = {"conductance": 6e-9, "volume": 4e-4}
NAMED = {f"supply_droop.{key}": value for key, value in DROOP.items()}


def two_joints() -> Rig:
    """The elbow, and a joint of the same kind that takes much air."""
    joint = ELBOW.joints[0]
    names = {name: f"other_{name}" for name in joint.muscles}
    other = replace(joint, name="other", muscles=tuple(names.values()))
    more = [replace(one, name=names[one.name], board=1) for one in ELBOW.muscles]
    return replace(
        ELBOW, parameter_tolerance=0.0, joints=(joint, other), muscles=(*ELBOW.muscles, *more)
    )


@pytest.fixture(scope="module")
def rig() -> Rig:
    return two_joints()


@pytest.fixture(scope="module")
def recording(rig: Rig) -> Recording:
    """The elbow moves gently while the other joint draws from the reservoir again and again."""
    parameters = [PlantParameters.from_rig(rig, place).forced(NAMED) for place in (0, 1)]
    plant = RobotPlant(parameters, step=1e-3)
    time = np.arange(round(DURATION / SAMPLE_TIME)) * SAMPLE_TIME
    random = np.random.default_rng(3)
    noise = random.standard_normal((time.size, 2, 3)) * (1.5e-4, 150.0, 150.0)
    rows, sent = np.zeros((time.size, 2, 3)), np.zeros((time.size, 2, 2))
    gentle = 4e4 * np.sin(2.0 * np.pi * 0.4 * time) + 2e4 * np.sign(np.sin(2.0 * np.pi * time))
    strong = 1.8e5 * np.sign(np.sin(2.0 * np.pi * time / 1.3))
    shown = np.array([(0.0, 0.0, 0.0)] * 2)
    for k in range(time.size):
        rows[k] = shown + noise[k]
        for place, (mean, half) in enumerate(((3.2e5, gentle[k]), (2.4e5, strong[k]))):
            wanted = np.array([mean + half, mean - half])
            sent[k, place] = np.clip(8e-6 * (wanted - rows[k, place, 1:]), -1.0, 1.0)
        shown = np.array(plant.step(sent[k].tolist(), SAMPLE_TIME))
    cut = round(1.5 / SAMPLE_TIME)  # the fill from ambient is no part of it
    channels = {}
    for place, joint in enumerate(rig.joints):
        channels[f"joint_states.{joint.name}.position"] = rows[cut:, place, 0]
        for side, name in enumerate(joint.muscles):
            channels[f"valve_commands.{name}"] = sent[cut:, place, side]
            channels[f"pressure_states.{name}"] = rows[cut:, place, 1 + side]
    valid = {name: np.ones(time.size - cut, dtype=np.bool_) for name in channels}
    return Recording(Path("simulated"), SAMPLE_TIME, time[: time.size - cut], channels, valid, ())


def test_the_air_of_an_open_valve_is_that_of_the_formula(rig: Rig) -> None:
    robot = compose(rig)
    muscle = robot.muscles[0]
    pressures = np.linspace(0.0, 5e5, 60)
    drawn = air_drawn(robot, muscle, np.ones(60), pressures, 0.01)
    for share, close in ((1.0, 1e-9), (0.95, 0.05)):
        supply = share * robot.supply.pressure
        c, b = muscle.valve.sonic_conductance, muscle.valve.critical_ratio
        formula = [reference_flow(c, b, supply, p + robot.gas.ambient_pressure) for p in pressures]
        found = drawn[:, 0] + drawn[:, 1] * (supply - robot.supply.pressure)
        assert found[20:] == pytest.approx(formula[20:], rel=close)
    assert not air_drawn(robot, muscle, -np.ones(60), pressures, 0.01).any()


@pytest.mark.parametrize("damping", [0.7, 1.0])
def test_the_air_of_a_regulator_is_what_fills_the_muscle(damping: float) -> None:
    """At a constant volume: its rise of pressure times the volume."""
    robot = compose(with_regulators(damping))
    muscle, gas = robot.muscles[0], robot.gas
    parameters = PlantParameters.from_rig(robot.rig).forced({"joint.inertia": 1e7})
    commands = np.repeat([0.0, 3e5, 1e5, 2e5], 250)[:, None] * np.ones(2)
    pressures = simulate(parameters, commands, 0.002).pressures[:, 0]
    found = air_drawn(robot, muscle, commands[:, 0], pressures, 0.002).sum(axis=0) * 0.002
    heat = gas.polytropic_exponent * GAS_CONSTANT * gas.temperature
    volume = neutral_gas_volume(muscle) / (heat * reference_density(gas.temperature))
    risen = np.maximum(np.diff(pressures), 0.0).sum()
    assert found == pytest.approx([risen * volume, 0.0], rel=0.05)


def with_regulators(damping: float) -> Rig:
    """The elbow with pressure regulators."""
    rig = ELBOW
    for name in rig.muscle_names:
        muscle = rig.muscle(name)
        valve = replace(
            muscle.valve,
            kind="pressure_regulator",
            full_scale=6e5,
            time_constant=0.02,
            damping=damping,
        )
        rig = rig.with_muscle(replace(muscle, valve=valve))
    return rig


def test_what_the_own_muscles_draw_is_left_out(rig: Rig, recording: Recording) -> None:
    robot, own = compose(rig), rig.joints[0].muscles
    for place in (0, 1):
        names = [name for name in rig.muscle_names if (name in own) == (place == 1)]
        by_hand = sum(
            air_drawn(
                robot,
                robot.muscle(name),
                recording.values[f"valve_commands.{name}"],
                recording.values[f"pressure_states.{name}"],
                SAMPLE_TIME,
            )
            for name in names
        )
        assert drawn_by_others(recording, rig, place) == pytest.approx(by_hand)
    one = replace(rig, joints=rig.joints[:1])
    assert drawn_by_others(recording, one, 0) is None


def rms(problem: PredictionProblem, changes: dict[str, float]) -> float:
    """RMS of the whitened errors of both pressures."""
    values = PlantParameters.from_rig(problem.rig, problem.joint).forced(changes).values
    errors = problem.errors(values[None])[0][problem.counted][:, BOTH_PRESSURES]
    return float(np.sqrt(np.nanmean(errors**2)))


def test_joints_that_draw_together_sag_together(rig: Rig, recording: Recording) -> None:
    """With the true reservoir, errors are down to the noise only if all that draws is known."""
    problem = PredictionProblem(rig, 0, [recording])
    alone = problem.with_data(lambda data: replace(data, drawn=None))
    assert rms(problem, NAMED) < 1.3
    assert rms(alone, NAMED) > 3.0
    assert rms(problem, {}) == rms(alone, {}) > 3.0  # an ideal supply never sags


@pytest.mark.skipif(not HAVE_NUMBA, reason="a fit needs the compiled plant")
def test_a_supply_that_the_other_joint_lets_sag_is_named(rig: Rig, recording: Recording) -> None:
    engine = JointDiagnosis(rig, 0, [recording], DiagnosisOptions(with_experiment=False))
    rivals = ("supply_droop", "exhaust_restriction", "valve_lag", "leakage", "valve_gain")
    few = [one for one in engine.candidates if one.effect in rivals]
    engine.candidates = few
    found = engine.run()
    assert found.effects == ("supply_droop",)
    values = {name: one.interval.value for name, one in found.parameters["supply_droop"].items()}
    assert values == pytest.approx(DROOP, rel=0.05)
