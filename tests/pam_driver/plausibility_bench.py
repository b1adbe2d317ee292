"""Pressures and torques that physics expects, on the simulated plant and by hand calculation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from pam_driver.safety.pressure_plausibility import OBSERVER_GAIN, Deviation, PressurePlausibility
from pam_model.gas import valve_flow
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import Plant, initial_state
from pam_model.rig import Plausibility, Rig
from pam_model.robot import compose

PERIOD = 0.002
SHARP = Plausibility(pressure_residual=1e3, torque_share=0.25, warning_share=1e-6)
UNKNOWN = [math.nan, math.nan]
Spoil = Callable[[float, list[float]], list[float]]


def worst(
    rig: Rig,
    *,
    effects: dict[str, float] | None = None,
    told: Spoil = lambda time, commands: commands,
    shown: Spoil = lambda time, pressures: pressures,
    goal: tuple[float, float] = (2e5, 2e5),
    duration: float = 2.0,
    swing_size: float = 0.12,
    settled: float = 0.0,
) -> dict[tuple[str, str], float]:
    """The greatest deviation by kind and subject; `told` is what valves do instead.

    What is shown in the first `settled` seconds does not count: the observer starts with a vented
    valve, the plant with a closed one.
    """
    plausibility = PressurePlausibility(compose(rig), PERIOD)
    parameters = PlantParameters.from_rig(rig).replaced(effects or {})
    plant = Plant(parameters, state=initial_state(parameters, pressures=(2e5, 2e5)))
    found: dict[tuple[str, str], float] = {}
    pressures, position = [2e5, 2e5], 0.0
    for k in range(round(duration / PERIOD)):
        time = k * PERIOD
        swing = swing_size * math.sin(2.0 * math.pi * 1.2 * time)
        commands = [
            max(-1.0, min(1.0, 2e-6 * (g - p) + s))
            for g, p, s in zip(goal, pressures, (swing, -swing), strict=True)
        ]
        before = position
        position, *true = plant.step(told(time, list(commands)), PERIOD)
        pressures = list(true)
        velocity = (position - before) / PERIOD
        plausibility.update(
            commands, shown(time, list(pressures)), [position], [velocity], [math.nan] * 2
        )
        for one in plausibility.deviations() if time >= settled else ():
            key = (one.kind, one.subject)
            found[key] = max(found.get(key, 0.0), one.size)
    return found


def observed(
    rig: Rig,
    command: float,
    pressure: float,
    position: float,
    velocity: float,
    supply: float = math.nan,
    steps: int = 6,
) -> dict[str, float]:
    """Residuals [Pa] after some steps with the same inputs, by muscle.

    The pressure of the other muscle is unknown, so that the pair of both is not judged.
    """
    sizes = {}
    for place, name in enumerate(rig.muscle_names):
        plausibility = PressurePlausibility(compose(replace(rig, plausibility=SHARP)), PERIOD)
        pressures = [pressure if place == other else math.nan for other in range(2)]
        for _ in range(steps):
            plausibility.update([command] * 2, pressures, [position], [velocity], [supply, supply])
        found = {one.subject: one for one in plausibility.deviations()}
        if name not in found:
            sizes[name] = 0.0
            continue
        residual = float(
            found[name].text.split(" Pa from")[0].removeprefix("pressure deviates by ")
        )
        assert abs(residual) == pytest.approx(found[name].size * 1e3, abs=0.51)
        sizes[name] = math.copysign(found[name].size * 1e3, residual)
    return sizes


def by_hand(
    rig: Rig,
    name: str,
    command: float,
    pressure: float,
    position: float,
    velocity: float,
    supply: float,
    steps: int = 6,
) -> float:
    """The same from the gas equations and the muscle's own volume."""
    joint, muscle = rig.joints[0], rig.muscle(name)
    lever = joint.pulley_radius * (-1.0 if name == joint.agonist else 1.0)
    low, high = joint.position_limits
    model = rig.force_model(name)
    length = muscle.neutral_length + lever * min(max(position, low), high)
    volume = float(model.volume(length)) + muscle.dead_volume
    slope = float(model.volume(length + 1e-5) - model.volume(length - 1e-5)) / 2e-5
    growth = slope * lever * velocity if low < position < high else 0.0
    valve, ambient = muscle.valve, rig.gas.ambient_pressure
    measured = inside = pressure + ambient
    spool = -1.0 if valve.kind == "flow" else 0.0
    residual = 0.0
    for step in range(1, steps + 1):
        spool = command + math.exp(-PERIOD / valve.time_constant) * (spool - command)
        opening = min(max(spool, -1.0), 1.0)
        if valve.kind != "flow":  # the step response of two equal poles, from 0
            x = step * PERIOD / valve.time_constant
            spool = command * (1.0 - (1.0 + x) * math.exp(-x))
            opening = min(max((spool * valve.full_scale + ambient - inside) / 2e4, -1.0), 1.0)
        flow = valve_flow(
            opening,
            inside,
            supply_pressure=supply,
            ambient_pressure=ambient,
            conductance=valve.sonic_conductance,
            critical_ratio=valve.critical_ratio,
            temperature=rig.gas.temperature,
        )
        # n R T m'/V - n p V'/V, of air
        exponent, gas_constant = rig.gas.polytropic_exponent, 287.0
        rate = exponent * (gas_constant * rig.gas.temperature * flow - inside * growth) / volume
        residual = measured - inside
        inside += PERIOD * (rate + OBSERVER_GAIN * residual)
    return residual


