"""From the desired pressure of each muscle to the command of its valve, in compiled functions.

For a flow valve, the desired dp/dt = feedforward + gain (reference - pressure) gives a mass flow
by the law of the polytropic chamber, m = (V dP/dt / exponent + P dV/dt)/(R T). The inverse of the
ISO 6358 flow gives the spool opening, and a lead compensator removes most of the spool's lag. For a
pressure regulator, the command is the reference itself within its limits.

The rows of the functions are in `loop_rows`.

Source: ISO 6358 and chamber as in the rig's nominal physics; the inversion is derived here.
"""

from __future__ import annotations

import math
from typing import Any, Final

from pam_control.adaptation.flow_adaptation import (
    EVERY,
    corrected_flow,
    forget_weights,
    least_share,
    take_flow,
    unit_loss,
)
from pam_control.adaptation.tube_pressure import pressure_behind_tube
from pam_control.feedback.pressure_watch import watch_pressure
from pam_control.feedback.valve_lead import lead_command
from pam_control.limited import limited
from pam_control.rows.loop_rows import (
    D_AHEAD,
    D_BY_LENGTH,
    D_BY_PRESSURE,
    D_CUT,
    D_POSITION,
    D_PRESSURE,
    D_RATE,
    D_REFERENCE,
    D_SPEED,
    D_VOLUME,
    G_ACTS,
    G_ADAPTS,
    G_GAIN,
    G_LEAD_RATIO,
    G_SPOOL_LIMIT,
    N_BIAS,
    N_CONDUCTANCE,
    N_CRITICAL,
    N_FULL,
    N_GAIN,
    N_IN_CLOSED_FORM,
    N_LONGEST,
    N_MOST,
    N_REGULATED,
    N_SHORTEST,
    N_SIGN,
    V_CHATTERED,
    V_FACTOR,
    V_FLOW,
    V_INSIDE,
    V_LOSS,
    V_RATE,
    V_SHOWN,
    V_SINCE,
    V_TUBE,
)
from pam_control.rows.muscle_table import O_JOINT, O_NUMBERS, O_PLACE
from pam_model.gas import GAS_CONSTANT, flow_for_pressure_rate, opening_for_flow, reference_flow
from pam_model.physics.pressure_sensor import true_pressure as pressure_of_reading
from pam_model.plant.composition import leak
from pam_model.plant.control_laws import flow_opening, spool_position
from pam_model.plant.layout import (
    C_AMBIENT,
    C_DENSITY,
    C_EXPONENT,
    C_TEMPERATURE,
)
from pam_model.plant.muscle_stage import gas_volume as closed_gas_volume
from pam_model.views.joint_rows import length_of, length_rate

LEAST_CAPACITY: Final = 0.01  # of the full flow


def full_flow(c: Any, n: Any, supply: float, fills: bool, absolute: float) -> float:
    """Flow of the open valve into the muscle by its data [kg/s]."""
    if fills:
        return float(
            c[C_DENSITY] * reference_flow(n[N_CONDUCTANCE], n[N_CRITICAL], supply, absolute)
        )
    return float(
        -c[C_DENSITY] * reference_flow(n[N_CONDUCTANCE], n[N_CRITICAL], absolute, c[C_AMBIENT])
    )


def true_pressure(c: Any, n: Any, v: Any, shown: float, step: float) -> float:
    """Pressure in the muscle [Pa gauge]; that of the sensor, unless a tube was found."""
    v[V_SHOWN] = shown
    if v[V_TUBE] == 0.0:
        if v[V_LOSS] != 0.0:
            v[V_LOSS] = 0.0
            v[V_INSIDE] = math.nan
        return shown
    v[V_LOSS] = v[V_TUBE] * unit_loss(n, v[V_FLOW], max(shown, 0.0) + c[C_AMBIENT])
    return pressure_behind_tube(v, step, shown, v[V_LOSS], v[V_RATE])


def space_of(
    m: int, c: Any, n: Any, d: Any, table: Any, pressure: float, length: float
) -> tuple[float, float, float]:
    """Gas volume with dead volume [m^3], and its derivatives by length and pressure."""
    if n[N_IN_CLOSED_FORM] > 0.0:
        return closed_gas_volume(m, c, table, pressure, length)
    return d[D_VOLUME], d[D_BY_LENGTH], d[D_BY_PRESSURE]


