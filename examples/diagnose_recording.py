"""Finds out why a recording differs from the rig file, and writes an improved rig file.

.venv/bin/python examples/diagnose_recording.py [RECORDING RIG.yaml]

A recording is a rosbag2, a CSV or a Parquet file. Without one, 14 s of an elbow with hidden dry
friction are simulated and written to out/examples/recording.csv.
"""

import sys
from pathlib import Path

import numpy as np

import pam_gap
import pam_model

RIG = "config/elbow.yaml"
SAMPLE_TIME = 0.004  # s


def make_recording(path: Path) -> Path:
    """Simulate an elbow whose valves follow moving pressures, and write what its sensors show."""
    rig = pam_model.load_rig(RIG)
    parameters = pam_model.PlantParameters.from_rig(rig)
    plant = pam_model.Plant(parameters.replaced({"coulomb_friction.torque": 0.6}), step=1e-3)
    first, second = rig.joints[0].muscles
    names = ["time"] + [f"valve_commands.{muscle}" for muscle in (first, second)]
    names += [f"pressure_states.{muscle}" for muscle in (first, second)]
    names += [f"joint_states.{rig.joints[0].name}.position"]
    random = np.random.default_rng(5)
    rows = []
    position = a = b = 0.0
    for time in np.arange(0.0, 14.0, SAMPLE_TIME):
        mean = 2.2e5 + 8e4 * np.sign(np.sin(2 * np.pi * time / 5.0))
        swing = 7e4 * np.sin(2 * np.pi * 0.45 * time) + 3e4 * np.sign(
            np.sin(2 * np.pi * time / 3.7)
        )
        noise = random.standard_normal(3) * (150.0, 150.0, 1.5e-4)
        shown = np.array([a, b, position]) + noise
        wanted = np.array([mean + swing, mean - swing])
        commands = np.clip(6e-6 * (wanted - shown[:2]), -1.0, 1.0)
        rows.append([time, *commands, *shown])
        position, a, b = plant.step(commands.tolist(), SAMPLE_TIME)
    path.parent.mkdir(parents=True, exist_ok=True)
    filled = np.array(rows)[round(1.5 / SAMPLE_TIME) :]  # without the filling from ambient
    np.savetxt(path, filled, delimiter=",", header=",".join(names), comments="", fmt="%.9g")
    return path


def main(recording_file: Path, rig_file: str, folder: Path) -> list[str]:
    """Print the verdict of each joint; returns the effects that are named."""
    rig = pam_model.load_rig(rig_file)
    recording = pam_gap.import_recording(recording_file)
    named: list[str] = []
    for answer in pam_gap.diagnose(recording, rig):
        print(f"{answer.joint}: {answer.verdict}: {answer.sentence}")
        named += answer.effects
        if answer.improved is not None:
            pam_model.save_rig(answer.improved, folder / "improved.yaml")
            print(f"written: {folder / 'improved.yaml'}")
    return named


if __name__ == "__main__":
    out = Path("out/examples")
    if len(sys.argv) > 2:
        main(Path(sys.argv[1]), sys.argv[2], out)
    else:
        main(make_recording(out / "recording.csv"), RIG, out)
