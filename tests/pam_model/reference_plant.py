"""A second implementation of the ideal rig, directly from its equations, for scipy's solvers."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

from pam_model.rig import Rig

RHO0, R_GAS = 1.185, 287.05


def psi(r: float, b: float) -> float:
    if r <= b:
        return 1.0
    if r <= 0.999:
        return math.sqrt(1.0 - ((r - b) / (1.0 - b)) ** 2)
    return math.sqrt(1.0 - ((0.999 - b) / (1.0 - b)) ** 2) * (1.0 - r) / 0.001


def mass_flow(c: float, b: float, p1: float, p2: float) -> float:
    if p1 >= p2:
        return c * RHO0 * p1 * psi(p2 / p1, b)
    return -c * RHO0 * p2 * psi(p1 / p2, b)


def braid(muscle, length: float) -> tuple[float, float, float]:
    """Volume, dV/dL and F/p of the cylindrical braid."""
    b, n = muscle.thread_length, muscle.turns
    k = 4.0 * math.pi * n * n
    volume = length * (b * b - length * length) / k + muscle.dead_volume
    return volume, (b * b - 3 * length * length) / k, (3 * length * length - b * b) / k


def solve(rig: Rig, commands: np.ndarray, sample_time: float, pressures, position=0.0):
    """Position and absolute pressures at the samples; the state is q, qd, (x, P) per muscle."""
    joint = rig.joints[0]
    muscles = [rig.muscle(name) for name in joint.muscles]
    gas = rig.gas
    thin = math.sqrt(293.15 / gas.temperature)

    def rates(_t, y, u):
        q, qd = y[0], y[1]
        out, forces = [], []
        for i, muscle in enumerate(muscles):
            sign = -1.0 if i == 0 else 1.0
            length = muscle.neutral_length + sign * joint.pulley_radius * q
            speed = sign * joint.pulley_radius * qd
            x, pressure = y[2 + 2 * i], y[3 + 2 * i]
            volume, slope, area = braid(muscle, length)
            valve = muscle.valve
            c, b = valve.sonic_conductance * abs(x), valve.critical_ratio
            if x > 0:
                flow = thin * mass_flow(c, b, rig.supply_pressure, pressure)
            else:
                flow = -thin * mass_flow(c, b, pressure, gas.ambient_pressure)
            out += [
                (u[i] - x) / valve.time_constant,
                gas.polytropic_exponent
                * (R_GAS * gas.temperature * flow - pressure * slope * speed)
                / volume,
            ]
            forces.append(max((pressure - gas.ambient_pressure) * area, 0.0))
        qdd = (
            joint.pulley_radius * (forces[0] - forces[1])
            - joint.viscous_friction * qd
            - joint.gravity_torque * math.sin(q - joint.gravity_angle)
        ) / joint.inertia
        return [qd, qdd, *out]

    y = np.array([position, 0.0] + [z for p in pressures for z in (0.0, p + gas.ambient_pressure)])
    rows = []
    for u in commands:
        rows.append(y)
        solution = solve_ivp(rates, (0.0, sample_time), y, args=(u,), rtol=1e-10, atol=1e-9)
        y = solution.y[:, -1]
    return np.array(rows)
