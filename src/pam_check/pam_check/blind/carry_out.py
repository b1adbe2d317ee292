"""Carries out a proposed experiment on the hidden rig of a sealed case, in a process of its own.

Run as `python -m pam_check.blind.carry_out`: reads the label to know the rig, writes a recording
and prints nothing, so that whoever asks learns what a bench would show and no more.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from pam_check.blind.cases import LABELS, to_table
from pam_check.blind.truth_plant import (
    Array,
    Sensors,
    TruthJoint,
    TruthMuscle,
    TruthRecording,
    run_truth,
)
from pam_check.blind.truth_plant import Excitation as TruthExcitation
from pam_gap.experiments.excitations import Excitation
from pam_gap.experiments.files import read_experiment
from pam_gap.recordings.recording import LOCKED, TURNED_OVER
from pam_model.errors import PamError

LOCKED_INERTIA = 1e9  # kg m^2
RECORDING = "recording.csv.gz"


def _mounted(joint: TruthJoint, mounting: str) -> TruthJoint:
    if mounting == TURNED_OVER:
        return joint._replace(gravity_angle=joint.gravity_angle + math.pi)
    if mounting == LOCKED:
        return joint._replace(inertia=LOCKED_INERTIA, gravity_torque=0.0)
    return joint


def carry_out(
    joint: TruthJoint,
    muscles: tuple[TruthMuscle, TruthMuscle],
    sensors: Sensors,
    excitation: Excitation,
    seed: int,
) -> TruthRecording:
    """Play an excitation on a true rig: under its loop, then with valve commands where it says so.

    Raises
    ------
    FloatingPointError
        When the rig diverges.
    """
    played = TruthExcitation(
        excitation.level,
        excitation.difference,
        excitation.position,
        excitation.sample_time,
        position_gain=excitation.position_gain,
    )
    mounted = _mounted(joint, excitation.mounting)
    recording = run_truth(mounted, muscles, played, sensors, np.random.default_rng(seed))
    opened = excitation.time >= excitation.open_from
    if not opened.any():
        return recording
    # The same noise again: up to where the valves are taken over, nothing differs.
    commands: Array = np.where(opened[:, None], excitation.open_commands, recording.commands)
    return run_truth(
        mounted, muscles, played, sensors, np.random.default_rng(seed), fixed_commands=commands
    )


def rig_of(label: dict[str, Any]) -> tuple[TruthJoint, tuple[TruthMuscle, TruthMuscle], Sensors]:
    """The hidden rig of a label."""
    first, second = (TruthMuscle(**entry) for entry in label["muscles"])
    return TruthJoint(**label["joint"]), (first, second), Sensors(**label["sensors"])


def main() -> int:
    """Write the recording of one case's experiment."""
    parser = argparse.ArgumentParser(
        prog="python -m pam_check.blind.carry_out", description=__doc__
    )
    parser.add_argument("--sealed", type=Path, required=True)
    parser.add_argument("--case", required=True)
    parser.add_argument("--experiment", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True, help="recording to write (.csv.gz)")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    labels = json.loads((arguments.sealed / LABELS).read_text())
    label = next((entry for entry in labels if entry["case"] == arguments.case), None)
    if label is None:
        raise PamError(f"{arguments.sealed}: no case {arguments.case}")
    joint, muscles, sensors = rig_of(label)
    excitation = read_experiment(arguments.experiment)
    made = carry_out(joint, muscles, sensors, excitation, arguments.seed)
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    to_table(made, bool(label["load_cells"])).to_csv(
        arguments.out, index=False, float_format="%.7g"
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
