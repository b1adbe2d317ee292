"""The ordinary background of a good rig: a little of everything, each part harmless.

Sizes are those of data sheets and of measurements in the literature, not of any model's fit:

- Thread friction of 0.5 to 1.5 % of the pull and bladder creep of 0.5 to 1.5 % of it: what is left
  of the several per cent of a plain braid when it is lubricated (Davis and Caldwell, Int. J. Rob.
  Res. 25(4), 2006; Minh et al., Mechatronics 20, 2010).
- Dry friction of 0.1 to 0.4 % of the holding torque: rolling bearings have mu = 0.0015 on their
  bore (SKF, Rolling Bearings, 2018), seals and the cable on its pulley have as much again.
- Spool hysteresis of 0.5 to 1 % peak to peak, and spool leakage of 0.05 to 0.3 % of the open
  conductance: data sheets of proportional directional valves (Festo MPYE: 0.4 % hysteresis).
- Pressure regulators: zero and gain off by 0.1 to 0.5 %, hysteresis as that of the spools (data
  sheets state +-1 % linearity and 0.5 to 1 % hysteresis).
- Pressure sensor: nonlinearity 0.1 to 0.3 % of full scale, zero drift 0.02 to 0.1 % in a minute
  (data sheets of silicon sensors: +-0.25 % of span), coloured noise of 0.5 to 2 times the white
  noise with a corner at 2 to 20 Hz (turbulence at the tap and ground loops).
- Encoder: eccentricity of 10 to 20 um on a ring of 25 to 50 mm radius is 0.2 to 0.8 mrad; drift of
  its bracket 0.05 to 0.3 mrad.
- Supply: the hysteresis of a compressor's pressure switch behind a regulator leaves 0.3 to 1.5 % in
  5 to 40 s, and the strokes leave a ripple of 0.05 to 0.3 % at 8 to 25 Hz.
- Numbers: off by up to the stated tolerance; lengths are measured ten times better.
"""

from __future__ import annotations

import math

import numpy as np

from pam_check.blind.draw import Draw
from pam_check.blind.effect_cases import KNOWN, OUTSIDE
from pam_check.blind.truth_plant import (
    Array,
    PressureExcitation,
    Sensors,
    SupplyWander,
    TruthMuscle,
)

FULL_SCALE = 1.0e6  # Pa, of an ordinary pressure sensor
LENGTHS_BETTER = 0.1
NUMBERS = ("dead_volume", "sonic_conductance", "critical_ratio", "time_constant")
LENGTHS = ("thread_length", "turns", "neutral_length")
HOLDING_PRESSURE = 3.0e5  # Pa
LARGEST_LEAK = 0.003  # of the conductance of the open valve


def area(muscle: TruthMuscle) -> float:
    """Pull per gauge pressure at the neutral length [m^2]."""
    return (3.0 * muscle.neutral_length**2 - muscle.thread_length**2) / (
        4.0 * math.pi * muscle.turns**2
    )


def wrong_numbers(draw: Draw, tolerance: float) -> None:
    """Change the numbers of the rig file within the tolerance that it states."""
    random, joint = draw.random, draw.joint

    def off(value: float, reach: float) -> float:
        return float(value * (1.0 + reach * random.uniform(-1.0, 1.0)))

    draw.on_joint(
        **{
            name: off(getattr(joint, name), tolerance)
            for name in ("inertia", "viscous_friction", "gravity_torque")
        },
        pulley_radius=off(joint.pulley_radius, LENGTHS_BETTER * tolerance),
        supply_pressure=off(joint.supply_pressure, 0.5 * tolerance),
    )
    draw.muscles = [
        muscle._replace(
            **{n: off(getattr(muscle, n), tolerance) for n in NUMBERS},
            **{n: off(getattr(muscle, n), LENGTHS_BETTER * tolerance) for n in LENGTHS},
        )
        for muscle in draw.muscles
    ]


def add_background(draw: Draw) -> None:
    """Give the rig that is drawn a little of everything that an ordinary good rig has."""
    random, joint = draw.random, draw.joint
    near = area(draw.muscles[0])

    def off(value: float, reach: float) -> float:
        return float(value * (1.0 + reach * random.uniform(-1.0, 1.0)))

    stroke = 0.3 * joint.pulley_radius
    holding = joint.pulley_radius * near * HOLDING_PRESSURE
    creep_share, friction_share = draw.span(0.005, 0.015), draw.span(0.005, 0.015)
    play, leak = draw.span(0.0025, 0.005), draw.span(0.0005, LARGEST_LEAK)
    muscles = []
    for muscle in draw.muscles:
        diameter = math.sqrt(muscle.thread_length**2 - muscle.neutral_length**2) / (
            math.pi * muscle.turns
        )
        lateral = math.pi * diameter * muscle.neutral_length
        changed = {
            "thread_friction": off(friction_share, 0.2) * near / lateral,
            "play_length": draw.span(3e-4, 2e-3),
            "creep_stiffness": off(creep_share, 0.2) * near * HOLDING_PRESSURE / stroke / 3.0,
            "creep_order": draw.span(0.15, 0.4),
            "spool_hysteresis": off(play, 0.2),
            "leak": min(off(leak, 0.5), LARGEST_LEAK) * muscle.sonic_conductance,
            "pressure_curvature": draw.sign() * draw.span(0.001, 0.003),
        }
        if muscle.regulator > 0.0:
            gauge = joint.supply_pressure - joint.ambient_pressure
            changed["regulator_zero"] = draw.sign() * draw.span(0.001, 0.005) * gauge
            changed["regulator_gain"] = 1.0 + draw.sign() * draw.span(0.001, 0.005)
        muscles.append(muscle._replace(**changed))
    draw.muscles = muscles
    friction = draw.span(0.001, 0.004) * holding
    draw.on_joint(
        coulomb_torque=friction,
        static_torque=friction * random.uniform(1.0, 1.3),
        encoder_eccentricity=draw.span(2e-4, 8e-4),
    )