def flow_valve(
    m: int, c: Any, n: Any, e: Any, g: Any, v: Any, d: Any, table: Any,
    supply: float, age: float, step: float,
) -> tuple[float, bool, float]:  # fmt: skip
    """Command of a flow valve.

    Parameters
    ----------
    m : int
        Where the constants of the muscle begin in those of its joint.
    c, n, e, g, v, d : rows
        Constants of the joint, numbers of the loop, inverses of the valve, settings, state and
        demand.
    table : rows
        Any rows; a muscle in closed form needs none.
    supply, age, step : float
        Pressure before the valve [Pa absolute], age of the measured pressures and time since the
        last call [s].

    Returns
    -------
    command : float
        Spool -1 (exhaust) to 1 (supply) [-].
    cut : bool
        Whether the valve is too small for the desired pressure rate.
    drawn : float
        Flow that the valve is asked for [kg/s].
    """
    ambient, acting_delay = c[C_AMBIENT], g[G_ACTS] + age
    pressure, shown = d[D_PRESSURE], v[V_SHOWN]
    error = d[D_REFERENCE] - pressure
    before = v[V_FACTOR]
    gain = g[G_GAIN] * watch_pressure(n, v, error, step)
    if v[V_FACTOR] < before:
        # flows that change within a cycle or two tell nothing else
        forget_weights(v)
        v[V_CHATTERED] = 1.0
    # chatter means that the sensor does not see the muscle: of use is only what tells why
    learns = g[G_ADAPTS] > 0.0
    adapts = learns and (v[V_FACTOR] == 1.0 or v[V_TUBE] > 0.0)
    if adapts:
        # what is learnt corrects the feedforward; it must never raise the gain of the loop
        gain *= least_share(v)
    rate = d[D_RATE] + gain * error
    absolute = max(pressure + d[D_AHEAD] + ambient, ambient)
    length = length_of(m, n[N_SIGN], c, d[D_POSITION])
    length = limited(length, n[N_SHORTEST], n[N_LONGEST])
    volume, by_length, by_pressure = space_of(m, c, n, d, table, absolute - ambient, length)
    # threads and cable that stretch take gas as a larger volume does
    volume += c[C_EXPONENT] * absolute * by_pressure
    volume_rate = by_length * length_rate(n[N_SIGN], c, d[D_SPEED])
    into = flow_for_pressure_rate(
        rate, absolute, volume, volume_rate, temperature=c[C_TEMPERATURE], exponent=c[C_EXPONENT]
    )
    leaving = c[C_DENSITY] * leak(m, c, absolute)
    flow = into + leaving
    per_pressure = 1.0 / (GAS_CONSTANT * c[C_TEMPERATURE])
    fills, capacity = flow >= 0.0, 1.0
    # the valve sees the pressure before the tube
    line = max(absolute + shown - pressure, ambient)
    full = full_flow(c, n, supply, fills, line)
    if learns:
        # none at the supply's pressure, or in an empty muscle
        capacity = max(abs(full), LEAST_CAPACITY * n[N_FULL])
    into = flow - leaving
    if adapts:
        moved = absolute * volume_rate * per_pressure
        flow = corrected_flow(n, v, flow, moved, capacity, absolute)
        if (flow >= 0.0) != fills:
            full = full_flow(c, n, supply, not fills, line)
    opening = opening_for_flow(flow, full)
    limit = g[G_SPOOL_LIMIT]
    given = flow if abs(opening) < limit else limited(opening, -limit, limit) * abs(full)
    if v[V_TUBE] > 0.0:
        late = step / (max(acting_delay, 0.0) + step)
        v[V_FLOW] += late * (into + given - flow - v[V_FLOW])
        moved = (pressure + ambient) * volume_rate
        v[V_RATE] = (v[V_FLOW] / per_pressure - moved) * c[C_EXPONENT] / volume
    if learns:
        seen = max(shown + ambient, ambient)
        take_flow(
            n, v, step, given - leaving, capacity, seen, v[V_LOSS],
            volume * per_pressure / c[C_EXPONENT], seen * volume_rate * per_pressure, acting_delay,
        )  # fmt: skip
    opening = flow_opening(e, opening)
    wanted = spool_position(e, limited(opening, -limit, limit))
    command = lead_command(n, v, wanted, g[G_LEAD_RATIO], step)
    return limited(command, -limit, limit), abs(opening) >= limit, given


def regulator(n: Any, d: Any) -> tuple[float, bool]:
    """Command of a pressure regulator [Pa gauge]: the reference when the valve acts, if it can."""
    wanted = d[D_REFERENCE] + d[D_AHEAD]
    given = max(0.0, min(n[N_MOST], wanted))
    return given, given != wanted


def true_pressures(owners: Any, c: Any, n: Any, v: Any, d: Any, shown: Any, step: float) -> None:
    """Write the pressure in every muscle to `D_PRESSURE`.

    `shown` are the readings of the sensors [Pa], of all muscles of the robot.
    """
    for k in range(len(n)):
        reading = shown[owners[k][O_PLACE]]
        pressure = pressure_of_reading(reading, n[k][N_GAIN], n[k][N_BIAS])
        if n[k][N_REGULATED] > 0.0:
            d[k][D_PRESSURE] = pressure
        else:
            d[k][D_PRESSURE] = true_pressure(c[owners[k][O_JOINT]], n[k], v[k], pressure, step)


def command_valves(
    owners: Any, c: Any, n: Any, e: Any, g: Any, v: Any, d: Any,
    supply: float, age: float, step: float, commands: Any,
) -> tuple[float, bool]:  # fmt: skip
    """Write the command of every valve, and whether it was limited (`D_CUT`).

    `commands` are those of all muscles of the robot.

    Returns
    -------
    drawn : float
        Flow that all valves together take from the supply [kg/s].
    is_due : bool
        Whether a fit has to be updated or forgotten.
    """
    drawn, is_due = 0.0, False
    for k in range(len(n)):
        if n[k][N_REGULATED] > 0.0:
            command, is_cut = regulator(n[k], d[k])
        else:
            i, m = owners[k][O_JOINT], owners[k][O_NUMBERS]
            command, is_cut, flow = flow_valve(
                m, c[i], n[k], e[k], g[i], v[k], d[k], c, supply, age, step
            )
            drawn += max(flow, 0.0)
            is_due = is_due or v[k][V_SINCE] >= EVERY or v[k][V_CHATTERED] > 0.0
        commands[owners[k][O_PLACE]], d[k][D_CUT] = command, 1.0 if is_cut else 0.0
    return drawn, is_due
