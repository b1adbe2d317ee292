"""One joint and its muscles: the rates of all states, from gas to motion.

This module contains the contact of dry friction and the reservoir that the joint's valves share.
The effects give the magnitude of the friction and all smooth torques.
"""

from __future__ import annotations

import math
from typing import Any

from pam_model.gas.flow import reference_flow
from pam_model.physics.dahl import dahl_rate
from pam_model.physics.joint_geometry import (
    length_per_position,
    muscle_length,
    muscle_torque,
    relative_arm,
    wound_angle,
)
from pam_model.physics.sine import sine
from pam_model.plant.compiled import compiled
from pam_model.plant.composition import dry_friction, joint_torque, memory_rates
from pam_model.plant.gas_stage import gas_rates
from pam_model.plant.layout import (
    C_AMBIENT,
    C_ARM_BEND,
    C_ARM_SLOPE,
    C_DENSITY,
    C_DRAWN,
    C_DROOP,
    C_DROOP_CONDUCTANCE,
    C_DROOP_CRITICAL,
    C_DROOP_VOLUME,
    C_EXPONENT,
    C_EXTERNAL,
    C_GRAVITY,
    C_GRAVITY_ANGLE,
    C_INERTIA,
    C_MUSCLES,
    C_PER_INERTIA,
    C_PRESLIDING,
    C_RADIUS,
    C_RT,
    C_SUPPLY,
    C_VISCOUS,
    M_ARM,
    M_CROSSED,
    M_CROSSED_SPEED,
    M_NEUTRAL,
    M_REGULATOR,
    M_SHUT_EXPONENT,
    M_THERMAL,
    M_THREAD,
    M_TUBE,
    N_MUSCLE_CONSTANTS,
    N_MUSCLE_STATES,
    S_PRESSURE,
    S_SPOOL,
    S_TEMPERATURE,
    S_VALVE_PRESSURE,
    Y_BRISTLE,
    Y_MUSCLES,
    Y_POSITION,
    Y_RESERVOIR,
    Y_VELOCITY,
)
from pam_model.plant.muscle_stage import gas_volume, muscle_speed, pull


@compiled
def winding(c: Any, position: float) -> tuple[float, float]:
    """Angle by which a round pulley would wind up as much cable [rad], and arm in pulley radii."""
    slope, bend = 0.0, 0.0
    if c[C_ARM_SLOPE] != 0.0:
        slope = c[C_ARM_SLOPE]
    if c[C_ARM_BEND] != 0.0:
        bend = c[C_ARM_BEND]
    if slope == 0.0 and bend == 0.0:  # known to the compiler in a kernel without such arms
        return position, 1.0
    return wound_angle(position, slope, bend), relative_arm(position, slope, bend)


@compiled
def muscle_rates(
    m: int,
    o: int,
    c: Any,
    table: Any,
    y: Any,
    dy: Any,
    command: float,
    path: float,
    path_speed: float,
    pressure_rate: float,
    pressure_given: bool,
    shut: bool,
    step: float,
) -> tuple[float, float]:
    """Write one muscle's rates into `dy`; return its pull [N] and drawn flow over rho0 [m^3/s].

    With `pressure_given`, the pressure at the sensor changes at `pressure_rate`: the pressure of
    the muscle or, with a tube, that on the valve's side of the tube.
    """
    pressure = y[o + S_PRESSURE]
    gauge = pressure - c[C_AMBIENT]
    force, length, slope, area = pull(m, c, table, y, o, gauge, path)
    volume, volume_slope, volume_per_pressure = gas_volume(m, c, table, gauge, length)
    per_volume = 1.0 / volume
    has_tube = c[m + M_TUBE] > 0.0
    if pressure_given and not has_tube:
        spool_rate, free_rate, valve_rate, drawn, heat_rate = 0.0, pressure_rate, 0.0, 0.0, 0.0
        gas_slope = 0.0
    else:
        spool_rate, free_rate, valve_rate, drawn, heat_rate = gas_rates(
            m,
            c,
            command,
            y[o + S_SPOOL],
            pressure,
            y[o + S_VALVE_PRESSURE],
            y[o + S_TEMPERATURE],
            y[Y_RESERVOIR],
            volume,
            per_volume,
            volume_per_pressure,
            shut,
        )
        exponent = c[m + M_SHUT_EXPONENT]
        gas_slope = -exponent * pressure * volume_slope * per_volume
        if c[m + M_THREAD] > 0.0:
            gas_slope /= 1.0 + exponent * pressure * volume_per_pressure * per_volume
        if regulated(m, c) and not has_tube and not shut:
            gas_slope = 0.0
        if pressure_given:
            valve_rate = pressure_rate
    speed = muscle_speed(m, c, y, o, path_speed, free_rate, slope, area, gas_slope, gauge)
    dy[o + S_SPOOL] = spool_rate
    rate = free_rate + gas_slope * speed
    dy[o + S_PRESSURE] = rate
    if c[m + M_TUBE] > 0.0:
        dy[o + S_VALVE_PRESSURE] = valve_rate
    if c[m + M_THERMAL] > 0.0:
        # The motion adds the change of P V = m R T at constant mass.
        moved = gas_slope * (1.0 / pressure + volume_per_pressure / volume) + volume_slope / volume
        given_rate = pressure_given and not has_tube
        dy[o + S_TEMPERATURE] = (
            0.0 if given_rate else heat_rate + y[o + S_TEMPERATURE] * speed * moved
        )
    memory_rates(m, c, y, dy, o, speed, step)
    return force, drawn


