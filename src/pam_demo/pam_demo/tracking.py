"""How closely a joint followed the demo's motions, from the recording of a run."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from scipy.interpolate import BPoly

from pam_demo.motions import DemoMotion, Window, all_motions
from pam_demo.recording import Array, Series, read_series
from pam_model.errors import PamError

MEASURED, TRUE = "/joint_states.position.{}", "/ground_truth/joint_states.position.{}"
"""Angles in a recording, with the place of the joint's name."""


def asked_position(motion: DemoMotion, times: Array) -> Array:
    """Reference position [rad] of a motion at `times` [s from its first waypoint]."""
    if motion.streamed:
        index = np.searchsorted(motion.times, times, side="right") - 1
        return motion.positions[np.clip(index, 0, len(motion.times) - 1)]
    knots = np.stack([motion.positions, motion.velocities, motion.accelerations], axis=1)
    knots[[0, -1], 1:] = 0.0
    spline = BPoly.from_derivatives(motion.times, knots)
    return np.asarray(spline(np.clip(times, motion.times[0], motion.times[-1])))


@dataclass(frozen=True, slots=True)
class FollowedAngle:
    """An angle of the joint during a motion, beside the reference."""

    motion: DemoMotion  # the commanded motion
    # times, asked, angle: shape (n,): time from the first waypoint [s], reference and angle [rad]
    times: Array
    asked: Array
    angle: Array

    @classmethod
    def of(cls, motion: DemoMotion, series: Series) -> Self:
        """An angle that was recorded during the motion."""
        asked = asked_position(motion, series.times)
        return cls(motion, series.times, asked, series.values)

    @property
    def error(self) -> Array:
        """Reference minus angle [rad]."""
        return self.asked - self.angle

    def rms(self, windows: tuple[Window, ...] | None = None) -> float:
        """Root mean square of the error inside any of the windows, or of all of it [rad]."""
        inside = np.full(len(self.times), windows is None)
        for window in windows or ():
            inside |= (self.times >= window.start) & (self.times <= window.end)
        return float(np.sqrt(np.mean(self.error[inside] ** 2)))


@dataclass(frozen=True, slots=True)
class TrackedMotion:
    """One motion of the demo as the joint performed it."""

    measured: FollowedAngle  # by the sensor
    true: FollowedAngle  # by the plant itself


@dataclass(frozen=True, slots=True)
class ClosedLoopFigure:
    """RMS tracking error of one motion before and after [rad]."""

    motion: str
    before: float
    after: float
    true_before: float
    true_after: float


def tracked_motions(folder: Path, joint: str) -> list[TrackedMotion]:
    """Read the motions of a joint from a demo's folder.

    Raises
    ------
    PamError
        When its recording lacks a topic or cannot be read.
    """
    runs: list[dict[str, Any]] = json.loads((folder / "runs.json").read_text())
    motions: Mapping[str, DemoMotion] = {motion.name: motion for motion in all_motions()}
    angles = [angle.format(joint) for angle in (MEASURED, TRUE)]
    data = read_series(folder / "bag", angles)
    for angle in angles:
        if angle not in data:
            raise PamError(f"{folder / 'bag'}: nothing was recorded of {angle}")
    found = []
    for run in runs:
        motion = motions[run["motion"]]
        measured, true = (
            FollowedAngle.of(motion, data[angle].during(run["start"], motion.duration))
            for angle in angles
        )
        found.append(TrackedMotion(measured, true))
    return found
