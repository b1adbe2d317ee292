"""Public logs that cannot be part of this repository, read from clones of theirs.

Two of the three origins state no licence, so that their data may be read but not passed on. What
is assumed of a log because its origin does not state it is written down here.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd
import yaml

from pam_model.errors import PamError
from pam_model.identify.compare import compare
from pam_model.identify.measurements import load_measurements
from pam_model.muscles.force_model import MuscleGeometry
from pam_model.rig.from_datasheet import BraidFromDatasheet

Array = npt.NDArray[np.float64]

BENCH = Path("Muscle_Sensory", "BPA_Static_Characterization_Test", "10mmData_Nov2022")
ARM = Path("Pamy_OCO", "excitation signals", "response_pamy2_dof_0_amp_3.5.txt")
REGULATOR = Path("softbot_pneumatic_driver", "experiments", "2026-01")

TESTS = (8, 9, 10)
OF_20_CM = {"Unkink": 0.182, "kinked25": 0.1745, "kinked50": 0.167, "kinked75": 0.1595}
OF_15_CM = {"Unkink": 0.132, "kinked25": 0.12675, "kinked50": 0.1215, "kinked75": 0.11625}
"""Lengths at which the muscles were held [m], by the origin's names for them."""
SLACK = 8.7354
"""What the load cell shows less where a muscle is slack, which pulls with 0 N [N]."""
SIZE = "DMSP-10"
MODELS = ("sarosi", "hunt_sigmoid", "wickramatunge")
RISING, FALLING = 1, 2
THINNED = 25
"""One point of so many is compared, since neighbours at 1 kHz say the same."""
ARM_UNIT = 10.0
"""Pa per unit of the arm's pressures; an assumption, the origin states none."""
MUSCLE = "m10"


Prepared = tuple[list[Path], Path, Path | None]
"""Recordings, rig file, and map of a log."""


def bench_table(clones: Path, name: str) -> Array:
    """One recording of the bench: force [N], pressure [kPa], time [s], 1 rising or 2 falling."""
    path = clones / BENCH / f"10mm_{name}.csv"
    try:
        rows: Array = np.loadtxt(path, delimiter=",")
    except OSError:
        raise PamError(f"{path}: not found; expected a clone of Muscle_Sensory") from None
    rows = rows[np.diff(rows[:, 2], prepend=-1.0) > 0.0]
    rows[:, 0] += SLACK
    return rows


def bench_rig(path: Path, rest_length: float, valve: str = "flow") -> Path:
    """The rig file of one Festo muscle of 10 mm: what its data sheet and a tape measure give."""
    braid = BraidFromDatasheet.of_size(SIZE, rest_length)
    tree = {
        "gas": {"temperature": 293.15, "ambient_pressure": 101325.0, "polytropic_exponent": 1.0},
        "supply_pressure": 801325.0,
        "parameter_tolerance": 0.1,
        "length_tolerance": 0.02,
        "joints": [],
        "bench_muscles": [MUSCLE],
        MUSCLE: {
            "model": "chou_hannaford",
            "thread_length": braid.thread_length,
            "turns": braid.turns,
            "wall_thickness": 0.0,
            "rest_length": rest_length,
            "neutral_length": rest_length,
            "dead_volume": 2e-5,
            "max_pressure": 8e5,
            "board": 0,
            "channel": 0,
            "valve": {
                "kind": valve,
                "sonic_conductance": 4e-9,
                "critical_ratio": 0.3,
                "time_constant": 0.005,
            },
        },
    }
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": tree}}), encoding="utf-8")
    return path


def held_muscle(clones: Path, out: Path) -> Prepared:
    """A Festo muscle of 10 mm, held at four lengths, each three times."""
    tables = []
    for held, length in OF_20_CM.items():
        for test in TESTS:
            rows = bench_table(clones, f"20cm_{held}_Test{test}")
            tables.append(out / f"{held}_{test}.csv")
            pd.DataFrame(
                {
                    "time": rows[:, 2],
                    f"pressure_states.{MUSCLE}": 1e3 * rows[:, 1],
                    f"muscle_states.{MUSCLE}.effort": rows[:, 0],
                    f"muscle_states.{MUSCLE}.position": length,
                }
            ).to_csv(tables[-1], index=False)
    return tables, bench_rig(out / "rig.yaml", OF_20_CM["Unkink"]), None


