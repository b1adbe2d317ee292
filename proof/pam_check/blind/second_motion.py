"""Motion of the second plant: the rates of all states, integrated by a Runge-Kutta method (RK4).

States that an effect does not use stay at rest. Elements of dry friction stick or slip for a whole
step, because a change in the middle of a step would make it chatter.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pam_check.blind.second_laws import (
    CABLE_TOE,
    GAS_CONSTANT,
    HEAT_RATIO,
    LUMPS,
    PORT_VOLUME,
    WALL_CAPACITY,
    WALL_LOSS,
    Array,
    SecondMuscle,
    behind_silencer,
    cable_tension,
    compiled,
    edge_opening,
    gas_volume,
    heat_flow,
    hysteresis_rate,
    iso_flow,
    line_resistance,
    pull,
    regulated_flow,
)


class SecondJoint(NamedTuple):
    """Numbers of the joint, its supply and its pulley, as the laws need them (SI units)."""

    pulley_radius: float
    inertia: float
    viscous_friction: float
    gravity_torque: float
    gravity_angle: float
    lower_limit: float
    upper_limit: float
    temperature: float
    ambient: float
    supply: float
    sliding: float
    breaking: float
    stribeck_speed: float
    presliding: float
    reservoir: float
    reservoir_conductance: float
    oval: float
    """Amplitude of the radius of a pulley that is not round."""
    ripple: float
    cross_leak: float
    """kg/(s Pa^2)"""
    gap: float


# of the joint
Q, SPEED, PULLEY, PULLEY_SPEED, RESERVOIR, ASPERITIES = range(6)
SHARES = (0.1, 0.2, 0.3, 0.4)
BREAKS = (0.3, 0.7, 1.3, 2.5)  # of the presliding angle
OF_JOINT = ASPERITIES + len(SHARES)
# of each muscle
SPOOL, SPOOL_SPEED, PRESSURE, GAS, WALL, HYSTERESIS, CREEP = range(7)
LENGTH, NODES = CREEP + 3, CREEP + 4
FLOWS = NODES + LUMPS
SEEN = FLOWS + LUMPS  # two states of the sensor's filter
OF_MUSCLE = SEEN + 2
STATES = OF_JOINT + 2 * OF_MUSCLE

SLIP_TIME = 5e-3  # s
CREEP_TIMES = (1.0, 12.0, 150.0)  # s: two Kelvin-Voigt elements, and the dashpot
CABLE_TIME = 2e-3  # s
SPOOL_DAMPING = 0.7
RIPPLES = 9  # a turn
GAP_STIFFNESS, GAP_DAMPING, PULLEY_SHARE = 600.0, 0.6, 0.05
STOP_STIFFNESS, STOP_DAMPING = 1500.0, 3000.0


@compiled
def sliding_torque(joint: SecondJoint, speed: float) -> float:
    """Dry friction of steady sliding [N m]."""
    over = speed / joint.stribeck_speed
    return joint.sliding + (joint.breaking - joint.sliding) / (1.0 + over * over)


@compiled
def wound(joint: SecondJoint, angle: float) -> float:
    """Length of cable on the pulley [m]."""
    return joint.pulley_radius * angle + 0.5 * joint.oval * (1.0 - math.cos(2.0 * angle))


@compiled
def tension(joint: SecondJoint, m: SecondMuscle, y: Array, at: int, sign: float) -> float:
    """Pull of the muscle with its states from `at` on [N]."""
    angle = y[PULLEY] if joint.gap > 0.0 else y[Q]
    length = y[at + LENGTH] if m.cable > 0.0 else m.neutral_length - sign * wound(joint, angle)
    crept = y[at + CREEP] + y[at + CREEP + 1] + y[at + CREEP + 2]
    gauge = y[at + PRESSURE] - joint.ambient
    return pull(m, gauge, length, y[at + HYSTERESIS], crept, m.neutral_length)


@compiled
def sensed_pressure(m: SecondMuscle, y: Array, at: int) -> float:
    """Absolute pressure at the sensor, which is at the valve's end of a tube [Pa]."""
    return float(y[at + NODES] if m.tube_length > 0.0 else y[at + PRESSURE])


