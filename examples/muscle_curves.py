"""Draws the pull of a muscle against its length, at several pressures, by three models.

.venv/bin/python examples/muscle_curves.py
"""

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np

import pam_model

mpl.use("Agg")
from matplotlib import pyplot as plt

MODELS = {"chou_hannaford": {}, "schulte": {}, "tondu_lopez": {"k": 1.2}}
PRESSURES = (1e5, 3e5, 5e5)  # Pa gauge


def main(folder: Path) -> Path:
    """Write the picture and return its path."""
    geometry = pam_model.MuscleGeometry(thread_length=0.25, turns=2.0, rest_length=0.23)
    lengths = np.linspace(0.16, 0.23, 60)  # m
    figure, axes = plt.subplots(1, len(MODELS), sharey=True, figsize=(10, 4), layout="constrained")
    for ax, (name, constants) in zip(axes, MODELS.items(), strict=True):
        muscle = pam_model.create_force_model(name, geometry, constants)
        for pressure in PRESSURES:
            force = [muscle.force(pressure=pressure, length=length) for length in lengths]
            ax.plot(1e3 * lengths, force, label=f"{1e-5 * pressure:g} bar")
        ax.set(title=name, xlabel="length [mm]")
    axes[0].set_ylabel("pull [N]")
    axes[0].legend()
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "muscle_curves.png"
    figure.savefig(path)
    return path


if __name__ == "__main__":
    print(main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")))
