"""Rigs of other sizes and kinds than the one that the effects are drawn for.

A rig is drawn at the size of an elbow, with all its hidden effects, and is then scaled: with a
length scale s and the same pressures, forces grow with s^2, torques and volumes with s^3, and
conductances with s^3 too, so that all times and angles stay as they are. Numbers that no scale
changes are drawn beside it: how fast the valves are, how heavy the arm is, whether gravity acts,
and how much one muscle differs from the other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from pam_check.blind.effect_cases import KNOWN, OUTSIDE
from pam_check.blind.truth_plant import PressureExcitation, Sensors, TruthJoint, TruthMuscle

SMALLEST, LARGEST = 0.12, 2.7
"""Length scales of muscles that pull with about 10 N and 5 kN at 3 bar."""
HORIZONTAL = 0.3
"""Share of rigs on which gravity does not act."""
UNEQUAL = 0.4
"""Share of rigs whose muscles differ from each other."""
SLOW = 0.15
"""Share of motions without anything quick."""
REGULATED = 0.25
"""Share of rigs whose valves are pressure regulators."""
INNER_GAIN = 2.5e-4
"""Opening of a regulator's valve per error of its outlet [1/Pa]."""
SPARSE = {1: 0.7, 5: 0.15, 10: 0.15}
"""Of how many rows a log keeps one: the loop runs on at its own rate."""
JOINT_POWERS = {
    "pulley_radius": 1, "pulley_eccentricity": 1,
    "inertia": 3, "viscous_friction": 3, "gravity_torque": 3, "coulomb_torque": 3,
    "static_torque": 3, "torque_ripple": 3, "reservoir_volume": 3, "reservoir_conductance": 3,
    "cross_leak": 3,
}  # fmt: skip
MUSCLE_POWERS = {
    "thread_length": 1, "rest_length": 1, "neutral_length": 1, "play_length": 1,
    "creep_stiffness": 1, "cable_compliance": -1, "thread_compliance": -2,
    "dead_volume": 3, "sonic_conductance": 3, "leak": 3, "tube_volume": 3, "tube_conductance": 3,
    "heat_transfer": 3, "bladder_volume": 3,
}  # fmt: skip
"""Powers of the length scale; the other numbers are angles, times, shares and pressures."""


@dataclass(frozen=True, slots=True)
class Variety:
    """How a drawn rig differs from an elbow."""

    scale: float = 1.0  # length scale
    # flow, mass: factors on the conductance of the valves and on the inertia
    flow: float = 1.0
    mass: float = 1.0
    horizontal: bool = False  # whether gravity does not act
    second: float = 1.0  # lengths of the second muscle over those of the first
    slow: bool = False  # whether the motions have slow parts only
    rows: int = 1  # one row in so many is logged
    # time constant of pressure regulators in place of flow valves [s]; 0 without
    regulator_time: float = 0.0

    @property
    def hidden(self) -> frozenset[str]:
        """Effects that cannot be seen on a rig of this kind."""
        if self.regulator_time <= 0.0:
            return frozenset()
        cases = KNOWN | OUTSIDE
        return frozenset(name for name in cases if cases[name].fades_behind_a_regulator)

    def believed(
        self, joint: TruthJoint, muscle: TruthMuscle
    ) -> tuple[TruthJoint, tuple[TruthMuscle, TruthMuscle]]:
        """A joint and its muscles of this kind, at the size of an elbow."""
        gravity = 0.0 if self.horizontal else joint.gravity_torque
        joint = joint._replace(inertia=self.mass * joint.inertia, gravity_torque=gravity)
        one = muscle._replace(sonic_conductance=self.flow * muscle.sonic_conductance)
        if self.regulator_time > 0.0:
            one = one._replace(regulator=INNER_GAIN, time_constant=self.regulator_time)
        lengths = ("thread_length", "rest_length", "neutral_length")
        return joint, (one, one._replace(**{n: self.second * getattr(one, n) for n in lengths}))

    def joint(self, joint: TruthJoint) -> TruthJoint:
        """The joint at its true size."""
        return joint._replace(
            **{n: getattr(joint, n) * self.scale**power for n, power in JOINT_POWERS.items()}
        )

    def muscle(self, muscle: TruthMuscle) -> TruthMuscle:
        """A muscle at its true size."""
        return muscle._replace(
            **{n: getattr(muscle, n) * self.scale**power for n, power in MUSCLE_POWERS.items()}
        )

    def sensors(self, sensors: Sensors) -> Sensors:
        """Sensors whose load cells suit the forces."""
        force = self.scale**2
        return replace(
            sensors,
            force_noise=force * sensors.force_noise,
            force_drift=force * sensors.force_drift,
        )

    def motion(self, motion: PressureExcitation, random: np.random.Generator) -> PressureExcitation:
        """A motion that suits the valves, and is slow on a rig with slow motions."""
        motion = replace(motion, proportional=motion.proportional / self.flow)
        if not self.slow:
            return motion
        time = np.arange(motion.level.size) * motion.sample_time
        rates = np.exp(random.uniform(math.log(0.02), math.log(0.12), 3))
        phases = random.uniform(0.0, 2.0 * math.pi, 3)
        wave = np.sin(2.0 * math.pi * np.outer(time, rates) + phases).sum(axis=1)
        wave *= np.clip((time - 1.0) / 2.0, 0.0, 1.0) / np.max(np.abs(wave))
        return replace(
            motion,
            difference=wave * np.max(np.abs(motion.difference)),
            reference_position=wave * np.max(np.abs(motion.reference_position)),
        )

    def logged(self, table: pd.DataFrame) -> pd.DataFrame:
        """The rows that a log keeps."""
        return table.iloc[:: self.rows]


def draw_variety(random: np.random.Generator, regulators: bool) -> Variety:
    """Draw a kind of rig; some have pressure regulators if the plant knows them."""
    is_regulated = bool(random.random() < REGULATED) and regulators
    return Variety(
        scale=math.exp(random.uniform(math.log(SMALLEST), math.log(LARGEST))),
        flow=math.exp(random.uniform(math.log(0.4), math.log(2.5))),
        mass=math.exp(random.uniform(math.log(0.5), math.log(3.0))),
        horizontal=bool(random.random() < HORIZONTAL),
        second=float(random.uniform(0.9, 1.1)) if random.random() < UNEQUAL else 1.0,
        slow=bool(random.random() < SLOW),
        rows=int(random.choice(list(SPARSE), p=list(SPARSE.values()))),
        regulator_time=float(random.uniform(0.01, 0.03)) if is_regulated else 0.0,
    )