@compiled
def tube_rates(
    m: SecondMuscle, y: Array, at: int, entering: float, kelvin: float, dy: Array
) -> float:
    """Set the rates of the lumps of a tube; return the flow into the muscle [kg/s]."""
    area = 0.25 * math.pi * m.tube_diameter**2
    piece = m.tube_length / LUMPS
    warm = GAS_CONSTANT * kelvin
    for j in range(LUMPS):
        here = y[at + NODES + j]
        after = y[at + NODES + j + 1] if j + 1 < LUMPS else y[at + PRESSURE]
        flow = y[at + FLOWS + j]
        density = 0.5 * (here + after) / warm
        stopping = line_resistance(flow, density, m.tube_diameter)
        dy[at + FLOWS + j] = area / piece * (here - after) - stopping * flow
        before = entering if j == 0 else y[at + FLOWS + j - 1]
        volume = PORT_VOLUME + 0.5 * area * piece if j == 0 else area * piece
        dy[at + NODES + j] = warm * (before - flow) / volume
    return float(y[at + FLOWS + LUMPS - 1])


@compiled
def spool_rates(m: SecondMuscle, y: Array, at: int, command: float, dy: Array) -> None:
    """Set the rates of a spool that moves when its error is larger than its friction."""
    error = command - y[at + SPOOL]
    moving = error - min(max(error, -m.spool_friction), m.spool_friction)
    if m.spool_frequency > 0.0:
        w = m.spool_frequency
        dy[at + SPOOL] = y[at + SPOOL_SPEED]
        dy[at + SPOOL_SPEED] = w * w * moving - 2.0 * SPOOL_DAMPING * w * y[at + SPOOL_SPEED]
    else:
        dy[at + SPOOL] = moving / m.time_constant


@compiled
def gas_rates(
    joint: SecondJoint, m: SecondMuscle, y: Array, at: int, length: float, speed: float,
    enter: float, leave: float, dy: Array,
) -> None:  # fmt: skip
    """Set the rates of the gas in a muscle, with mass flows in and out (both at least 0)."""
    kelvin = joint.temperature
    p, gas = y[at + PRESSURE], y[at + GAS]
    volume, by_length, by_pressure = gas_volume(m, p - joint.ambient, length)
    if m.heat <= 0.0:
        rate = GAS_CONSTANT * kelvin * (enter - leave) - p * by_length * speed
        dy[at + PRESSURE] = rate / (volume + p * by_pressure)
        return
    k, wall = HEAT_RATIO, y[at + WALL]
    heat = heat_flow(m, p, gas, wall, kelvin)
    carried = k * GAS_CONSTANT * (enter * kelvin - leave * gas) + (k - 1.0) * heat
    rate = (carried - k * p * by_length * speed) / (volume + k * p * by_pressure)
    grows = by_length * speed + by_pressure * rate
    dy[at + PRESSURE] = rate
    mass = p * volume / (GAS_CONSTANT * gas)
    dy[at + GAS] = gas * (rate / p + grows / volume - (enter - leave) / mass)
    dy[at + WALL] = (WALL_LOSS * (kelvin - wall) - heat) / WALL_CAPACITY


