"""The motions of a commissioning, each faster than the one before.

Every motion begins with vented muscles at rest, which it fills slowly, and is followed by a
lowering (`motion_loop`). Its co-contraction is a share of the highest pressure; a slow position
loop keeps the joint at a reference, whatever the numbers of the rig are; a wave of the pressure
difference makes the quick parts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from pam_gap.experiments.excitations import smooth_path

Array = npt.NDArray[np.float64]

REST: Final = 1.0  # s, vented, at the begin of a motion
FILL: Final = 3.0  # s
MOVE: Final = 1.0  # s, of a stair
LEVEL_OF_PACE: Final = 0.4
"""How much less co-contraction a motion has with a loop that stands still [-]."""
DWELL: Final = 2.0  # s, from the begin of one stair to that of the next


@dataclass(frozen=True, slots=True)
class SampledMotion:
    """One motion, sampled."""

    # name, title: identifier, and what people are told
    name: str
    title: str
    period: float  # of the samples [s]
    level: Array  # shape (n,): mean of both pressures [Pa]
    position: Array  # shape (n,): reference of the slow loop [rad]
    # shape (n,): half the pressure difference that is added to that of the slow loop [Pa]
    wave: Array
    bandwidth: float  # of the integral part of the slow loop [1/s]

    @property
    def duration(self) -> float:
        """[s]."""
        return self.period * self.level.size

    def smaller(self, share: float) -> SampledMotion:
        """The motion with its wave and its way from the first reference reduced to a share."""
        middle = self.position[0]
        position = middle + share * (self.position - middle)
        return replace(self, position=position, wave=share * self.wave)

    def gentler(self, pace: float) -> SampledMotion:
        """The motion with a slower loop, which swings less, and with less co-contraction."""
        level = (1.0 - LEVEL_OF_PACE * (1.0 - pace)) * self.level
        return replace(self, bandwidth=pace * self.bandwidth, level=level)

    def every(self, count: int) -> SampledMotion:
        """The motion with one sample in `count`."""
        return replace(
            self, period=count * self.period, level=self.level[::count],
            position=self.position[::count], wave=self.wave[::count],
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Scale:
    """What motions are sized by."""

    period: float  # of the samples [s]
    highest: float  # highest pressure of both muscles [Pa]
    reach: float  # how far the joint may go to either side of the middle of its range [rad]
    middle: float  # of the range [rad]
    # half the pressure difference that turns the joint by 1 rad, over the mean pressure [1/rad]
    per_rad: float
    # half the pressure difference per speed with which the slow loop damps the joint [Pa s/rad]
    damping: float


def _time(scale: Scale, moving: float) -> Array:
    count = round((REST + FILL + moving) / scale.period)
    time: Array = np.arange(count, dtype=np.float64) * scale.period
    return time


def _levels(time: Array, knots: Sequence[tuple[float, float]], move: float) -> Array:
    """Vented, then filled to the first level, then the others [share]."""
    inside = smooth_path(time, [(0.0, knots[0][1]), *knots[1:]], move)
    result: Array = inside * np.clip((time - REST) / FILL, 0.0, 1.0)
    return result


def filling(scale: Scale) -> SampledMotion:
    """Fill both muscles slowly to a low pressure, and empty them."""
    time = _time(scale, 3.0)
    return SampledMotion(
        "filling", "fill both muscles slowly to a low pressure, and hold the joint",
        scale.period, scale.highest * _levels(time, [(0.0, 0.12)], 1.0),
        np.full(time.size, scale.middle), np.zeros(time.size), 1.5,
    )  # fmt: skip


def staircase(scale: Scale) -> SampledMotion:
    """Hold small steps of the angle at two levels of co-contraction."""
    stairs = (0.3, 0.6, 0.3, 0.0, -0.3, -0.6, -0.3, 0.0)
    start = REST + FILL
    knots = [(0.0, 0.0)] + [(start + i * DWELL, s) for i, s in enumerate((*stairs, *stairs))]
    time = _time(scale, DWELL * 2 * len(stairs) + MOVE)
    levels = [(0.0, 0.2), (start + DWELL * len(stairs), 0.4)]
    return SampledMotion(
        "staircase", "hold small steps of the angle at two levels of co-contraction",
        scale.period, scale.highest * _levels(time, levels, MOVE),
        scale.middle + scale.reach * smooth_path(time, knots, MOVE), np.zeros(time.size), 1.5,
    )  # fmt: skip


def _wave(random: np.random.Generator, time: Array, fastest: float) -> Array:
    """Steps that are held for a random time, together with sines; within -1 and 1."""
    wave = np.zeros(time.size)
    for frequency in np.exp(random.uniform(math.log(0.1), math.log(fastest), 5)):
        wave += np.sin(2.0 * math.pi * (frequency * time + random.random())) / (1.0 + frequency)
    wave /= np.max(np.abs(wave))
    at = 0.0
    steps = np.zeros(time.size)
    while at < time[-1]:
        steps[time >= at] = random.uniform(-1.0, 1.0)
        at += random.uniform(0.6, 2.5)
    mixed: Array = 0.5 * wave + 0.5 * steps
    return mixed


def steps(scale: Scale, name: str, share: float, moving: float, seed: int) -> SampledMotion:
    """Random steps and sines of the pressure difference at several levels of co-contraction.

    Parameters
    ----------
    scale : Scale
        Sizes of the rig.
    name : str
        Of the motion.
    share : float
        Static amplitude over the reach [-].
    moving : float
        Duration without the filling [s].
    """
    random = np.random.default_rng(seed)
    time = _time(scale, moving)
    start = REST + FILL
    change = 5.0
    levels = [(0.0, 0.35)]
    for at in np.arange(start + change, start + moving - 1.0, change):
        levels.append((float(at), float(random.uniform(0.22, 0.6))))
    level = _levels(time, levels, 0.4)
    gate = np.clip((time - start) / 0.5, 0.0, 1.0) * np.clip(
        (start + moving - time) / 0.5, 0.0, 1.0
    )
    wave = share * scale.reach * scale.per_rad * gate * _wave(random, time, 2.5) * level
    return SampledMotion(
        name, "random steps and sines of the pressures, at several levels of co-contraction",
        scale.period, scale.highest * level, np.full(time.size, scale.middle),
        scale.highest * wave, 0.7,
    )  # fmt: skip
