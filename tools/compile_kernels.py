"""Compile the controller, the simulated joint and robot, and the predictions of one joint.

Usage: ``.venv/bin/python tools/compile_kernels.py``. numba keeps the machine code on disk. Without
this, the first simulation, the first diagnosis and the first tests, each in two processes at once,
wait for it. Each processor compiles one of them at a time.
"""

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from pam_control.controller import Controller
from pam_control.settings import ControlSettings
from pam_gap.prediction.channel_order import N_CHANNELS
from pam_gap.prediction.observer import observe
from pam_model.plant.constants import derive_constants
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.robot_plant import RobotPlant
from pam_model.plant.sensors import sensor_constants
from pam_model.plant.simulate import Plant, initial_state
from pam_model.rig import load_rig

RIG = Path(__file__).resolve().parents[1] / "config/elbow.yaml"
STEP = 1e-3  # s


def controller() -> None:
    """Compile the control cycle."""
    Controller(load_rig(RIG), ControlSettings())


def joint() -> None:
    """Compile the plant of one joint, and of a joint that is a robot by itself."""
    parameters = PlantParameters.from_rig(load_rig(RIG))
    Plant(parameters).step((0.0, 0.0), STEP)


def robot() -> None:
    """Compile the plant of several joints."""
    parameters = PlantParameters.from_rig(load_rig(RIG))
    RobotPlant([parameters] * 2).step([(0.0, 0.0)] * 2, STEP)


def predictions() -> None:
    """Compile what predicts a recording."""
    parameters = PlantParameters.from_rig(load_rig(RIG))
    observe(
        derive_constants(parameters.values)[None],
        sensor_constants(parameters.values)[None],
        tuple(map(np.ascontiguousarray, parameters.tables)),
        np.zeros((2, 2)),
        np.zeros((2, N_CHANNELS)),
        np.ones((2, N_CHANNELS), dtype=bool),
        initial_state(parameters)[None],
        sample_time=STEP,
        step=STEP,
        horizon=np.inf,
        kernels=(),
    )


def call(compile_it: Callable[[], None]) -> None:
    """Call it, in another process."""
    compile_it()


def main() -> None:
    """Call each kernel once, those that take longest first."""
    with ProcessPoolExecutor() as pool:
        list(pool.map(call, (robot, predictions, joint, controller)))


if __name__ == "__main__":
    main()