@compiled
def muscle_rates(
    joint: SecondJoint, muscles: tuple[SecondMuscle, SecondMuscle], i: int, y: Array,
    command: float, source: float, wound_up: float, arm: float, angle_speed: float, dy: Array,
) -> tuple[float, float]:  # fmt: skip
    """Set the rates of one muscle; return its torque [N m] and what it draws [kg/s]."""
    m = muscles[i]
    sign = 1.0 - 2.0 * i
    at, other = OF_JOINT + i * OF_MUSCLE, OF_JOINT + (1 - i) * OF_MUSCLE
    kelvin, p = joint.temperature, y[at + PRESSURE]
    force = tension(joint, m, y, at, sign)
    length, speed = m.neutral_length - sign * wound_up, -sign * arm * angle_speed
    if m.cable > 0.0:
        stretch = length - y[at + LENGTH]
        damping = CABLE_TIME * CABLE_TOE / m.cable * math.exp(min(max(stretch / m.cable, 0.0), 8.0))
        speed -= (force - cable_tension(m, stretch)) / damping
        length = y[at + LENGTH]
        dy[at + LENGTH] = speed
    spool_rates(m, y, at, command, dy)
    opened = y[at + SPOOL] - m.null
    feeding = m.conductance * edge_opening(opened, m.overlap)
    venting = m.conductance * behind_silencer(edge_opening(-opened, m.overlap), m.silencer)
    node = sensed_pressure(m, y, at)
    gas = y[at + GAS] if m.tube_length <= 0.0 else kelvin
    drawn = iso_flow(feeding, source, node, kelvin, gas, m.critical_ratio)
    vented = iso_flow(venting, node, joint.ambient, gas, kelvin, m.critical_ratio)
    if m.tube_length > 0.0:
        arriving = tube_rates(m, y, at, drawn - vented, kelvin, dy)
        enter, leave = max(arriving, 0.0), max(-arriving, 0.0)
    else:
        enter = max(drawn, 0.0) + max(-vented, 0.0)
        leave = max(vented, 0.0) + max(-drawn, 0.0)
    leave += m.leak * max(p * p - joint.ambient * joint.ambient, 0.0)
    across = joint.cross_leak * (y[other + PRESSURE] ** 2 - p * p)
    enter, leave = enter + max(across, 0.0), leave + max(-across, 0.0)
    gas_rates(joint, m, y, at, length, speed, enter, leave, dy)
    dy[at + HYSTERESIS] = hysteresis_rate(m, y[at + HYSTERESIS], speed)
    if m.creep_stiffness > 0.0:
        crept = y[at + CREEP] + y[at + CREEP + 1] + y[at + CREEP + 2]
        spring = length - m.neutral_length - crept
        for j in range(2):
            goal = m.creep_share * spring
            dy[at + CREEP + j] = (goal - y[at + CREEP + j]) / CREEP_TIMES[j]
        dy[at + CREEP + 2] = spring / CREEP_TIMES[2]
    return sign * arm * force, drawn


