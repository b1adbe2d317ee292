"""The proposed experiment as files: a trajectory, the matching stiffness and pressures, and facts.

`trajectory.yaml` is a trajectory_msgs/JointTrajectory for the controller. `commands.csv` holds the
stiffness [N m/rad] that keeps the wanted co-contraction, the resulting pressures [Pa gauge] of both
muscles and, where valve commands replace the pressure loop, these commands. `experiment.json` holds
the rest. docs/next_experiment.md describes how to play the files.
"""

from __future__ import annotations

import io
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from pam_gap.experiments.excitations import Excitation
from pam_model.joints.joint_statics import JointStatics
from pam_model.reading import read_text, reading
from pam_model.rig import Rig

FOLDER = "next_experiment"
POINTS_RATE = 20.0  # 1/s, of the trajectory's points
DETAILS, TRAJECTORY, COMMANDS = "experiment.json", "trajectory.yaml", "commands.csv"


def trajectory_message(joint: str, excitation: Excitation) -> dict[str, Any]:
    """A trajectory_msgs/JointTrajectory as plain data, from the start to the end of the loop."""
    end = min(excitation.duration, excitation.open_from)
    times = np.linspace(0.0, end, round(end * POINTS_RATE) + 1)
    velocity = np.gradient(excitation.position, excitation.sample_time)
    acceleration = np.gradient(velocity, excitation.sample_time)
    columns = [
        np.interp(times, excitation.time, values)
        for values in (excitation.position, velocity, acceleration)
    ]
    points = []
    for k, time in enumerate(times.tolist()):
        at_rest = k in (0, times.size - 1)
        q, v, a = (float(column[k]) for column in columns)
        whole = int(time)
        points.append(
            {
                "positions": [round(q, 6)],
                "velocities": [0.0 if at_rest else round(v, 6)],
                "accelerations": [0.0 if at_rest else round(a, 5)],
                "time_from_start": {"sec": whole, "nanosec": round((time - whole) * 1e9)},
            }
        )
    return {"joint_names": [joint], "points": points}


def commands_table(rig: Rig, joint: int, excitation: Excitation) -> pd.DataFrame:
    """Time, position, stiffness, pressures and valve commands at the excitation's rate."""
    entry = rig.joints[joint]
    statics = JointStatics.from_rig(rig, entry.name)
    first = excitation.level + excitation.difference
    second = excitation.level - excitation.difference
    every = max(1, round(1.0 / (POINTS_RATE * excitation.sample_time)))
    at = np.unique(np.append(np.arange(0, first.size, every), first.size - 1))
    stiffness = [
        statics.stiffness((max(float(first[k]), 0.0), max(float(second[k]), 0.0)),
                          float(excitation.position[k]))
        for k in at.tolist()
    ]  # fmt: skip
    opened = excitation.time >= excitation.open_from
    table = {
        "time": excitation.time,
        "position": excitation.position,
        "stiffness": np.interp(excitation.time, excitation.time[at], stiffness),
        f"pressure.{entry.agonist}": first,
        f"pressure.{entry.antagonist}": second,
    }
    if opened.any():
        for muscle, command in zip(entry.muscles, excitation.open_commands, strict=True):
            table[f"valve_commands.{muscle}"] = np.where(opened, command, np.nan)
    return pd.DataFrame(table)


def write_experiment(
    folder: Path, rig: Rig, joint: int, excitation: Excitation, facts: dict[str, Any]
) -> None:
    """Write an excitation and what is needed to play it to a folder.

    Parameters
    ----------
    folder : Path
        It is created if it does not exist.
    rig, joint : Rig, int
        The rig, and the number of the joint that moves.
    facts : dict
        Further entries of experiment.json.
    """
    folder.mkdir(parents=True, exist_ok=True)
    name = rig.joints[joint].name
    details = {
        "name": excitation.name,
        "instruction": excitation.instruction,
        "joint": name,
        "mounting": excitation.mounting,
        "sample_time": excitation.sample_time,
        "duration": excitation.duration,
        "position_gain": excitation.position_gain,
        "open_from": None if math.isinf(excitation.open_from) else excitation.open_from,
        "open_commands": list(excitation.open_commands),
    }
    (folder / DETAILS).write_text(json.dumps(details | facts, indent=1) + "\n", encoding="utf-8")
    message = trajectory_message(name, excitation)
    (folder / TRAJECTORY).write_text(
        yaml.safe_dump(message, sort_keys=False, default_flow_style=None), encoding="utf-8"
    )
    commands_table(rig, joint, excitation).to_csv(
        folder / COMMANDS, index=False, float_format="%.6g"
    )


def read_experiment(folder: Path) -> Excitation:
    """Read the files that `write_experiment` has written.

    Raises
    ------
    PamError
        When a file is missing or does not have the expected content.
    """
    with reading(folder, f"a proposed experiment of a diagnosis, {DETAILS} and {COMMANDS}"):
        details = json.loads(read_text(folder / DETAILS))
        table = pd.read_csv(io.StringIO(read_text(folder / COMMANDS)))
        # `commands_table` writes the agonist's pressure before the antagonist's.
        agonist_name, antagonist_name = (c for c in table.columns if c.startswith("pressure."))
        agonist, antagonist = (table[c].to_numpy(float) for c in (agonist_name, antagonist_name))
        count = len(table)
        return Excitation(
            str(details["name"]),
            str(details["instruction"]),
            float(details["sample_time"]) * np.arange(count, dtype=np.float64),
            table["position"].to_numpy(float),
            0.5 * (agonist + antagonist),
            0.5 * (agonist - antagonist),
            float(details["position_gain"]),
            math.inf if details["open_from"] is None else float(details["open_from"]),
            (float(details["open_commands"][0]), float(details["open_commands"][1])),
            str(details["mounting"]),
        )
