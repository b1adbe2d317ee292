"""Draws a rig of the independent plant, a rig file that is off, and the recordings of an owner.

The true rig has an ordinary background. In its file every number of joint, muscles and valves is
off by up to a third and every length by up to 5 %; the encoder's zero and the pressure sensors are
off as those of real robots; one rig in ten has a sign or hose exchanged.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from pam_check.blind.background import add_background, background_sensors, background_supply
from pam_check.blind.cases import rig_parameters, to_table
from pam_check.blind.draw import Draw, believed_rig, draw_excitation, draw_sensors
from pam_check.blind.rough import uneven
from pam_check.blind.truth_plant import (
    PressureExcitation,
    Sensors,
    SupplyWander,
    TruthJoint,
    TruthMuscle,
    run_truth,
)
from pam_check.blind.variety import Variety, draw_variety

THIRD = 1.0 / 3.0
LENGTHS = 0.05
SUPPLY = 0.02
ANGLE = 0.1  # rad, of the written angle of gravity
ENCODER = 0.05  # rad, of the encoder's zero
ZERO = 0.003  # of the supply's gauge pressure, of a pressure sensor's zero
GAIN = 0.005
EXCHANGED = 0.1
MISSING = 0.2
"""Share of the numbers that may be missing which are missing in the rig file."""
LOAD_CELLS = 0.25
DURATION, WITHHELD = 40.0, 20.0  # s
REST = 2.0  # s
SAMPLE_TIMES = (0.0025, 0.005)  # s
MAX_TRIES = 20
OF_JOINT = ("inertia", "viscous_friction", "gravity_torque")
OF_MUSCLE = ("dead_volume", "sonic_conductance", "critical_ratio", "time_constant")
OF_LENGTH = ("thread_length", "turns", "neutral_length", "rest_length")
EXCHANGES = ("sign of the joint", "hoses", "sign of both valves", "sign of one valve")
OF_FLOW_VALVES = EXCHANGES[2:]
"""A regulator has no command below 0."""


@dataclass(frozen=True)
class CalibrationRig:
    """A drawn rig: what its owner has, and the truth.

    Attributes
    ----------
    parameters : mapping
        The content of `ros__parameters` of the rig file.
    log, withheld : pandas.DataFrame
        Recordings of two motions.
    truth : mapping of str to float
        True numbers by key of the rig file, as the recorded angle has them.
    exchanged : str
        What is exchanged, of `EXCHANGES`; empty for nothing.
    has_load_cells : bool
        Whether the forces were recorded.
    """

    parameters: Mapping[str, object]
    log: pd.DataFrame
    withheld: pd.DataFrame
    truth: Mapping[str, float]
    exchanged: str
    has_load_cells: bool


def motion(
    random: np.random.Generator, joint: TruthJoint, step: float, duration: float
) -> PressureExcitation:
    """What docs/record_for_diagnosis.md asks for: rest, then steps, sines and co-contraction."""
    drawn = draw_excitation(random, joint, step, duration)
    time = np.arange(drawn.level.size) * step
    moving = np.clip((time - REST) / 0.5, 0.0, 1.0)
    return replace(
        drawn,
        difference=moving * drawn.difference,
        reference_position=moving * drawn.reference_position,
    )


def draw_rig(random: np.random.Generator) -> CalibrationRig:
    """Draw one rig that can run.

    Raises
    ------
    RuntimeError
        When `MAX_TRIES` draws give none.
    """
    for _ in range(MAX_TRIES):
        kind = draw_variety(random, regulators=True)
        kind = replace(kind, slow=False, rows=1)
        try:
            found = _drawn(random, kind)
        except FloatingPointError:
            continue
        if found is not None:
            return found
    raise RuntimeError(f"no rig that can run in {MAX_TRIES} draws")


@dataclass(frozen=True)
class TrueRig:
    """A rig of the independent plant with an ordinary background, at its true size.

    Attributes
    ----------
    joint : TruthJoint
        Its joint.
    muscles : (TruthMuscle, TruthMuscle)
        Agonist first.
    sensors : Sensors
        Noise and quantisation.
    supply : SupplyWander
        How the supply changes by itself.
    believed : TruthJoint
        The joint at the size of an elbow, by which motions are drawn.
    """

    joint: TruthJoint
    muscles: tuple[TruthMuscle, TruthMuscle]
    sensors: Sensors
    supply: SupplyWander
    believed: TruthJoint


def draw_true_rig(random: np.random.Generator, kind: Variety) -> TrueRig:
    """Draw a rig of this kind: no two muscles are equal, and the sensors are not exact."""
    joint, muscle = believed_rig(random)
    joint, muscles = kind.believed(joint, muscle)
    gauge = joint.supply_pressure - joint.ambient_pressure
    draw = Draw(random, joint, [_apart(random, one) for one in muscles])
    add_background(draw)
    draw.muscles = [
        one._replace(
            pressure_gain=1.0 + GAIN * random.uniform(-1.0, 1.0),
            pressure_bias=ZERO * gauge * random.uniform(-1.0, 1.0),
        )
        for one in draw.muscles
    ]
    draw.on_joint(position_offset=ENCODER * random.uniform(-1.0, 1.0))
    sensors = kind.sensors(background_sensors(draw, draw_sensors(random)))
    supply = background_supply(draw)
    first, second = (kind.muscle(one) for one in draw.muscles)
    return TrueRig(kind.joint(draw.joint), (first, second), sensors, supply, joint)


def draw_exchange(random: np.random.Generator, is_flow: bool) -> str:
    """What is exchanged on a rig, with flow valves or regulators; empty for nothing."""
    exchanged = str(random.choice(EXCHANGES)) if random.random() < EXCHANGED else ""
    return "hoses" if exchanged in OF_FLOW_VALVES and not is_flow else exchanged


def _drawn(random: np.random.Generator, kind: Variety) -> CalibrationRig | None:
    drawn = draw_true_rig(random, kind)
    joint, true_joint, (first, second) = drawn.believed, drawn.joint, drawn.muscles
    sensors, supply = drawn.sensors, drawn.supply
    step = float(random.choice(SAMPLE_TIMES))
    has_cells = bool(random.random() < LOAD_CELLS)
    tables = []
    for duration in (DURATION, WITHHELD):
        played = kind.motion(motion(random, joint, step, duration), random)
        made = run_truth(true_joint, (first, second), played, sensors, random, supply=supply)
        if np.ptp(made.true_position) < 0.15:
            return None
        if np.mean(np.abs(made.true_position) > 0.98 * true_joint.upper_limit) > 0.02:
            return None
        tables.append(uneven(to_table(made, has_cells), random))
    exchanged = draw_exchange(random, first.regulator == 0.0)
    log, withheld = (exchange(table, exchanged) for table in tables)
    return CalibrationRig(
        written_numbers(random, true_joint, first, second),
        log,
        withheld,
        true_numbers(true_joint, (first, second)),
        exchanged,
        has_cells,
    )


def _apart(random: np.random.Generator, muscle: TruthMuscle) -> TruthMuscle:
    """A muscle of a batch, with a valve of a batch."""
    return muscle._replace(
        **{n: getattr(muscle, n) * (1.0 + 0.01 * random.uniform(-1.0, 1.0)) for n in OF_LENGTH},
        **{n: getattr(muscle, n) * (1.0 + 0.05 * random.uniform(-1.0, 1.0)) for n in OF_MUSCLE},
    )


def true_numbers(joint: TruthJoint, muscles: tuple[TruthMuscle, TruthMuscle]) -> dict[str, float]:
    """The true numbers by key of the rig file, with the zero of the encoder as position 0."""
    zero = joint.position_offset
    found = {f"elbow.{n}": float(getattr(joint, n)) for n in (*OF_JOINT, "pulley_radius")}
    found["elbow.gravity_angle"] = joint.gravity_angle + zero
    found["supply_pressure"] = joint.supply_pressure
    sides = (("elbow_flexor", 1.0), ("elbow_extensor", -1.0))
    for (name, sign), muscle in zip(sides, muscles, strict=True):
        found |= {
            f"{name}.thread_length": muscle.thread_length,
            f"{name}.turns": muscle.turns,
            f"{name}.neutral_length": muscle.neutral_length + sign * joint.pulley_radius * zero,
            f"{name}.dead_volume": muscle.dead_volume,
        }
        found |= {f"{name}.valve.{n}": float(getattr(muscle, n)) for n in OF_MUSCLE[1:]}
    return found


def written_numbers(
    random: np.random.Generator, joint: TruthJoint, first: TruthMuscle, second: TruthMuscle
) -> dict[str, object]:
    """The rig file: every number is off, and some are missing."""

    def off(value: float, reach: float) -> float:
        return float(value * (1.0 + reach * random.uniform(-1.0, 1.0)))

    muscles = [
        one._replace(
            **{n: off(getattr(one, n), THIRD) for n in OF_MUSCLE},
            **{n: off(getattr(one, n), LENGTHS) for n in OF_LENGTH},
        )
        for one in (first, second)
    ]
    for k, one in enumerate(muscles):  # an owner reads the rest length off the braid's angle
        if one.rest_length >= one.thread_length:
            muscles[k] = one._replace(rest_length=0.97 * one.thread_length)
    stated = joint._replace(
        **{n: off(getattr(joint, n), THIRD) for n in OF_JOINT},
        pulley_radius=off(joint.pulley_radius, LENGTHS),
        supply_pressure=off(joint.supply_pressure, SUPPLY),
        gravity_angle=joint.gravity_angle + ANGLE * random.uniform(-1.0, 1.0),
    )
    tree = rig_parameters(stated, muscles[0], THIRD, LENGTHS, muscles[1])
    elbow = tree["elbow"]
    assert isinstance(elbow, dict)
    for name in ("inertia", "viscous_friction"):
        if random.random() < MISSING:
            del elbow[name]
    if stated.gravity_torque > 0.0 and random.random() < MISSING:
        del elbow["gravity_torque"]
    return tree


def exchange(table: pd.DataFrame, what: str) -> pd.DataFrame:
    """The log of a rig with something exchanged."""
    table = table.copy()
    flexor, extensor = "elbow_flexor", "elbow_extensor"
    if what == "sign of the joint":
        table["joint_states.elbow.position"] *= -1.0
    elif what == "hoses":
        names: dict[str, str] = {}
        for channel in ("valve_commands.", "pressure_states."):
            names |= {channel + flexor: channel + extensor, channel + extensor: channel + flexor}
        table = table.rename(columns=names)
    elif what == "sign of both valves":
        table[[f"valve_commands.{flexor}", f"valve_commands.{extensor}"]] *= -1.0
    elif what == "sign of one valve":
        table[f"valve_commands.{flexor}"] *= -1.0
    return table


def angle_error(found: float, true: float) -> float:
    """Difference of two angles [rad]."""
    return (found - true + math.pi) % (2.0 * math.pi) - math.pi
