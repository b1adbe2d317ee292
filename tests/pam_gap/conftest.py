"""A short recording of a simulated elbow, made by the plant that the diagnosis fits."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pam_gap.recordings.recording import Recording
from pam_model.plant.layout import C_EXTERNAL
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import Plant
from pam_model.plant.uneven_pulley import UnevenPulley
from pam_model.rig import Rig, load_rig

SAMPLE_TIME = 0.004
Maker = Callable[..., Recording]


@pytest.fixture(scope="session")
def rig() -> Rig:
    config = Path(__file__).parents[2] / "config" / "elbow.yaml"
    return replace(load_rig(config), parameter_tolerance=0.0)


@pytest.fixture(scope="session")
def record(rig: Rig) -> Maker:
    """Returns a function of the plant's changed parameters that gives a recording."""

    def make(
        changes: Mapping[str, float] | None = None,
        *,
        duration: float = 14.0,
        cells: bool = False,
        pushed: Callable[[float], float] | None = None,
        arm: UnevenPulley | None = None,
    ) -> Recording:
        parameters = PlantParameters.from_rig(rig).forced(changes or {})
        plant = Plant(parameters, step=1e-3)
        if arm is not None:
            constants = np.array(plant._constants)[None]
            arm.apply(constants)
            plant._constants[:] = constants[0]
        time = np.arange(round(duration / SAMPLE_TIME)) * SAMPLE_TIME
        mean = 2.2e5 + 8e4 * np.sign(np.sin(2 * np.pi * time / 5.0))
        half = 7e4 * np.sin(2 * np.pi * 0.45 * time) + 3e4 * np.sign(np.sin(2 * np.pi * time / 3.7))
        half *= np.clip(time - 0.5, 0.0, 1.0)
        wanted = np.stack([mean + half, mean - half], axis=1)
        random = np.random.default_rng(5)
        rows, sent = np.zeros((time.size, 5)), np.zeros((time.size, 2))
        shown = (0.0, 0.0, 0.0)
        for k in range(time.size):
            output = plant.output
            rows[k] = (*shown[1:], shown[0], output["agonist.force"], output["antagonist.force"])
            rows[k] += random.standard_normal(5) * (150.0, 150.0, 1.5e-4, 1.0, 1.0)
            if pushed is not None:  # a torque from outside as a function of the angle
                plant._constants[C_EXTERNAL] = pushed(shown[0])
            sent[k] = np.clip(6e-6 * (wanted[k] - rows[k, :2]), -1.0, 1.0)
            shown = plant.step(sent[k].tolist(), SAMPLE_TIME)
        cut = round(1.5 / SAMPLE_TIME)  # the fill from ambient is no part of it
        first, second = rig.joints[0].muscles
        channels = {
            f"valve_commands.{first}": sent[cut:, 0],
            f"valve_commands.{second}": sent[cut:, 1],
            f"pressure_states.{first}": rows[cut:, 0],
            f"pressure_states.{second}": rows[cut:, 1],
            f"joint_states.{rig.joints[0].name}.position": rows[cut:, 2],
        }
        if cells:
            channels[f"muscle_states.{first}.effort"] = rows[cut:, 3]
            channels[f"muscle_states.{second}.effort"] = rows[cut:, 4]
        valid = {name: np.ones(time.size - cut, dtype=np.bool_) for name in channels}
        return Recording(
            Path("simulated"), SAMPLE_TIME, time[: time.size - cut], channels, valid, ()
        )

    return make
