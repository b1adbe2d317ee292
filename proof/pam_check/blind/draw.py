"""Draws random rigs: the nominal rig, the true rig and its excitation.

The size of every hidden effect is drawn as its row in `effect_cases` says. The true parameters
differ from the nominal ones by at most the declared tolerance of the rig. Excitation, loop gains,
sample time and sensors vary from case to case.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pam_check.blind.truth_plant import (
    Array,
    PressureExcitation,
    Sensors,
    TruthJoint,
    TruthMuscle,
)

DURATION = 40.0  # s
SETTLE = 1.0  # s at rest before the motion


@dataclass
class Draw:
    """A rig that is being drawn: random generator, and the true parameters so far."""

    random: np.random.Generator
    joint: TruthJoint
    muscles: list[TruthMuscle]

    def span(self, low: float, high: float) -> float:
        """Draw a size, log-uniform."""
        return float(np.exp(self.random.uniform(math.log(low), math.log(high))))

    def sign(self) -> float:
        """Draw -1 or 1."""
        return float(self.random.choice([-1.0, 1.0]))

    def both(self, **values: float) -> None:
        """Set the same values on both muscles."""
        self.muscles = [m._replace(**values) for m in self.muscles]

    def one(self, **values: float) -> None:
        """Set values on one muscle, drawn."""
        i = int(self.random.integers(2))
        self.muscles[i] = self.muscles[i]._replace(**values)

    def on_joint(self, **values: float) -> None:
        """Set values on the joint."""
        self.joint = self.joint._replace(**values)


def believed_rig(random: np.random.Generator) -> tuple[TruthJoint, TruthMuscle]:
    """Draw the nominal rig, which the rig file describes."""
    turns = random.uniform(1.5, 2.2)
    rest_angle = math.radians(random.uniform(22.0, 27.0))
    thread = random.uniform(0.22, 0.34)
    rest = thread * math.cos(rest_angle)
    neutral = rest * random.uniform(0.88, 0.92)
    radius = random.uniform(0.025, 0.035)
    reach = min(1.0, 0.98 * (rest - neutral) / radius + 0.2)
    joint = TruthJoint(
        pulley_radius=radius,
        inertia=random.uniform(0.03, 0.09),
        viscous_friction=random.uniform(0.15, 0.4),
        gravity_torque=random.uniform(2.0, 6.0),
        gravity_angle=float(random.choice([0.0, 0.0, random.uniform(-0.4, 0.4)])),
        lower_limit=-reach,
        upper_limit=reach,
        temperature=293.15,
        ambient_pressure=101325.0,
        supply_pressure=float(random.choice([601325.0, 701325.0, 801325.0])),
    )
    muscle = TruthMuscle(
        thread_length=thread,
        turns=turns,
        rest_length=rest,
        neutral_length=neutral,
        dead_volume=random.uniform(1.5e-5, 3e-5),
        sonic_conductance=random.uniform(3e-9, 6e-9),
        critical_ratio=random.uniform(0.25, 0.4),
        time_constant=random.uniform(0.003, 0.008),
    )
    return joint, muscle


def perturbed(draw: Draw, tolerance: float) -> None:
    """Change the nominal parameters within the declared tolerance."""

    def off(value: float) -> float:
        return float(value * (1.0 + tolerance * draw.random.uniform(-1.0, 1.0)))

    draw.on_joint(
        **{
            name: off(getattr(draw.joint, name))
            for name in ("inertia", "viscous_friction", "gravity_torque")
        }
    )
    names = ("dead_volume", "sonic_conductance", "time_constant")
    draw.muscles = [m._replace(**{n: off(getattr(m, n)) for n in names}) for m in draw.muscles]


def _steps(random: np.random.Generator, count: int, low: float, high: float, dt: float) -> Array:
    values = np.empty(count)
    k = 0
    while k < count:
        hold = int(random.uniform(low, high) / dt)
        values[k : k + hold] = random.uniform(-1.0, 1.0)
        k += hold
    return values


def draw_excitation(
    random: np.random.Generator,
    joint: TruthJoint,
    sample_time: float,
    duration: float = DURATION,
) -> PressureExcitation:
    """Draw a motion: steps, sines or both, with varying co-contraction, in pressure or angle."""
    n = round(duration / sample_time)
    time = np.arange(n) * sample_time
    kind = random.choice(["steps", "sines", "both"], p=[0.3, 0.3, 0.4])
    wave = np.zeros(n)
    if kind != "steps":
        for frequency in np.exp(random.uniform(np.log(0.08), np.log(2.0), 5)):
            wave += np.sin(2 * np.pi * frequency * time + random.uniform(0, 6.28)) / (
                1.0 + frequency
            )
        wave /= np.max(np.abs(wave))
    if kind != "sines":
        steps = _steps(random, n, 0.8, 3.0, sample_time)
        wave = steps if kind == "steps" else 0.6 * wave + 0.5 * steps
    ramp = np.clip((time - SETTLE) / 0.5, 0.0, 1.0)
    level = 2.4e5 + 8.0e4 * _steps(random, n, 6.0, 14.0, sample_time)
    width = max(1, round(0.4 / sample_time))
    level = np.convolve(np.pad(level, (width, 0), mode="edge"), np.ones(width) / width, "valid")
    closed_position = random.random() < 0.4
    amplitude = random.uniform(0.5, 1.0)
    return PressureExcitation(
        level=level[:n].astype(np.float64),
        difference=(ramp * wave * amplitude * (3.0e4 if closed_position else 1.0e5)),
        reference_position=ramp * wave * amplitude * 0.5 * joint.upper_limit,
        sample_time=sample_time,
        proportional=float(random.uniform(4e-6, 8e-6)),
        integral=float(random.uniform(0.0, 1.2e-5)),
        position_gain=float(random.uniform(5e4, 1.2e5)) if closed_position else 0.0,
    )


def draw_sensors(random: np.random.Generator) -> Sensors:
    """Draw noise and resolution of the sensors."""
    return Sensors(
        pressure_noise=float(random.uniform(60.0, 250.0)),
        pressure_step=float(random.choice([61.0, 122.0, 244.0])),
        position_noise=float(random.uniform(5e-5, 3e-4)),
        position_step=2.0 * math.pi / float(random.choice([8192, 16384, 65536])),
        force_noise=float(random.uniform(0.5, 2.0)),
    )
