"""How strong a hidden effect is: its RMS change of the gap between a rig and its rig file.

The gap is the error of the simulation by the rig file as it is written, numbers that are wrong
within their tolerance included, because that is what the owner of a rig sees. The strength is the
RMS change of this error over the RMS error that the rig has without the effect, in the channel
where this ratio is largest. Both rigs get the same valve commands and the same noise.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pam_check.blind.truth_plant import Array, TruthRecording
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import RawChannel, RawRecording
from pam_gap.recordings.resample import resample
from pam_model.rig import Rig


def channels(recording: TruthRecording) -> dict[str, Array]:
    """Commands and measurements by the names that a recording uses, with the time [s]."""
    return {
        "time": recording.time,
        "valve_commands.elbow_flexor": recording.commands[:, 0],
        "valve_commands.elbow_extensor": recording.commands[:, 1],
        "pressure_states.elbow_flexor": recording.pressures[:, 0],
        "pressure_states.elbow_extensor": recording.pressures[:, 1],
        "joint_states.elbow.position": recording.position,
    }


def gap(written: Rig, logged: Mapping[str, Array]) -> Array:
    """Errors of the simulation by a rig file, NaN where it does not count, shape (n, channels).

    Parameters
    ----------
    written : Rig
        The rig as its file has it.
    logged : mapping of str to ndarray
        From `channels`.
    """
    time = logged["time"]
    raw = RawRecording(
        Path("drawn"),
        {name: RawChannel(time, values) for name, values in logged.items() if name != "time"},
        one_clock=True,
    )
    problem = PredictionProblem(written, 0, [resample(raw)])
    errors: Array = problem.errors(problem.base.values[None])[0]
    return np.where(problem.counted[:, None], errors, np.nan)[:, problem.present]


def strength(affected: Array, usual: Array) -> float:
    """Strength of what makes one gap from another one; both from `gap`."""
    change = np.sqrt(np.nanmean((affected - usual) ** 2, axis=0))
    return float(np.max(change / np.sqrt(np.nanmean(usual**2, axis=0))))