def arm_table(clones: Path) -> pd.DataFrame:
    """The arm's joint: time [s], commands and pressures in units of its own, and angle [rad]."""
    path = clones / ARM
    try:
        numbers = np.loadtxt(path)
    except OSError:
        raise PamError(f"{path}: not found; expected a clone of Pamy_OCO") from None
    columns = ("time", "excitation", "des_ago", "des_ant", "obs_ago", "obs_ant", "position")
    values = numbers[3:].reshape(len(columns), -1)  # three lines of counts, then block by block
    return pd.DataFrame(dict(zip(columns, values, strict=True)))


def as_channels(
    table: pd.DataFrame, joint: str, muscles: tuple[str, str], sign: float
) -> pd.DataFrame:
    """The arm's table with the channels of the rig contract, and this sign of the angle."""
    found = {"time": table["time"], f"joint_states.{joint}.position": sign * table["position"]}
    for muscle, side in zip(muscles, ("ago", "ant"), strict=True):
        found[f"pressure_states.{muscle}"] = ARM_UNIT * table[f"obs_{side}"]
        found[f"valve_commands.{muscle}"] = ARM_UNIT * table[f"des_{side}"]
    return pd.DataFrame(found)


def regulator(clones: Path, out: Path) -> Prepared:
    """The pressure regulator of a soft robot, with 50 samples a second."""
    tables = sorted((clones / REGULATOR).glob("sweep_kp_*.csv"))
    if not tables:
        raise PamError(f"{clones / REGULATOR}: no sweep_kp_*.csv; expected a clone")
    column_map = out / "map.yaml"
    column_map.write_text(
        "time: {column: Time, unit: s}\nchannels:\n"
        f"  pressure_states.{MUSCLE}: {{column: Pressure, unit: kPa}}\n"
        f"  valve_commands.{MUSCLE}: {{column: Target, unit: kPa}}\n",
        encoding="utf-8",
    )
    rig = bench_rig(out / "rig.yaml", OF_20_CM["Unkink"], "pressure_regulator")
    return tables, rig, column_map


def held_out_errors(clones: Path, out: Path) -> str:
    """Held-out errors of the force models on the muscle of 15 cm, in words."""
    rows = []
    for held, length in OF_15_CM.items():
        for test in TESTS:
            table = bench_table(clones, f"15cm_{held}_Test{test}")
            for direction, name in ((RISING, "rising"), (FALLING, "falling")):
                part = table[table[:, 3] == direction][::THINNED]
                rows += [
                    (test, name, length, 1e3 * pressure, force - SLACK)  # as it was recorded
                    for force, pressure in part[:, :2].tolist()
                ]
    path = out / "points.csv"
    columns = ["block", "branch", "length", "pressure", "force"]
    points = pd.DataFrame(rows, columns=columns)
    points.to_csv(path, index=False)
    rest = OF_15_CM["Unkink"]
    braid = BraidFromDatasheet.of_size(SIZE, rest)
    geometry = MuscleGeometry(braid.thread_length, braid.turns, rest)
    found = compare(load_measurements(path), MODELS, geometry)
    texts = []
    for branch in found:
        part = points[points["branch"] == branch.branch]
        errors = [f"{row.fit.model} {row.fit.held_out_error:.1f} N" for row in branch.ranking]
        errors.append(f"a polynomial with P^2 {polynomial_error(part, rest):.1f} N")
        texts.append(f"{branch.branch}: {', '.join(errors)}")
    return "; ".join(texts)


def polynomial_error(points: pd.DataFrame, rest_length: float) -> float:
    """Held-out error of a polynomial in pressure and contraction that knows no muscle [N].

    Its terms are those of P^0 to P^2 with contractions up to the first power, and of P^0 and P^1
    with its square.
    """
    pressure = 1e-5 * points["pressure"].to_numpy()
    contraction = 1.0 - points["length"].to_numpy() / rest_length
    powers = ((0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1), (0, 2), (1, 2))
    terms = np.column_stack([pressure**a * contraction**b for a, b in powers])
    force, block = points["force"].to_numpy(), points["block"].to_numpy()
    errors = np.zeros(len(points))
    for held_out in np.unique(block):
        rest = block != held_out
        numbers = np.linalg.lstsq(terms[rest], force[rest], rcond=None)[0]
        errors[~rest] = terms[~rest] @ numbers - force[~rest]
    return float(np.sqrt(np.mean(errors**2)))