def regulated(rig: Rig) -> Rig:
    for muscle in rig.muscles:
        valve = replace(muscle.valve, kind="pressure_regulator", full_scale=6e5, time_constant=0.02)
        rig = rig.with_muscle(replace(muscle, valve=valve))
    return rig


def torque_off(
    rig: Rig, samples: list[tuple[tuple[float, float], float, float]], share: float = 1e-9
) -> Deviation | None:
    """What is said of the joint after samples of pressures, angle, angular velocity."""
    limits = Plausibility(pressure_residual=1e12, warning_share=share)
    plausibility = PressurePlausibility(compose(replace(rig, plausibility=limits)), PERIOD)
    for pressures, position, velocity in samples:
        plausibility.update([0.0, 0.0], pressures, [position], [velocity], UNKNOWN)
    return next((one for one in plausibility.deviations() if one.subject == "elbow"), None)


def static_torque(rig: Rig, pressures: tuple[float, float], position: float) -> float:
    """Of the two muscles less gravity [N m]."""
    joint = rig.joints[0]
    flexor, extensor = (rig.force_model(name) for name in joint.muscles)
    first, second = (muscle.neutral_length for muscle in rig.muscles)
    radius = joint.pulley_radius
    pull = flexor.force(pressures[0], first - radius * position)
    pull -= extensor.force(pressures[1], second + radius * position)
    weight = joint.gravity_torque * math.sin(position - joint.gravity_angle)
    return float(radius * pull - weight)


def largest_torque(rig: Rig) -> float:
    muscle, joint = rig.muscles[0], rig.joints[0]
    force = rig.force_model(muscle.name).force(muscle.max_pressure, muscle.neutral_length)
    return float(joint.pulley_radius * force)


def after_a_step(rig: Rig, first: float, second: float) -> dict[str, Deviation]:
    """What is said of two muscles at 200 kPa whose pressures step while the valves are shut."""
    plausibility = PressurePlausibility(compose(rig), PERIOD)
    for more in (0.0, 1.0):
        pressures = [2e5 + more * first, 2e5 + more * second]
        plausibility.update([0.0, 0.0], pressures, [0.0], [0.0], UNKNOWN)
    return {d.subject: d for d in plausibility.deviations() if d.kind == "pressure_implausible"}
