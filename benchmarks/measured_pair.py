"""Diagnose the measured pair of shut muscles in tests/data/closed_pair.

`python benchmarks/measured_pair.py --out out/measured_pair` writes the origin's columns under the
contract's names and units and runs `python -m pam_gap diagnose --shut` on them.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from pam_gap.__main__ import main as pam_gap
from pam_model.rig import load_rig

DATA = Path(__file__).parents[1] / "tests" / "data" / "closed_pair"


def contract_table(recording: Path, rig: Path) -> pd.DataFrame:
    """The origin's force, displacement [m] and pressures [kPa] as channels of the joint."""
    joint = load_rig(rig).joints[0]
    table = pd.read_csv(recording)
    return pd.DataFrame(
        {
            "time": table["time_s"],
            f"pressure_states.{joint.agonist}": 1e3 * table["pressure_1_kPa"],
            f"pressure_states.{joint.antagonist}": 1e3 * table["pressure_2_kPa"],
            f"joint_states.{joint.name}.position": table["displacement_m"] / joint.pulley_radius,
            f"joint_states.{joint.name}.effort": table["motor_force_N"] * joint.pulley_radius,
        }
    )


def main() -> int:
    """Convert and diagnose; the exit code of the diagnosis."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/measured_pair"))
    out: Path = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    table, rig = out / "recording.csv.gz", DATA / "rig.yaml"
    contract_table(DATA / "recording.csv.gz", rig).to_csv(table, index=False, float_format="%.7g")
    return pam_gap(
        ["diagnose", "--shut", str(table), "--rig", str(rig), "--out", str(out), "--no-progress"]
    )


if __name__ == "__main__":
    raise SystemExit(main())
