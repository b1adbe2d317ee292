"""Simulates an elbow with and without dry friction, and draws the difference.

.venv/bin/python examples/simulate_and_plot.py [RIG.yaml]
"""

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np

import pam_model

mpl.use("Agg")
from matplotlib import pyplot as plt

SAMPLE_TIME = 0.002  # s


def main(rig_file: str, folder: Path) -> float:
    """Write the picture; returns the largest difference of the angles [rad]."""
    rig = pam_model.load_rig(rig_file)
    ideal = pam_model.PlantParameters.from_rig(rig, joint=0)
    sticky = ideal.replaced({"coulomb_friction.torque": 0.4})
    time = np.arange(0.0, 4.0, SAMPLE_TIME)
    swing = 0.2 * np.sin(2.0 * np.pi * 0.5 * time)  # spool openings
    commands = np.stack([swing, -swing], axis=1)
    angles = []
    figure, ax = plt.subplots(layout="constrained")
    for label, plant in (("ideal", ideal), ("0.4 N m of dry friction", sticky)):
        start = pam_model.initial_state(plant, pressures=(2e5, 2e5))
        angle = pam_model.simulate(plant, commands, SAMPLE_TIME, start).position
        ax.plot(time, angle[: time.size], label=label)
        angles.append(angle)
    ax.set(xlabel="time [s]", ylabel="joint angle [rad]")
    ax.legend()
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "dry_friction.png")
    return float(np.abs(angles[0] - angles[1]).max())


if __name__ == "__main__":
    chosen = sys.argv[1] if len(sys.argv) > 1 else "config/elbow.yaml"
    print(f"largest difference: {main(chosen, Path('out/examples')):.3f} rad")
