"""The motions that a controller plays on a rough rig: an arm at work, and a chirp."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from pam_check.blind.truth_plant import Array
from pam_control.references.trajectory import TrajectoryPoint

REACHES: Final = 5
AMPLITUDE: Final = 0.25  # rad, of the chirp
CHIRP: Final = (0.1, 2.0, 8.0)  # Hz at its start and its end, s
STEP: Final = 0.02  # s between waypoints


def arm(random: np.random.Generator) -> list[TrajectoryPoint]:
    """Reaches of minimum jerk between drawn targets, with short pauses; ends where it began."""
    targets = [*random.uniform(-0.6, 0.6, REACHES).tolist(), 0.0]
    points: list[TrajectoryPoint] = []
    at, start = 0.0, 0.0
    for target in targets:
        duration = float(random.uniform(0.7, 1.1)) * max(1.0, abs(target - start) / 0.6)
        steps = max(round(duration / STEP), 5)
        for index in range(1, steps + 1):
            x, stroke, time = index / steps, target - start, steps * STEP
            points.append(
                TrajectoryPoint(
                    at + index * STEP,
                    [start + stroke * x**3 * (10.0 - 15.0 * x + 6.0 * x * x)],
                    [stroke / time * 30.0 * x * x * (1.0 - x) ** 2],
                    [stroke / time**2 * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)],
                )
            )
        at, start = at + steps * STEP + 0.2, target
        points.append(TrajectoryPoint(at, [target], [0.0], [0.0]))
    return points


def chirp(_: np.random.Generator) -> list[TrajectoryPoint]:
    """A sine sweep whose frequency grows by a constant factor per second, faded in and out."""
    low, high, duration = CHIRP
    growth = math.log(high / low) / duration
    h = 1e-4
    times: Array = np.arange(1, round(duration / STEP) + 1, dtype=np.float64) * STEP

    def angle(time: Array) -> Array:
        fade = np.clip(np.minimum(time, duration - time) / 0.5, 0.0, 1.0)
        fade = fade**3 * (10.0 - 15.0 * fade + 6.0 * fade**2)
        phase = 2.0 * np.pi * low * (np.exp(growth * time) - 1.0) / growth
        result: Array = AMPLITUDE * fade * np.sin(phase)
        return result

    before, middle, after = angle(times - h), angle(times), angle(times + h)
    speeds, pushes = (after - before) / (2.0 * h), (after - 2.0 * middle + before) / h**2
    speeds[-1] = pushes[-1] = 0.0
    return [
        TrajectoryPoint(float(t), [float(q)], [float(v)], [float(a)])
        for t, q, v, a in zip(times, middle, speeds, pushes, strict=True)
    ]


MOTIONS: Final[Mapping[str, Callable[[np.random.Generator], list[TrajectoryPoint]]]] = {
    "arm": arm,
    "chirp": chirp,
}
