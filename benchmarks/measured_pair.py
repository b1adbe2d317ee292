"""Diagnose the measured pair of shut muscles in tests/data/closed_pair.

`python benchmarks/measured_pair.py --out out/measured_pair` converts the original columns to the
names and units of the suite's topics and runs `pam gap diagnose --shut` on them.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pandas as pd

from pam_gap.diagnosis_files import diagnose_files
from pam_model.argument_types import make_parents, output_folder
from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command
from pam_model.rig import load_rig

DATA = Path(__file__).parents[1] / "tests" / "data" / "closed_pair"


def contract_table(recording: Path, rig: Path) -> pd.DataFrame:
    """The original force, displacement [m] and pressures [kPa] as channels of the joint."""
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


def _declare(parser: Parser) -> None:
    parser.add_argument(
        "--out",
        type=output_folder,
        default="out/measured_pair",
        help="folder (default: %(default)s)",
    )


def _run(given: Arguments) -> Outcome:
    """Convert and diagnose."""
    table, rig = given.out / "recording.csv.gz", DATA / "rig.yaml"
    made = contract_table(DATA / "recording.csv.gz", rig)
    made.to_csv(make_parents(table), index=False, float_format="%.7g")
    answers = diagnose_files([], rig, given.out, shut=[table])
    for answer in answers:
        print(f"{answer.joint}: {answer.sentence}")
    return Outcome([answer.to_json() for answer in answers])


BENCH = Command("measured_pair", "diagnose the measured pair of shut muscles", _declare, _run)

if __name__ == "__main__":
    sys.exit(run_command(BENCH, "python benchmarks/measured_pair.py"))
