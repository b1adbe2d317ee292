"""Fits two force models to measured points, and prints which one predicts better.

.venv/bin/python examples/fit_my_csv.py [TABLE.csv]

The table has the columns pressure [Pa], length [m] and force [N], and a block for each run, one of
which is held out at a time. Without a table, points of a muscle with conical ends are made up and
written to out/examples/my_muscle.csv.
"""

import sys
from pathlib import Path

import numpy as np

import pam_model

GEOMETRY = pam_model.MuscleGeometry(thread_length=0.25, turns=2.0, rest_length=0.23)


def make_points(path: Path) -> Path:
    """Write points as a tensile test bench would: a run for each pressure, with noise."""
    muscle = pam_model.create_force_model("tondu_lopez", GEOMETRY, {"k": 1.25})
    random = np.random.default_rng(1)
    lines = ["block,pressure,length,force"]
    for pressure in (1e5, 2e5, 3e5):
        for length in np.linspace(0.19, 0.228, 15):
            force = muscle.force(pressure=pressure, length=length) + random.normal(0.0, 2.0)
            lines.append(f"{pressure:.0f},{pressure:.0f},{length:.6f},{max(force, 0.0):.3f}")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n")
    return path


def main(table: Path) -> dict[str, float]:
    """The held-out error of each model [N]."""
    points = pam_model.load_measurements(table)
    errors = {}
    for name in ("chou_hannaford", "tondu_lopez"):
        result = pam_model.fit(name, points, GEOMETRY)
        print(result.table(), end="\n\n")
        errors[name] = result.held_out_error
    print(f"best: {min(errors, key=errors.__getitem__)}")
    return errors


if __name__ == "__main__":
    own = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    main(own or make_points(Path("out/examples/my_muscle.csv")))
