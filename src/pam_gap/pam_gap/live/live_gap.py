"""The gap of a running rig over the last few seconds, computed without ROS."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from pam_gap.prediction.channel_order import BOTH_PRESSURES, POSITION, UNITS
from pam_gap.prediction.fit import mean_squares
from pam_gap.prediction.gap_figures import HORIZONS, noise_level
from pam_gap.prediction.problem import PredictionProblem, PredictionSettings
from pam_gap.recordings.recording import (
    COMMANDS,
    JOINTS,
    PRESSURES,
    RawChannel,
    RawRecording,
    RecordingError,
)
from pam_gap.recordings.resample import resample
from pam_gap.rules import DEFAULT
from pam_model.rig import Rig

SHORTEST = DEFAULT.prediction.settling + 1.0  # s, of a window that can be judged
TIGHT = 0.01  # s, horizon with which pressures follow the measured ones
WATCHED = HORIZONS[:2]
LARGEST: Final = 1e12  # Pa or rad; no sensor shows more, and the square of 1e308 is no number
MOST_KEPT = 100_000
"""Largest number of samples kept for a channel, even if their stamps do not advance."""


@dataclass(frozen=True, slots=True)
class ChannelFigure:
    """RMS prediction error of a channel over one horizon, and the error due to noise alone."""

    channel: str
    horizon: str
    unit: str
    error: float
    floor: float


@dataclass(frozen=True, slots=True)
class LiveGap:
    """The gap of one joint."""

    joint: str  # name of the joint
    figures: tuple[ChannelFigure, ...] = ()  # figures of every channel over every watched horizon
    # stage -> gap over floor, for the stages that can be judged
    stages: Mapping[str, float] | None = None
    problem: str = ""  # reason why the gap cannot be judged; empty otherwise

    @property
    def worst(self) -> float:
        """Largest error over floor of all channels and horizons; 0 without figures."""
        return max((f.error / f.floor for f in self.figures), default=0.0)

    @property
    def stage(self) -> str:
        """The stage with the largest gap over its floor; empty if none was judged."""
        stages = self.stages or {}
        return max(stages, key=lambda name: stages[name], default="")


class LiveWindow:
    """The last seconds of a rig's channels.

    Parameters
    ----------
    rig : Rig
        The rig as its file describes it.
    length : float
        Length of the window [s].
    """

    def __init__(self, rig: Rig, length: float) -> None:
        self.rig = rig
        self.length = length
        self._samples: dict[str, deque[tuple[float, float]]] = {}
        self._channels = {
            **{(PRESSURES, m): f"{PRESSURES}{m}" for m in rig.muscle_names},
            **{(COMMANDS, m): f"{COMMANDS}{m}" for m in rig.muscle_names},
            **{(JOINTS, j): f"{JOINTS}{j}.position" for j in rig.joint_names},
        }

    def take(self, topic: str, stamp: float, names: Sequence[str], values: Sequence[float]) -> None:
        """Keep the values of one message; names that the rig does not have are ignored.

        Parameters
        ----------
        topic : str
            Channel prefix, such as `recording.PRESSURES`.
        stamp : float
            Time stamp [s].
        names, values : sequence
            As in the message; both have the same length.
        """
        for name, value in zip(names, values, strict=False):
            channel = self._channels.get((topic, name))
            if channel is not None:
                kept = self._samples.setdefault(channel, deque(maxlen=MOST_KEPT))
                if kept and stamp < kept[-1][0] - self.length:
                    kept.clear()  # the clock was set back
                kept.append((stamp, value if abs(value) <= LARGEST else math.nan))
                while kept[-1][0] - kept[0][0] > self.length:
                    kept.popleft()

    def forget(self) -> None:
        """Remove all samples, for example after a pause."""
        self._samples.clear()

    def _forget_silent(self) -> None:
        """Remove channels that have stopped while others continue."""
        newest = max((kept[-1][0] for kept in self._samples.values()), default=0.0)
        for name, kept in list(self._samples.items()):
            if newest - kept[-1][0] > 0.5 * self.length:
                del self._samples[name]

    def gap(self, joint: int) -> LiveGap:
        """The gap of one joint between the measurements in the window and the rig file."""
        self._forget_silent()
        entry = self.rig.joints[joint]
        wanted = [f"{PRESSURES}{m}" for m in entry.muscles]
        wanted += [f"{COMMANDS}{m}" for m in entry.muscles] + [f"{JOINTS}{entry.name}.position"]
        channels = {}
        for name in wanted:
            kept = self._samples.get(name)
            if kept:
                pairs = np.array(kept)
                channels[name] = RawChannel(pairs[:, 0], pairs[:, 1])
        missing = [name for name in wanted[BOTH_PRESSURES] if name not in channels]
        if missing:
            return LiveGap(entry.name, problem=f"no {', '.join(missing)} received")
        shortest = min(float(c.time[-1] - c.time[0]) for c in channels.values())
        if shortest < min(SHORTEST, self.length):
            return LiveGap(entry.name, problem=f"only {shortest:.1f} s received so far")
        try:
            recording = resample(RawRecording(Path("live"), channels))
            return self._judged(PredictionProblem(self.rig, joint, [recording]))
        except RecordingError as error:
            return LiveGap(entry.name, problem=str(error))

    def _judged(self, problem: PredictionProblem) -> LiveGap:
        scale = problem.data[0].block_deviation
        use = np.nonzero(problem.present)[0].tolist()
        figures = []
        for horizon in WATCHED:
            error, floor = _rms(problem, horizon.settings)
            figures += [
                ChannelFigure(
                    problem.names[c],
                    horizon.name,
                    UNITS[c],
                    float(error[c] * scale[c]),
                    float(floor[c] * scale[c]),
                )
                for c in use
                if math.isfinite(error[c])
            ]
        stages: dict[str, float] = {}
        if problem.has_commands:
            error, floor = _rms(
                problem, PredictionSettings(follow_motion=bool(problem.present[POSITION]))
            )
            stages["valve"] = float(np.max((error / floor)[BOTH_PRESSURES]))
        if problem.present[POSITION]:
            error, floor = _rms(problem, PredictionSettings(TIGHT))
            stages["muscle and joint"] = float(error[POSITION] / floor[POSITION])
        return LiveGap(problem.rig.joints[problem.joint].name, tuple(figures), stages)


def _rms(problem: PredictionProblem, settings: PredictionSettings) -> tuple[np.ndarray, np.ndarray]:
    """RMS error and floor of each channel in units of its noise."""
    values = problem.base.values
    errors = problem.errors(values[None], settings)[0]
    floor = noise_level(problem, values, settings)
    return np.sqrt(mean_squares(errors, problem.counted)), np.sqrt(floor)