def background_sensors(draw: Draw, plain: Sensors) -> Sensors:
    """Sensors with coloured noise and drifting zeros beside their white noise."""
    return Sensors(
        pressure_noise=plain.pressure_noise,
        pressure_step=plain.pressure_step,
        position_noise=plain.position_noise,
        position_step=plain.position_step,
        force_noise=plain.force_noise,
        command_step=plain.command_step,
        pressure_colour=plain.pressure_noise * draw.span(0.5, 2.0),
        pressure_corner=draw.span(2.0, 20.0),
        pressure_drift=FULL_SCALE * draw.span(2e-4, 1e-3),
        position_drift=draw.span(5e-5, 3e-4),
        force_drift=draw.span(0.5, 3.0),
    )


def background_supply(draw: Draw) -> SupplyWander:
    """A compressor that switches, and its strokes."""
    return SupplyWander(
        wander=draw.span(0.003, 0.015),
        period=draw.span(5.0, 40.0),
        ripple=draw.span(5e-4, 3e-3),
        frequency=draw.span(8.0, 25.0),
    )


def background_motion(draw: Draw, excitation: PressureExcitation) -> PressureExcitation:
    """One motion in three is replaced by one of other kinds: ramps with holds, or a chirp."""
    kind = draw.random.choice(["drawn", "drawn", "drawn", "ramps", "chirp"])
    if kind == "drawn":
        return excitation
    n, dt = excitation.level.size, excitation.sample_time
    time = np.arange(n) * dt
    wave: Array
    if kind == "ramps":
        hold, rise = draw.random.uniform(0.6, 2.0), draw.random.uniform(0.5, 2.0)
        knots = np.arange(0.0, float(time[-1]) + hold + rise, hold + rise)
        goals = draw.random.uniform(-1.0, 1.0, knots.size + 1)
        at = np.minimum((time / (hold + rise)).astype(int), knots.size - 1)
        part = np.clip((time - knots[at] - hold) / rise, 0.0, 1.0)
        wave = goals[at] + (goals[at + 1] - goals[at]) * part
    else:
        low, high = 0.05, draw.span(0.8, 2.5)
        duration = float(time[-1])
        phase = low * time + 0.5 * (high - low) / duration * time**2
        wave = np.sin(2.0 * math.pi * phase) / (1.0 + time / duration)
    wave = wave * np.clip((time - 1.0) / 0.5, 0.0, 1.0)
    largest = max(float(np.max(np.abs(wave))), 1e-9)
    return PressureExcitation(
        level=excitation.level,
        difference=wave * (float(np.max(np.abs(excitation.difference))) / largest),
        reference_position=wave * (float(np.max(np.abs(excitation.reference_position))) / largest),
        sample_time=dt,
        proportional=excitation.proportional,
        integral=excitation.integral,
        position_gain=excitation.position_gain,
    )


LEAST_LEFT = 0.3
MOST_ENDS = 1.4
"""Contraction over that of a cylinder; the ends of a muscle take 29 % of its length then."""


def weaker(draw: Draw, plain: Draw, share: float) -> Draw:
    """The drawn rig with its effects changed to `share` of their size above `plain`.

    A number that an effect makes smaller, such as the conductance of the exhaust, keeps at least
    `LEAST_LEFT` of its value, because beyond that the rig could not run. Ends of a muscle take no
    more than `MOST_ENDS`.
    """
    magnitudes = {name for case in (KNOWN | OUTSIDE).values() for name in case.magnitudes}

    def between(small: dict[str, float], large: dict[str, float]) -> dict[str, float]:
        changed = dict(large)
        for name in large.keys() & magnitudes:
            value = small[name] + share * (large[name] - small[name])
            if 0.0 < large[name] < small[name]:
                value = max(value, LEAST_LEFT * small[name])
            if name == "end_factor":
                value = min(value, MOST_ENDS)
            changed[name] = value
        return changed

    joint = draw.joint._replace(**between(plain.joint._asdict(), draw.joint._asdict()))
    muscles = [
        large._replace(**between(small._asdict(), large._asdict()))
        for small, large in zip(plain.muscles, draw.muscles, strict=True)
    ]
    return Draw(draw.random, joint, muscles)
