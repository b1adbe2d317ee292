"""Draws a rig with an ordinary background, and effects of a drawn strength above it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
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
from pam_check.blind.draw import Draw, draw_excitation, draw_sensors
from pam_check.blind.effect_cases import case_of
from pam_check.blind.plants import FIRST, PLANTS, RunPlant
from pam_check.blind.strength import channels, gap, strength
from pam_check.blind.truth_plant import (
    Array,
    PressureExcitation,
    Sensors,
    SupplyWander,
    TruthJoint,
    TruthMuscle,
    TruthRecording,
)
from pam_check.blind.variety import Variety
from pam_model.rig import Rig

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
class DrawnRoughRig:
    """The true rig, and recordings of it."""

    # joint, muscles, sensors, supply: of the true rig
    joint: TruthJoint
    muscles: tuple[TruthMuscle, TruthMuscle]
    sensors: Sensors
    supply: SupplyWander
    # recording, check: its recording, and one with another motion
    recording: TruthRecording
    check: TruthRecording
    without: TruthRecording  # the rig without its hidden effects, with the same commands
    healthy: Draw  # joint and muscles of that rig, at the size of an elbow
    strength: float  # of the hidden effects, above the background; 0 without effects
    strengths: tuple[float, ...]  # of each hidden effect alone


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


def layered(rigs: Sequence[Draw], plain: Draw) -> Draw:
    """The plain rig with what differs from it in each of several rigs; later ones come first."""
    total = plain
    for rig in rigs:
        total = alone(plain, rig, total)
    return total


@dataclass(frozen=True)
class Bench:
    """Runs rigs of one kind through one motion, always with the same noise."""

    written: Rig  # the rig as its file has it
    variety: Variety  # their kind
    run_plant: RunPlant  # their plant
    # sensors, supply, seed: the same for all of them
    sensors: Sensors
    supply: SupplyWander
    seed: int

    def compared(
        self,
        recording: TruthRecording,
        motion: PressureExcitation,
        plain: Draw,
        lone: Sequence[Draw],
    ) -> tuple[TruthRecording, float, list[float]]:
        """Compare a rig with its parts, which get the same commands and run side by side.

        Parameters
        ----------
        recording : TruthRecording
            Of the rig with all its effects.
        motion : PressureExcitation
            The motion of this recording.
        plain : Draw
            The rig without its effects.
        lone : sequence of Draw
            The rig with one of its effects each.

        Returns
        -------
        without : TruthRecording
            Of the rig without its effects.
        strength : float
            Of all effects together.
        strengths : list of float
            Of each effect; that of all for one with which alone the rig diverges.

        Raises
        ------
        FloatingPointError
            When the rig without its effects diverges.
        """

        def run(rig: Draw) -> TruthRecording | None:
            with suppress(FloatingPointError):
                return self.run(rig, motion, recording.commands)
            return None

        given = [plain, *(lone if len(lone) > 1 else [])]
        with ThreadPoolExecutor(len(given)) as pool:
            without, *others = pool.map(run, given)
        if without is None:
            raise FloatingPointError("the rig diverges without its effects")
        if not lone:
            return without, 0.0, []
        usual = gap(self.written, channels(without))

        def seen(one: TruthRecording) -> float:
            return strength(gap(self.written, channels(one)), usual)

        together = seen(recording)
        if len(lone) == 1:
            return without, together, [together]
        return without, together, [together if one is None else seen(one) for one in others]

    def run(
        self,
        rig: Draw,
        motion: PressureExcitation,
        commands: Array | None = None,
    ) -> TruthRecording:
        """Record a rig."""
        return self.run_plant(
            self.variety.joint(rig.joint),
            (self.variety.muscle(rig.muscles[0]), self.variety.muscle(rig.muscles[1])),
            motion,
            self.sensors,
            np.random.default_rng(self.seed),
            fixed_commands=commands,
            supply=self.supply,
        )


def draw_rough_rig(
    believed: tuple[TruthJoint, tuple[TruthMuscle, TruthMuscle]],
    written: Rig,
    effects: list[str],
    random: np.random.Generator,
    plant: str = FIRST,
    variety: Variety | None = None,
) -> DrawnRoughRig:
    """Draw the true rig that belongs to a believed one.

    Parameters
    ----------
    believed : tuple
        Joint and muscles as the rig file has them, at the size of an elbow.
    written : Rig
        The rig file itself; the numbers in it may be wrong within its tolerance.
    effects : list of str
        Hidden effects, by their names in `effect_cases`.
    random : numpy.random.Generator
        Source of every draw.
    plant : str
        Plant of `plants.PLANTS` that makes the recordings.
    variety : Variety, optional
        Kind of the rig; by default an elbow, on which two effects are scaled together. With a
        kind, each of two effects gets a strength of its own.

    Raises
    ------
    FloatingPointError
        When the drawn rig cannot run.
    BuriedError
        When the effects stay smaller than the background, however large they are made.
    """
    joint, muscles = believed
    kind = variety or Variety()
    plain = Draw(random, joint, list(muscles))
    wrong_numbers(plain, written.parameter_tolerance)
    add_background(plain)
    full = Draw(random, plain.joint, list(plain.muscles))
    apart: list[Draw] = []  # rigs with one of the effects each
    for effect in effects:
        before = Draw(random, full.joint, list(full.muscles))
        case_of(effect).draw(full)
        if kind.horizontal:
            full.on_joint(gravity_torque=0.0)
        apart.append(alone(before, full, plain))
    sample_time = float(random.choice(SAMPLE_TIMES))
    duration = float(random.uniform(SHORTEST, LONGEST))
    motions = [
        background_motion(plain, draw_excitation(random, joint, sample_time, duration))
        for _ in range(2)
    ]
    sensors = background_sensors(plain, draw_sensors(random))
    supply = background_supply(plain)
    goals = [_draw_strength(plain)]
    seed = int(random.integers(2**32))
    if variety is not None:
        motions = [variety.motion(motion, random) for motion in motions]
        goals += [_draw_strength(plain) for _ in effects[1:]]
    bench = Bench(written, kind, PLANTS[plant], kind.sensors(sensors), supply, seed)
    parts = apart if len(goals) > 1 else [full]
    shares, strengths, rig, together = [1.0] * len(parts), [0.0] * len(effects), full, 0.0
    for _ in range(ROUNDS):
        rig = layered([weaker(p, plain, s) for p, s in zip(parts, shares, strict=True)], plain)
        recording = bench.run(rig, motions[0])
        mixed = shares if len(shares) > 1 else shares * len(effects)
        lone = [weaker(one, plain, share) for one, share in zip(apart, mixed, strict=True)]
        without, together, strengths = bench.compared(recording, motions[0], plain, lone)
        if not effects:
            break
        found = strengths if len(goals) == len(effects) else [together]
        off = [math.log(max(s, 1e-3) / goal) for s, goal in zip(found, goals, strict=True)]
        if max(map(abs, off)) < CLOSE:
            break
        shares = [
            min(share * math.exp(-o), LARGEST_SHARE) for share, o in zip(shares, off, strict=True)
        ]
    if effects and together < WEAKEST:
        raise BuriedError(f"{', '.join(effects)}: {together:.2f} times the background")
    check = bench.run(rig, motions[1])
    true = (kind.muscle(rig.muscles[0]), kind.muscle(rig.muscles[1]))
    return DrawnRoughRig(
        kind.joint(rig.joint), true, bench.sensors, supply, recording, check, without, plain,
        together, tuple(strengths),
    )  # fmt: skip


def _draw_strength(plain: Draw) -> float:
    """A strength above the background, of a class that is drawn."""
    low, high = STRENGTHS[str(plain.random.choice(list(STRENGTHS)))]
    return plain.span(low, high)


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
