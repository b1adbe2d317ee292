"""Tracking errors of the demo's motions, from the recording of a run."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pam_demo.figures import asked_position
from pam_demo.motions import DemoMotion, all_motions
from pam_demo.recording import read_recording
from pam_model.errors import PamError

Array = npt.NDArray[np.float64]

MEASURED, TRUE = "/joint_states", "/ground_truth/joint_states"


@dataclass(frozen=True, slots=True)
class TrackedMotion:
    """One motion of the demo as the joint performed it.

    Attributes
    ----------
    name, title : str
        Name and title of the motion.
    times, asked, measured : array, shape (n,)
        Time from the first waypoint [s], reference [rad], position measured by the sensor [rad].
    true_times, true : array, shape (m,)
        Time [s] and true position of the plant [rad].
    """

    name: str
    title: str
    times: Array
    asked: Array
    measured: Array
    true_times: Array
    true: Array
    true_asked: Array

    @property
    def error(self) -> Array:
        """Reference minus measured position [rad]."""
        return self.asked - self.measured

    @property
    def rms(self) -> float:
        """RMS of the measured error [rad]."""
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def true_rms(self) -> float:
        """RMS error of the true position [rad]."""
        return float(np.sqrt(np.mean((self.true_asked - self.true) ** 2)))


@dataclass(frozen=True, slots=True)
class ClosedLoopFigure:
    """RMS tracking error of one motion before and after [rad]."""

    motion: str
    before: float
    after: float
    true_before: float
    true_after: float


def tracked_motions(folder: Path) -> list[TrackedMotion]:
    """Read the motions from a demo's folder.

    Raises
    ------
    PamError
        When its recording lacks a topic or cannot be read.
    """
    runs: list[dict[str, Any]] = json.loads((folder / "runs.json").read_text())
    motions: Mapping[str, DemoMotion] = {motion.name: motion for motion in all_motions()}
    data = read_recording(folder / "bag")
    for topic in (MEASURED, TRUE):
        if topic not in data:
            raise PamError(f"{folder / 'bag'}: nothing was recorded on {topic}")
    found = []
    for run in runs:
        motion = motions[run["motion"]]
        window = run["start"], run["start"] + motion.duration
        measured, true = data[MEASURED].between(*window), data[TRUE].between(*window)
        times, true_times = measured.times - run["start"], true.times - run["start"]
        found.append(
            TrackedMotion(
                motion.name,
                motion.title,
                times,
                asked_position(motion, times),
                measured.values[:, 0],
                true_times,
                true.values[:, 0],
                asked_position(motion, true_times),
            )
        )
    return found
