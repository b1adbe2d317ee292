"""Draws a rig with an ordinary background, and effects of a drawn strength above it.

The strength of the effects is the RMS change that they make, over the change that the background
makes (without the wrong numbers of the rig file, which re-tuning corrects), with the same valve
commands, in the channel where this ratio is largest.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
import pandas as pd

from pam_check.blind.background import (
    add_background,
    background_motion,
    background_sensors,
    background_supply,
    weaker,
    wrong_numbers,
)
from pam_check.blind.draw import KNOWN, OUTSIDE, Draw, draw_excitation, draw_sensors
from pam_check.blind.plants import FIRST, PLANTS
from pam_check.blind.truth_plant import (
    Array,
    Excitation,
    Sensors,
    SupplyWander,
    TruthJoint,
    TruthMuscle,
    TruthRecording,
)

STRENGTHS = {"weak": (1.0, 3.0), "medium": (3.0, 10.0), "strong": (10.0, 30.0)}
TOLERANCES = (0.02, 0.03, 0.05)
SAMPLE_TIMES = (0.001, 0.002, 0.002, 0.0025, 0.005)
SHORTEST, LONGEST = 20.0, 40.0  # s
WEAKEST = STRENGTHS["weak"][0]
ROUNDS = 4
CLOSE = 0.2  # of the logarithm of the strength
LARGEST_SHARE = 4.0


class BuriedError(ValueError):
    """The drawn effects change the rig by less than its background does."""


@dataclass(frozen=True)
class DrawnRig:
    """The true rig, and recordings of it.

    Attributes
    ----------
    joint, muscles, sensors, supply
        Of the true rig.
    recording, check : TruthRecording
        Its recording, and one with another motion.
    without : TruthRecording
        The rig without its hidden effects, with the same commands.
    strength : float
        Of the hidden effects, above the background; 0 without effects.
    strengths : tuple of float
        Of each hidden effect alone.
    """

    joint: TruthJoint
    muscles: tuple[TruthMuscle, TruthMuscle]
    sensors: Sensors
    supply: SupplyWander
    recording: TruthRecording
    check: TruthRecording
    without: TruthRecording
    strength: float
    strengths: tuple[float, ...]


def alone(before: Draw, after: Draw, plain: Draw) -> Draw:
    """The plain rig with those values that an effect changed from `before` to `after`."""

    def changed(old: dict[str, float], new: dict[str, float]) -> dict[str, float]:
        return {name: value for name, value in new.items() if value != old[name]}

    joint = plain.joint._replace(**changed(before.joint._asdict(), after.joint._asdict()))
    muscles = [
        one._replace(**changed(old._asdict(), new._asdict()))
        for one, old, new in zip(plain.muscles, before.muscles, after.muscles, strict=True)
    ]
    return Draw(plain.random, joint, muscles)


def _change(one: TruthRecording, other: TruthRecording) -> Array:
    """RMS difference of the true channels: both pressures and the position."""
    pressures = np.sqrt(np.mean((one.true_pressures - other.true_pressures) ** 2, axis=0))
    position = math.sqrt(float(np.mean((one.true_position - other.true_position) ** 2)))
    return np.array([*pressures, position])


def _seen(one: TruthRecording, other: TruthRecording) -> Array:
    """RMS difference of the recorded channels, which sensor effects change too."""
    pressures = np.sqrt(np.mean((one.pressures - other.pressures) ** 2, axis=0))
    position = math.sqrt(float(np.mean((one.position - other.position) ** 2)))
    return np.array([*pressures, position])


def draw_rough_rig(
    believed: tuple[TruthJoint, TruthMuscle],
    tolerance: float,
    effects: list[str],
    random: np.random.Generator,
    plant: str = FIRST,
) -> DrawnRig:
    """Draw the true rig that belongs to a believed one.

    Parameters
    ----------
    believed : tuple
        Joint and muscle as the rig file has them.
    tolerance : float
        Largest relative error of the numbers in it.
    effects : list of str
        Hidden effects of `draw.KNOWN` and `draw.OUTSIDE`.
    random : numpy.random.Generator
        Source of every draw.
    plant : str
        Plant of `plants.PLANTS` that makes the recordings.

    Raises
    ------
    FloatingPointError
        When the drawn rig cannot run.
    BuriedError
        When the effects stay smaller than the background, however large they are made.
    """
    joint, muscle = believed
    plain = Draw(random, joint, [muscle, muscle])
    wrong_numbers(plain, tolerance)
    exact = Draw(random, plain.joint, list(plain.muscles))
    add_background(plain)
    full = Draw(random, plain.joint, list(plain.muscles))
    apart: list[Draw] = []  # rigs with one of the effects each
    for effect in effects:
        before = Draw(random, full.joint, list(full.muscles))
        (KNOWN | OUTSIDE)[effect][1](full)
        apart.append(alone(before, full, plain))
    sample_time = float(random.choice(SAMPLE_TIMES))
    duration = float(random.uniform(SHORTEST, LONGEST))
    motions = [
        background_motion(plain, draw_excitation(random, joint, sample_time, duration))
        for _ in range(2)
    ]
    sensors = background_sensors(plain, draw_sensors(random))
    supply = background_supply(plain)
    low, high = STRENGTHS[str(random.choice(list(STRENGTHS)))]
    goal = plain.span(low, high)
    seed = int(random.integers(2**32))

    def run(rig: Draw, motion: Excitation, commands: Array | None = None) -> TruthRecording:
        muscles = (rig.muscles[0], rig.muscles[1])
        return PLANTS[plant](
            rig.joint, muscles, motion, sensors, np.random.default_rng(seed),
            fixed_commands=commands, supply=supply,
        )  # fmt: skip

    rig, share, strength = full, 1.0, 0.0
    for _ in range(ROUNDS):
        rig = weaker(full, plain, share)
        recording = run(rig, motions[0])
        without = run(plain, motions[0], recording.commands)
        if not effects:
            break
        ideal = PLANTS[plant](
            exact.joint, (exact.muscles[0], exact.muscles[1]), motions[0], sensors,
            np.random.default_rng(seed), fixed_commands=recording.commands,
        )  # fmt: skip
        strength = float(np.max(_seen(recording, without) / _change(without, ideal)))
        if abs(math.log(max(strength, 1e-3) / goal)) < CLOSE:
            break
        share = min(share * goal / max(strength, 1e-3), LARGEST_SHARE)
    strengths = [strength] * len(effects)
    for k, one in enumerate(apart if len(effects) > 1 else []):
        # a rig with one of the effects alone may diverge with commands that both have shaped
        with suppress(FloatingPointError):
            recorded = run(weaker(one, plain, share), motions[0], recording.commands)
            strengths[k] = float(np.max(_seen(recorded, without) / _change(without, ideal)))
    if effects and strength < WEAKEST:
        raise BuriedError(f"{', '.join(effects)}: {strength:.2f} times the background")
    check = run(rig, motions[1])
    muscles = (rig.muscles[0], rig.muscles[1])
    return DrawnRig(
        rig.joint, muscles, sensors, supply, recording, check, without, strength, tuple(strengths)
    )


def uneven(table: pd.DataFrame, random: np.random.Generator) -> pd.DataFrame:
    """Stamps that jitter, rows that are lost, values that are missing and an order of columns."""
    table = table.copy()
    step = float(table["time"].iloc[1] - table["time"].iloc[0])
    table["time"] += random.normal(0.0, 0.03 * step, len(table))
    if random.random() < 0.5:
        table = table[random.random(len(table)) > random.uniform(0.0, 0.01)]
    if random.random() < 0.3:
        for name in table.columns[1:]:
            at = int(random.integers(len(table) - 30))
            lost = table.index[at : at + int(random.integers(3, 25))]
            table.loc[lost, name] = np.nan
    columns = list(table.columns)
    random.shuffle(columns)
    return table[columns]