@compiled
def rates(
    joint: SecondJoint, muscles: tuple[SecondMuscle, SecondMuscle], y: Array,
    command_a: float, command_b: float, supply: float, stuck: Array, dy: Array,
) -> None:  # fmt: skip
    """Set the rates `dy` of all states."""
    dy[:] = 0.0
    speed = y[SPEED]
    angle, turning = (y[PULLEY], y[PULLEY_SPEED]) if joint.gap > 0.0 else (y[Q], speed)
    arm = joint.pulley_radius + joint.oval * math.sin(2.0 * angle)
    up = wound(joint, angle)
    source = y[RESERVOIR] if joint.reservoir > 0.0 else supply
    torque_a, drawn_a = muscle_rates(joint, muscles, 0, y, command_a, source, up, arm, turning, dy)
    torque_b, drawn_b = muscle_rates(joint, muscles, 1, y, command_b, source, up, arm, turning, dy)
    driving = torque_a + torque_b
    if joint.reservoir > 0.0:
        fed = regulated_flow(joint.reservoir_conductance, supply, source)
        taken = drawn_a + drawn_b
        dy[RESERVOIR] = GAS_CONSTANT * joint.temperature * (fed - taken) / joint.reservoir
    slowing = joint.viscous_friction * speed
    slowing += joint.gravity_torque * math.sin(y[Q] - joint.gravity_angle)
    if joint.breaking > 0.0:
        slides = sliding_torque(joint, speed)
        for j in range(len(SHARES)):
            slowing += y[ASPERITIES + j]
            if stuck[j] == 0.0:
                stiffness = SHARES[j] * joint.breaking / (BREAKS[j] * joint.presliding)
                dy[ASPERITIES + j] = stiffness * speed
            else:
                goal = SHARES[j] * slides * stuck[j]
                dy[ASPERITIES + j] = (goal - y[ASPERITIES + j]) / SLIP_TIME
    if joint.ripple > 0.0:
        slowing += joint.ripple * 2.0 / math.pi * math.asin(math.sin(RIPPLES * y[Q]))
    beyond = max(y[Q] - joint.upper_limit, 0.0) + min(y[Q] - joint.lower_limit, 0.0)
    slowing += beyond * STOP_STIFFNESS + abs(beyond) * STOP_DAMPING * speed
    dy[Q] = speed
    if joint.gap > 0.0:
        twist = angle - y[Q]
        half = 0.5 * joint.gap
        wedge = twist - min(max(twist, -half), half)
        passed = GAP_STIFFNESS * wedge
        if wedge != 0.0:
            passed += GAP_DAMPING * (turning - speed)
        dy[PULLEY] = turning
        dy[PULLEY_SPEED] = (driving - passed) / (PULLEY_SHARE * joint.inertia)
        dy[SPEED] = (passed - slowing) / ((1.0 - PULLEY_SHARE) * joint.inertia)
    else:
        dy[SPEED] = (driving - slowing) / joint.inertia


@compiled
def stick_or_slip(joint: SecondJoint, y: Array, stuck: Array) -> None:
    """Decide for each element of dry friction whether it sticks (0) or where it slips (-1, 1)."""
    slides = sliding_torque(joint, y[SPEED])
    for j in range(len(SHARES)):
        if stuck[j] == 0.0:
            if abs(y[ASPERITIES + j]) > SHARES[j] * slides:
                stuck[j] = 1.0 if y[ASPERITIES + j] > 0.0 else -1.0
        elif stuck[j] * y[SPEED] <= 0.0:
            stuck[j] = 0.0


@compiled
def advance(
    joint: SecondJoint, muscles: tuple[SecondMuscle, SecondMuscle], y: Array,
    command_a: float, command_b: float, supply: float, step: float, stuck: Array, work: Array,
) -> None:  # fmt: skip
    """Move all states on by one step [s]; `work` has shape (5, STATES)."""
    trial = work[4]
    rates(joint, muscles, y, command_a, command_b, supply, stuck, work[0])
    for stage in range(1, 4):
        part = step if stage == 3 else 0.5 * step
        for k in range(STATES):
            trial[k] = y[k] + part * work[stage - 1, k]
        rates(joint, muscles, trial, command_a, command_b, supply, stuck, work[stage])
    for k in range(STATES):
        slope = work[0, k] + 2.0 * (work[1, k] + work[2, k]) + work[3, k]
        y[k] += step / 6.0 * slope
    if joint.breaking > 0.0:
        stick_or_slip(joint, y, stuck)


def at_rest(
    joint: SecondJoint, muscles: tuple[SecondMuscle, SecondMuscle], gauge: tuple[float, float]
) -> Array:
    """States at position 0 with these pressures in the muscles [Pa gauge]."""
    y = np.zeros(STATES)
    y[RESERVOIR] = joint.supply
    for i, m in enumerate(muscles):
        at = OF_JOINT + i * OF_MUSCLE
        y[at + PRESSURE] = y[at + NODES : at + FLOWS] = gauge[i] + joint.ambient
        y[at + GAS] = y[at + WALL] = joint.temperature
        y[at + SEEN] = gauge[i]
        y[at + LENGTH] = m.neutral_length
    return y