@compiled
def regulated(m: int, c: Any) -> bool:
    """Whether this muscle's valve is a pressure regulator."""
    return bool(c[m + M_REGULATOR] > 0.0)


@compiled
def hinge_torques(
    c: Any,
    tables: Any,
    y: Any,
    dy: Any,
    held: Any,
    drive: Any,
    sliding: float,
    free: bool,
    given: tuple[bool, bool],
    shut: bool,
    step: float,
) -> tuple[float, float, float]:
    """Write the rates of all states of a joint but its speed and the reservoir.

    `tables` has a force table for each muscle of the joint, and `held` the command of its valve.
    `drive` holds the rates of position and pressures that are `given`. `sliding` is the sign of the
    motion that friction opposes (0: no friction). Without `free` the joint is locked.

    Returns
    -------
    muscles : float
        Torque of the muscles [N m].
    total : float
        Torque of all that acts on the joint, without gravity and the body's own motion [N m].
    drawn : float
        Flow from the supply over rho0 [m^3/s].
    """
    position_given, pressure_given = given
    position = y[Y_POSITION]
    speed = drive[0] if position_given else y[Y_VELOCITY]
    if not free:
        speed = 0.0
    radius = c[C_RADIUS]
    wound, relative = winding(c, position)
    arm = radius * relative
    torque = 0.0
    drawn = 0.0
    for i in range(len(tables)):
        m = C_MUSCLES + i * N_MUSCLE_CONSTANTS
        force, flow = muscle_rates(
            m,
            Y_MUSCLES + i * N_MUSCLE_STATES,
            c,
            tables[i],
            y,
            dy,
            held[i],
            muscle_length(c[m + M_NEUTRAL], c[m + M_ARM], radius, wound) + c[m + M_CROSSED],
            length_per_position(c[m + M_ARM], arm) * speed + c[m + M_CROSSED_SPEED],
            drive[1 + i],
            pressure_given,
            shut,
            step,
        )
        torque += muscle_torque(c[m + M_ARM], arm, force)
        drawn += flow
    dy[Y_POSITION] = speed
    bristle = 0.0
    if c[C_PRESLIDING] > 0.0 and not free:
        dy[Y_BRISTLE] = 0.0
    if c[C_PRESLIDING] > 0.0 and free:
        dy[Y_BRISTLE] = dahl_rate(y[Y_BRISTLE], speed, c[C_PRESLIDING], step)
        grip = dry_friction(c, speed)
        # Canudas de Wit et al. (1995): critical damping of the bristles at rest.
        damping = 2.0 * math.sqrt(grip * c[C_PRESLIDING] * c[C_INERTIA])
        bristle = grip * y[Y_BRISTLE] + damping * dy[Y_BRISTLE]
    total = torque + c[C_EXTERNAL] - c[C_VISCOUS] * speed - bristle
    total += joint_torque(c, position, speed) - sliding * dry_friction(c, speed)
    return float(torque), float(total), drawn


@compiled
def reservoir_rate(
    c: Any, conductance: float, volume: float, pressure: float, drawn: float
) -> float:
    """dP/dt of a reservoir [Pa/s] from which the flow `drawn` over rho0 [m^3/s] leaves."""
    refill = reference_flow(conductance, c[C_DROOP_CRITICAL], c[C_SUPPLY], pressure)
    return float(c[C_EXPONENT] * c[C_RT] * c[C_DENSITY] * (refill - drawn) / volume)


@compiled
def joint_rates(
    c: Any,
    tables: Any,
    y: Any,
    dy: Any,
    held: Any,
    drive: Any,
    sliding: float,
    free: bool,
    given: tuple[bool, bool],
    shut: bool,
    step: float,
) -> float:
    """Write the rates of a joint that moves alone into `dy`; arguments as `hinge_torques`.

    The rate of a state that never changes is not written, and `kernel.move` does not read it.

    Returns
    -------
    float
        Torque of the muscles [N m].
    """
    torque, total, drawn = hinge_torques(
        c, tables, y, dy, held, drive, sliding, free, given, shut, step
    )
    total -= c[C_GRAVITY] * sine(y[Y_POSITION] - c[C_GRAVITY_ANGLE])
    # Lanes compute every branch anyway, and a loop over them is cheaper without any.
    dy[Y_VELOCITY] = total * c[C_PER_INERTIA] if free and not given[0] else 0.0
    if c[C_DROOP] > 0.0:
        dy[Y_RESERVOIR] = reservoir_rate(
            c, c[C_DROOP_CONDUCTANCE], c[C_DROOP_VOLUME], y[Y_RESERVOIR], drawn + c[C_DRAWN]
        )
    return torque
