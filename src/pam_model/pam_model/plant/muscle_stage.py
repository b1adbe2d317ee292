"""The muscle: pull and gas volume as functions of pressure and length, with the effects.

The nominal muscle is the cylinder with a wall of constant thickness, F = p A(L), A = -dV/dL, or a
table of any other force model. Effects stretch the threads, add passive pulls, and add pulls with
a dynamic state (hysteresis, creep). Pressures here are gauge.
"""

from __future__ import annotations

import math
from typing import Any

from pam_model.effects.end_caps import length_inside_caps
from pam_model.plant.compiled import compiled
from pam_model.plant.composition import memory_pull, memory_response, passive_pull, thread
from pam_model.plant.layout import (
    M_B,
    M_CABLE,
    M_D90,
    M_DEAD,
    M_FACTOR,
    M_LONGEST,
    M_PER_B,
    M_REST,
    M_SCALE,
    M_SHORTEST,
    M_TABLE,
    M_TABLE_STEP,
    M_THREAD,
    M_THRESHOLD,
    M_WALL,
)


@compiled
def cubic_row(row: Any, place: float, step: float) -> tuple[float, float]:
    """Value and slope at `place` (in cells) in a row of pairs (value, slope times step)."""
    cell = min(int(place), len(row) // 2 - 2)
    x = place - cell
    y0, s0, y1, s1 = row[2 * cell], row[2 * cell + 1], row[2 * cell + 2], row[2 * cell + 3]
    a = 2.0 * (y0 - y1) + s0 + s1
    b = 3.0 * (y1 - y0) - 2.0 * s0 - s1
    return y0 + x * (s0 + x * (b + x * a)), (s0 + x * (2.0 * b + 3.0 * a * x)) / step


@compiled
def table_force(
    m: int, c: Any, table: Any, pressure: float, length: float
) -> tuple[float, float, float]:
    """Pull, dF/dL, dF/dp from a table: cubic in length, linear in pressure."""
    rows = len(table) - 1
    step = (c[m + M_LONGEST] - c[m + M_SHORTEST]) / (len(table[0]) // 2 - 1)
    place = (length - c[m + M_SHORTEST]) / step
    level = pressure / c[m + M_TABLE_STEP]
    row = int(max(level, 0.0))
    row = min(row, rows - 2)
    share = level - row
    low, low_slope = cubic_row(table[row + 1], place, step)
    high, high_slope = cubic_row(table[row + 2], place, step)
    return (
        low + share * (high - low),
        low_slope + share * (high_slope - low_slope),
        (high - low) / c[m + M_TABLE_STEP],
    )


@compiled
def braid_force(
    m: int, c: Any, table: Any, pressure: float, length: float
) -> tuple[float, float, float]:
    """Pull without friction, creep or cable [N], its dF/dL [N/m] and dF/dp [m^2]."""
    effective = length_inside_caps(length, c[m + M_REST], c[m + M_FACTOR])
    b = c[m + M_B]
    pulling = pressure - c[m + M_THRESHOLD]
    if c[m + M_TABLE] > 0.0:
        effective = min(max(effective, c[m + M_SHORTEST]), c[m + M_LONGEST])
        force, slope, area = table_force(m, c, table, pulling, effective)
        slope *= c[m + M_FACTOR]
    else:
        scale = c[m + M_SCALE]
        area = (3.0 * effective * effective - b * b) * scale
        area_slope = 6.0 * effective * scale
        wall = c[m + M_WALL]
        if wall > 0.0:
            cosine = min(effective * c[m + M_PER_B], 0.999999)
            sine = math.sqrt(1.0 - cosine * cosine)
            cosecant = 1.0 / sine
            slope_by_b = cosine * cosecant * (2.0 + cosecant * cosecant)
            area += math.pi * wall * (c[m + M_D90] * (2.0 * sine - cosecant) - wall)
            area_slope -= math.pi * wall * c[m + M_D90] * c[m + M_PER_B] * slope_by_b
        force = pulling * area
        slope = pulling * area_slope * c[m + M_FACTOR]
    if c[m + M_THREAD] > 0.0:
        stretched, by_pressure, by_length = thread(m, c, pressure, length)
        scale = c[m + M_SCALE]
        force += pressure * (b * b - stretched * stretched) * scale
        slope -= 2.0 * pressure * stretched * by_length * scale
        area += (b * b - stretched * stretched - 2.0 * pressure * stretched * by_pressure) * scale
    passive, passive_slope = passive_pull(m, c, length)
    return force + passive, slope + passive_slope, area


@compiled
def gas_volume(
    m: int, c: Any, table: Any, pressure: float, length: float
) -> tuple[float, float, float]:
    """Gas volume with dead volume [m^3], dV/dL [m^2] and dV/dp [m^3/Pa]."""
    b = c[m + M_B]
    scale = c[m + M_SCALE]
    by_pressure = 0.0
    if c[m + M_TABLE] > 0.0:
        step = (c[m + M_LONGEST] - c[m + M_SHORTEST]) / (len(table[0]) // 2 - 1)
        volume, slope = cubic_row(table[0], (length - c[m + M_SHORTEST]) / step, step)
    else:
        square = b * b - length * length
        volume = length * square * scale
        slope = (b * b - 3.0 * length * length) * scale
        wall = c[m + M_WALL]
        if wall > 0.0:
            # (pi/4)(D - 2 t)^2 L = thin - pi t L (D - t)
            per_root = c[m + M_D90] * c[m + M_PER_B]
            root = math.sqrt(max(square, 1e-12))
            diameter = per_root * root
            volume -= math.pi * wall * length * (diameter - wall)
            diameter_slope = -per_root * length / root
            slope -= math.pi * wall * (diameter - wall + length * diameter_slope)
    if c[m + M_THREAD] > 0.0:
        stretched, b_by_pressure, b_by_length = thread(m, c, pressure, length)
        grown = stretched * stretched - b * b
        volume += length * grown * scale
        slope += (grown + 2.0 * length * stretched * b_by_length) * scale
        by_pressure = 2.0 * length * stretched * b_by_pressure * scale
    return volume + c[m + M_DEAD], slope, by_pressure


@compiled
def pull(
    m: int,
    c: Any,
    table: Any,
    y: Any,
    o: int,
    pressure: float,
    path: float,
) -> tuple[float, float, float, float]:
    """Pull on the cable and length of the muscle.

    `y` holds the state; the part of this muscle begins at index `o`.

    Returns
    -------
    force : float
        Pull [N], never below 0.
    length : float
        Of the muscle [m]: its path minus the stretch of the cable.
    slope : float
        dF/dL [N/m]; 0 if the muscle is slack.
    area : float
        dF/dp [m^2]; 0 if the muscle is slack.
    """
    compliance = c[m + M_CABLE]
    held, held_area = memory_pull(m, c, y, o, pressure)
    length = min(max(path, c[m + M_SHORTEST]), c[m + M_LONGEST])
    force, slope, area = braid_force(m, c, table, pressure, length)
    force += held
    area += held_area
    if force <= 0.0:
        return 0.0, length, 0.0, 0.0
    if compliance > 0.0:
        # Newton steps for L = path - compliance F(L) converge from the path, since F rises with L.
        for _ in range(4):
            error = length + compliance * force - path
            length -= error / (1.0 + compliance * max(slope, 0.0))
            length = min(max(length, c[m + M_SHORTEST]), c[m + M_LONGEST])
            force, slope, area = braid_force(m, c, table, pressure, length)
            force += held
            area += held_area
        force = max(force, 0.0)
    return force, length, slope, area


@compiled
def muscle_speed(
    m: int,
    c: Any,
    y: Any,
    o: int,
    path_speed: float,
    free_pressure_rate: float,
    slope: float,
    area: float,
    gas_slope: float,
    pressure: float,
) -> float:
    """dL/dt of the muscle [m/s]; equal to that of the path without a compliant cable.

    It is the time derivative of L + compliance F = path; F includes the pull of hysteresis and
    creep. `gas_slope` is dp/dL of the shut chamber [Pa/m].
    """
    compliance = c[m + M_CABLE]
    if compliance <= 0.0:
        return path_speed
    longer, shorter, drift = memory_response(m, c, y, o, pressure)
    speed = path_speed - compliance * (area * free_pressure_rate + drift)
    rise = slope + area * gas_slope + (longer if speed >= 0.0 else shorter)
    return float(speed / (1.0 + compliance * max(rise, 0.0)))
