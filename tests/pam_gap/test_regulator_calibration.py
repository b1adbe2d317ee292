"""A calibration finds the dynamics of pressure regulators: their poles and how these are damped."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pam_gap.calibration.calibration import KEPT, CalibratedNumber, Calibration, calibrate_joint
from pam_gap.calibration.free_numbers import Said
from pam_gap.recordings.recording import Recording, from_columns, resample
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import Plant
from pam_model.rig import Rig
from pam_model.rig.partial import PartialRig

from .test_calibration import rough

TIME_CONSTANT = 1.0 / 74.0  # s, measured on a real regulator
DAMPING = {"elbow_flexor": 0.65, "elbow_extensor": 0.45}
PERIOD = 0.002  # s
SECONDS, REST = 16.0, 2.0


def regulated(rig: Rig) -> Rig:
    """The elbow with pressure regulators that overshoot, each by its own share."""
    for muscle in rig.muscles:
        valve = replace(
            muscle.valve, kind="pressure_regulator", full_scale=6e5, time_constant=TIME_CONSTANT,
            damping=DAMPING[muscle.name],
        )  # fmt: skip
        rig = rig.with_muscle(replace(muscle, valve=valve))
    return rig


def recorded(rig: Rig) -> Recording:
    """Random steps and sines of both set points, with the noise of ordinary sensors."""
    plant = Plant(PlantParameters.from_rig(rig), step=5e-4)
    random = np.random.default_rng(8)
    time = np.arange(round(SECONDS / PERIOD)) * PERIOD
    steps = random.uniform(-5e4, 5e4, (2, round(SECONDS / 0.4) + 1))
    held = steps[:, (time / 0.4).astype(int)]
    half = 6e4 * np.sin(2.0 * np.pi * 0.45 * time)
    moving = np.array([[half], [-half]])[:, 0] + held
    sent = (2.2e5 + moving * (time > REST)).T
    rows, shown = np.zeros((time.size, 3)), (0.0, 0.0, 0.0)
    for k in range(time.size):
        rows[k] = np.array(shown) + random.standard_normal(3) * (1.5e-4, 150.0, 150.0)
        shown = plant.step(sent[k].tolist(), PERIOD)
    begin = round(0.5 * REST / PERIOD)  # the fill from ambient is no part of it
    columns = {"joint_states.elbow.position": rows[begin:, 0]}
    for side, name in enumerate(rig.joints[0].muscles):
        columns[f"pressure_states.{name}"] = rows[begin:, 1 + side]
        columns[f"valve_commands.{name}"] = sent[begin:, side]
    return resample(from_columns(Path("regulators"), time[begin:], columns))


@pytest.fixture(scope="module")
def found(rig: Rig) -> Calibration:
    """From a rig file that says nothing of the damping, and a wrong time constant."""
    true = regulated(rig)
    written = rough(true)
    for muscle in written.muscles:
        unstated = replace(muscle, valve=replace(muscle.valve, damping=None))
        written = written.with_muscle(unstated)
    log = recorded(true)
    partial = PartialRig(written, {}, frozenset())
    return calibrate_joint(partial, 0, [log], [log], said=Said(1.0 / 3.0, 0.05))


def number(found: Calibration, key: str) -> CalibratedNumber:
    (one,) = [one for one in found.numbers if one.key == key]
    return one


@pytest.mark.parametrize("muscle", DAMPING)
def test_the_damping_that_no_data_sheet_states_is_found(found: Calibration, muscle: str) -> None:
    assert not found.refused
    damping = number(found, f"{muscle}.valve.damping")
    assert damping.status != KEPT
    assert damping.value == pytest.approx(DAMPING[muscle], rel=0.05)
    assert damping.low <= DAMPING[muscle] <= damping.high
    assert found.rig is not None
    assert found.rig.muscle(muscle).valve.damping == damping.value


@pytest.mark.parametrize("muscle", DAMPING)
def test_the_poles_are_found(found: Calibration, muscle: str) -> None:
    constant = number(found, f"{muscle}.valve.time_constant")
    assert constant.value == pytest.approx(TIME_CONSTANT, rel=0.05)
    assert constant.low <= TIME_CONSTANT <= constant.high
