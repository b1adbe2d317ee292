"""The four motions of the demo, given as waypoints, steps or stiffness levels."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

Array = npt.NDArray[np.float64]

ARM_RATE = 20.0  # 1/s, assumed: the data source gives no rate
ARM_EPISODE = "episode_4.csv"
ARM_JOINT = "angle_0"
ARM_STOP = 0.4  # s, in which the arm is brought to rest behind its recording
WAYPOINT_RATE = 50.0  # 1/s
APPROACH = 3.0  # s, to the first waypoint; what the valves of the slowest example rig need
HOLD_STIFFNESS = 14.0  # N m/rad


@dataclass(frozen=True, slots=True)
class Window:
    """A scored part of a motion: its name, its start and its end [s from the motion's start]."""

    name: str
    start: float
    end: float


@dataclass(frozen=True, slots=True)
class DemoMotion:
    """One motion of one joint."""

    # name, title: name in files, title on the page
    name: str
    title: str
    # times, positions, velocities, accelerations: shape (n,): waypoints: [s] from the motion's
    # start, [rad], [rad/s], [rad/s^2]; at rest at both ends
    times: Array
    positions: Array
    velocities: Array
    accelerations: Array
    windows: tuple[Window, ...]  # the scored parts
    # times [s] and the stiffness [N m/rad] that is commanded from each of them on
    stiffness: tuple[tuple[float, float], ...] = ((0.0, HOLD_STIFFNESS),)
    # each position is sent when it is due, instead of a whole trajectory in advance
    streamed: bool = False

    @property
    def duration(self) -> float:
        """Seconds from the first waypoint to the last."""
        return float(self.times[-1])


def _of_spline(spline: Callable[..., Array], times: Array) -> tuple[Array, Array, Array]:
    return spline(times), spline(times, 1), spline(times, 2)


def arm_motion() -> DemoMotion:
    """The measured motion of a real muscle-driven arm, see data/ORIGIN.md.

    A cubic spline through every sample, so that velocity and acceleration exist; nothing is
    smoothed, scaled or shifted. The recording ends in motion: behind it, the arm is brought to rest
    without a jump of its acceleration, which is not scored.
    """
    path = Path(__file__).with_name("data") / ARM_EPISODE
    with path.open(newline="") as stream:
        angles = [float(row[ARM_JOINT]) for row in csv.DictReader(stream)]
    recorded = np.arange(len(angles)) / ARM_RATE
    end = float(recorded[-1])
    spline = CubicSpline(recorded, np.asarray(angles), bc_type=("clamped", "natural"))
    speed = float(spline(end, 1))
    since = np.arange(1, round(ARM_STOP * ARM_RATE) + 1) / ARM_RATE
    x = since / ARM_STOP
    braking = (
        angles[-1] + speed * ARM_STOP * (x - 2.5 * x**4 + 3.0 * x**5 - x**6),
        speed * (1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x * x)),
        -speed / ARM_STOP * 30.0 * (x * (1.0 - x)) ** 2,
    )
    times = np.concatenate([recorded, end + since])
    q, qd, qdd = (
        np.concatenate(each) for each in zip(_of_spline(spline, recorded), braking, strict=True)
    )
    window = Window("recorded", 0.0, end)
    return DemoMotion("arm", "A real arm's motion", times, q, qd, qdd, (window,))


def chirp(
    amplitude: float = 0.25, low: float = 0.1, high: float = 2.0, duration: float = 10.0
) -> DemoMotion:
    """A sine sweep, faded in and out over half a second.

    Parameters
    ----------
    amplitude : float
        [rad].
    low, high : float
        Frequencies at start and end [Hz]; the frequency grows by a constant factor per second.
    duration : float
        [s].
    """
    times = np.arange(0.0, duration + 0.5 / WAYPOINT_RATE, 1.0 / WAYPOINT_RATE)
    growth = math.log(high / low) / duration
    phase = 2.0 * math.pi * low * (np.exp(growth * times) - 1.0) / growth
    fade = np.clip(np.minimum(times, duration - times) / 0.5, 0.0, 1.0)
    fade = fade**3 * (10.0 - 15.0 * fade + 6.0 * fade**2)
    spline = CubicSpline(times, amplitude * fade * np.sin(phase), bc_type="clamped")
    q, qd, qdd = _of_spline(spline, times)
    at_1_hz = math.log(1.0 / low) / growth
    windows = (Window("to 1 Hz", 0.0, at_1_hz), Window("to 2 Hz", 0.0, duration))
    return DemoMotion("chirp", f"Chirp {low:g} to {high:g} Hz", times, q, qd, qdd, windows)


def staircase(
    levels: Sequence[float] = (8.0, 11.0, 14.0, 17.0, 20.0, 10.0),
    position: float = 0.3,
    dwell: float = 1.2,
) -> DemoMotion:
    """Stiffness levels [N m/rad], `dwell` seconds each, while a position [rad] is held."""
    times = np.array([0.0, dwell * len(levels)])
    still = np.zeros(2)
    return DemoMotion(
        "staircase",
        "Stiffness staircase while holding",
        times,
        np.full(2, position),
        still,
        still,
        (Window("held", 0.0, float(times[-1])),),
        tuple((dwell * index, level) for index, level in enumerate(levels)),
    )


def steps(levels: Sequence[float] = (0.0, 0.4, -0.2, 0.2, 0.0), dwell: float = 1.2) -> DemoMotion:
    """Sudden changes of position [rad], streamed."""
    times = np.arange(0.0, dwell * len(levels), 1.0 / WAYPOINT_RATE)
    which = np.minimum((times / dwell).astype(int), len(levels) - 1)
    still = np.zeros_like(times)
    return DemoMotion(
        "steps",
        "Steps",
        times,
        np.asarray(levels)[which],
        still,
        still,
        (Window("all", 0.0, float(times[-1])),),
        streamed=True,
    )


def all_motions() -> list[DemoMotion]:
    """The demo's programme, in order."""
    return [arm_motion(), chirp(), staircase(), steps()]
