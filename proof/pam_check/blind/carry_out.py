"""Runs a proposed experiment on the hidden rig of a sealed case, in a separate process.

Run as `python -m pam_check.blind.carry_out`. It reads the label to know the rig, writes a recording
and prints nothing, so that the caller gets no more information than a test bench would give.
"""

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take time
    from pam_model.program_signals import end_at_signals

    end_at_signals()

import json
import math
from typing import Any

import numpy as np

from pam_check.blind.cases import LABELS, to_table
from pam_check.blind.plants import FIRST, PLANTS
from pam_check.blind.truth_plant import (
    Array,
    PressureExcitation,
    Sensors,
    TruthJoint,
    TruthMuscle,
    TruthRecording,
)
from pam_gap.experiments.excitations import Excitation
from pam_gap.experiments.files import read_experiment
from pam_gap.recordings.recording import LOCKED, TURNED_OVER
from pam_model.argument_types import count, input_folder, make_parents, output_file
from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command
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
    plant: str = FIRST,
) -> TruthRecording:
    """Play an excitation on a true rig: in closed loop, then with its valve commands if it has any.

    Raises
    ------
    FloatingPointError
        When the rig diverges.
    """
    played = PressureExcitation(
        excitation.level,
        excitation.difference,
        excitation.position,
        excitation.sample_time,
        position_gain=excitation.position_gain,
    )
    mounted, run = _mounted(joint, excitation.mounting), PLANTS[plant]
    recording = run(mounted, muscles, played, sensors, np.random.default_rng(seed))
    opened = excitation.time >= excitation.open_from
    if not opened.any():
        return recording
    # The same noise again, so that nothing differs until the direct valve commands begin.
    commands: Array = np.where(opened[:, None], excitation.open_commands, recording.commands)
    return run(
        mounted, muscles, played, sensors, np.random.default_rng(seed), fixed_commands=commands
    )


def rig_of(label: dict[str, Any]) -> tuple[TruthJoint, tuple[TruthMuscle, TruthMuscle], Sensors]:
    """The hidden rig of a label."""
    first, second = (TruthMuscle(**entry) for entry in label["muscles"])
    return TruthJoint(**label["joint"]), (first, second), Sensors(**label["sensors"])


def _declare(parser: Parser) -> None:
    parser.add_argument("--sealed", type=input_folder, required=True, help="folder of the campaign")
    parser.add_argument("--case", required=True, help="name of the case")
    parser.add_argument(
        "--experiment", type=input_folder, required=True, help="file of the proposed experiment"
    )
    parser.add_argument(
        "--out", type=output_file, required=True, help="recording to write (.csv.gz)"
    )
    parser.add_argument("--seed", type=count(0), default=1, metavar="N", help="seed of the noise")
    parser.add_argument(
        "--plant", choices=list(PLANTS), default=FIRST, help="plant that made the case"
    )


def _run(given: Arguments) -> Outcome:
    labels = json.loads((given.sealed / LABELS).read_text())
    label = next((entry for entry in labels if entry["case"] == given.case), None)
    if label is None:
        raise PamError(f"{given.sealed}: no case {given.case}")
    joint, muscles, sensors = rig_of(label)
    excitation = read_experiment(given.experiment)
    made = carry_out(joint, muscles, sensors, excitation, given.seed, given.plant)
    table = to_table(made, bool(label["load_cells"]))
    table.to_csv(make_parents(given.out), index=False, float_format="%.7g")
    return Outcome({"recording": given.out})


def main() -> int:
    """Write the recording of one case's experiment."""
    command = Command("carry_out", "run a proposed experiment on a hidden rig", _declare, _run)
    return run_command(command, "python -m pam_check.blind.carry_out")


if __name__ == "__main__":
    raise SystemExit(main())
