"""A second plant that makes recordings with hidden effects for the blind check.

It is independent of pam_model.plant on purpose: it shares no law, no constant and no function with
it, although some physics is therefore written twice in this repository. Do not replace anything
here by functions of pam_model: an error in a shared law would be in the data and in the model, and
no check would find it.

Its equations differ from those of the simulation that the diagnosis fits, so that a correct answer
is not the result of identical code. (Exceptions are laws that have only one form, and Dahl's law,
which is a special case of the LuGre model.) The states of the gas are mass and energy instead of
pressure; dry friction is LuGre friction (Canudas de Wit et al., 1995); thread friction is a sum of
Prandtl-Ishlinskii play operators with the scale of the thread model (P pi D L); creep is a
springpot of Maxwell elements; the bladder is a Mooney-Rivlin solid; extensible braids use the
implicit thread tension; a long tube follows the square-root law; convective heat transfer grows
with density; the spool has two poles. The integration is semi-implicit Euler with 0.05 ms.

numba compiles the code if it is installed; without it the same code is some 300 times slower.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt
from scipy import signal


def _compiled[F: Callable[..., Any]](function: F) -> F:
    """Compile with numba if it is installed."""
    try:
        from numba import njit  # noqa: PLC0415

        from pam_model.machine_code_cache import keep_machine_code  # noqa: PLC0415
    except ImportError:
        return function
    return cast(F, keep_machine_code(njit(nogil=True)(function)))


Array = npt.NDArray[np.float64]

STEP = 5.0e-5  # s
GAS_CONSTANT = 287.05  # J/(kg K)
HEAT_CAPACITY = 717.6  # J/(kg K), constant volume
N_PLAY = 8
REST_ROUNDS = 10  # Newton steps; one is enough for a small stretch
N_CREEP = 7
COMMANDED = 100.0  # Pa, resolution of a regulator's command


class TruthJoint(NamedTuple):
    """True parameters of the joint and the rig; the defaults are those without any effect."""

    pulley_radius: float
    inertia: float
    viscous_friction: float
    gravity_torque: float
    gravity_angle: float
    lower_limit: float
    upper_limit: float
    temperature: float
    ambient_pressure: float
    supply_pressure: float
    coulomb_torque: float = 0.0
    static_torque: float = 0.0  # breakaway, at least coulomb_torque
    stribeck_speed: float = 0.05
    bristle_angle: float = 1.5e-3
    reservoir_volume: float = 0.0  # 0: the supply pressure is constant
    reservoir_conductance: float = 0.0
    position_offset: float = 0.0
    position_delay: float = 0.0
    # Effects outside the table of effects:
    pulley_eccentricity: float = 0.0
    encoder_eccentricity: float = 0.0
    torque_ripple: float = 0.0
    cross_leak: float = 0.0
    backlash: float = 0.0


class TruthMuscle(NamedTuple):
    """True parameters of one muscle, its valve and its sensor."""

    thread_length: float
    turns: float
    rest_length: float
    neutral_length: float
    dead_volume: float
    sonic_conductance: float
    critical_ratio: float
    time_constant: float
    dead_zone: float = 0.0
    null_offset: float = 0.0
    second_pole: float = 0.0
    exhaust_ratio: float = 1.0
    command_delay: float = 0.0
    leak: float = 0.0
    tube_volume: float = 0.0
    tube_conductance: float = 0.0
    heat_transfer: float = 0.0  # W/K at 300 kPa absolute; 0 keeps the gas isothermal
    thread_friction: float = 0.0
    play_length: float = 1.0e-3
    creep_stiffness: float = 0.0
    creep_order: float = 0.25
    bladder_volume: float = 0.0
    bladder_modulus: float = 0.0
    end_factor: float = 1.0
    threshold_pressure: float = 0.0  # at which the bladder lies against the braid [Pa]
    thread_compliance: float = 0.0  # 1/(N_t E A) [1/N]
    cable_compliance: float = 0.0
    pressure_gain: float = 1.0
    pressure_bias: float = 0.0
    pressure_lag: float = 0.0
    spool_hysteresis: float = 0.0  # not in the table of effects
    pressure_curvature: float = 0.0  # of the reading, at full scale; not in the table of effects
    # A pressure regulator, whose commands are pressures: opening per error of its outlet [1/Pa].
    regulator: float = 0.0
    regulator_zero: float = 0.0  # Pa
    regulator_gain: float = 1.0
    regulator_damping: float = 1.0  # of the two poles at 1/time_constant


@dataclass
class Sensors:
    """Noise and quantisation of the recorded channels."""

    pressure_noise: float = 150.0
    pressure_step: float = 244.0
    position_noise: float = 1.5e-4
    position_step: float = 2.0 * math.pi / 16384.0
    force_noise: float = 1.5
    command_step: float = 1.0 / 2048.0
    pressure_colour: float = 0.0  # Pa, standard deviation of the noise below the corner
    pressure_corner: float = 10.0  # Hz
    pressure_drift: float = 0.0  # Pa, of the zero over the recording
    position_drift: float = 0.0  # rad
    force_drift: float = 0.0  # N


class SupplyWander(NamedTuple):
    """How the supply pressure changes by itself, as shares of it."""

    wander: float = 0.0
    period: float = 10.0  # s
    ripple: float = 0.0
    frequency: float = 15.0  # Hz

    def factor(self, time: Array) -> Array:
        """Supply pressure over its mean, shape of `time`."""
        turn = time / self.period
        triangle = 4.0 * np.abs(turn - np.floor(turn + 0.5)) - 1.0
        ripple = np.sin(2.0 * np.pi * self.frequency * time)
        result: Array = 1.0 + self.wander * triangle + self.ripple * ripple
        return result


@dataclass
class PressureExcitation:
    """Pressure references, and the gains of the control loop."""

    level: Array  # (n,) mean of both pressures [Pa]
    difference: Array  # (n,) half of agonist minus antagonist pressure [Pa]
    reference_position: Array  # (n,) [rad], used where position_gain is not 0
    sample_time: float
    proportional: float = 6.0e-6  # spool per Pa
    integral: float = 8.0e-6  # spool per Pa s
    position_gain: float = 0.0  # Pa/rad


@dataclass
class TruthRecording:
    """The recorded channels, and the forces that load cells would measure."""

    time: Array
    commands: Array
    pressures: Array
    position: Array
    forces: Array
    true_pressures: Array = field(repr=False)
    true_position: Array = field(repr=False)


@_compiled
def _iso_flow(conductance: float, upstream: float, downstream: float, ratio: float) -> float:
    """ISO 6358 mass flow [kg/s] from `upstream` to `downstream` (both Pa absolute), signed."""
    if upstream < downstream:
        return -_iso_flow_one_way(conductance, downstream, upstream, ratio)
    return _iso_flow_one_way(conductance, upstream, downstream, ratio)


@_compiled
def _iso_flow_one_way(c: float, high: float, low: float, b: float) -> float:
    r = low / high
    if r <= b:
        psi = 1.0
    elif r < 0.999:
        psi = math.sqrt(1.0 - ((r - b) / (1.0 - b)) ** 2)
    else:
        psi = (1.0 - r) / 0.001 * math.sqrt(1.0 - ((0.999 - b) / (1.0 - b)) ** 2)
    return c * 1.185 * high * psi


class TruthState(NamedTuple):
    """What the plant remembers from one sample to the next; arrays that `run_samples` changes."""

    scalars: Array  # position, velocity, bristle, pulley's position, mass in the reservoir, head
    spool: Array
    mass: Array
    energy: Array
    tube_mass: Array
    stretch: Array
    play: Array
    creep: Array
    volume: Array
    length: Array
    gauge: Array
    line: Array
    filtered: Array
    integral: Array
    force: Array
    spool_play: Array
    delay_buffer: Array
    q_buffer: Array
    regulator_speed: Array


def length_and_volume_at_rest(
    muscle: TruthMuscle, pressure: float, path: float
) -> tuple[float, float]:
    """Length [m] and gas volume [m^3] when threads and cable have stretched."""
    b0, area = muscle.thread_length, 4 * math.pi * muscle.turns**2
    length, b = path, b0
    for _ in range(REST_ROUNDS):
        if muscle.thread_compliance > 0.0:
            strain = b0 * pressure * length / (0.5 * area) * muscle.thread_compliance
            b = b0 / (1.0 - min(0.2, strain))
        if muscle.cable_compliance > 0.0:
            pull = max(0.0, pressure * (3.0 * length * length - b * b) / area)
            softer = 1.0 + muscle.cable_compliance * pressure * 6.0 * length / area
            length += (path - length - pull * muscle.cable_compliance) / softer
    return length, length * (b * b - length**2) / area + muscle.dead_volume


def start_state(
    joint: TruthJoint, muscles: tuple[TruthMuscle, TruthMuscle], pressures: tuple[float, float]
) -> TruthState:
    """The plant at rest at position 0, with these pressures [Pa gauge]."""
    radius, p_amb, q = joint.pulley_radius, joint.ambient_pressure, 0.0
    rt = GAS_CONSTANT * joint.temperature
    m_res = joint.supply_pressure * joint.reservoir_volume / rt
    state = TruthState(
        scalars=np.array([q, 0.0, 0.0, 0.0, m_res, 0.0]),
        spool=np.zeros((2, 3)),
        mass=np.zeros(2),
        energy=np.zeros(2),
        tube_mass=np.zeros(2),
        stretch=np.zeros(2),
        play=np.zeros((2, N_PLAY)),
        creep=np.zeros((2, N_CREEP)),
        volume=np.zeros(2),
        length=np.zeros(2),
        gauge=np.zeros(2),
        line=np.zeros(2),
        filtered=np.zeros(2),
        integral=np.zeros(2),
        force=np.zeros(2),
        spool_play=np.zeros(2),
        delay_buffer=np.zeros((2, 4096)),
        q_buffer=np.zeros(4096),
        regulator_speed=np.zeros(2),
    )
    for i in range(2):
        side = -1.0 if i == 0 else 1.0
        p = pressures[i]
        path = muscles[i].neutral_length + side * radius * q
        state.length[i], state.volume[i] = length_and_volume_at_rest(muscles[i], p, path)
        state.stretch[i] = path - state.length[i]
        state.mass[i] = (p + p_amb) * state.volume[i] / rt
        state.energy[i] = state.mass[i] * HEAT_CAPACITY * joint.temperature
        state.gauge[i] = p
        state.line[i] = p
        state.filtered[i] = p
        if muscles[i].regulator > 0.0:
            state.spool[i] = state.spool_play[i] = state.delay_buffer[i] = p
        state.tube_mass[i] = (p + p_amb) * muscles[i].tube_volume / rt
        for j in range(N_PLAY):
            state.play[i, j] = state.length[i]
    return state


@_compiled
def run_samples(  # noqa: PLR0912, PLR0915
    joint: TruthJoint,
    muscles: tuple[TruthMuscle, TruthMuscle],
    level: Array,
    difference: Array,
    reference_position: Array,
    fixed_commands: Array,
    use_fixed: bool,
    settings: Array,
    supply_factor: Array,
    noise: Array,
    commands: Array,
    sensed: Array,
    truth: Array,
    state: TruthState,
    first: int,
    last: int,
) -> int:
    """Run the samples from `first` up to `last`; return where it ended or diverged."""
    radius, inertia = joint.pulley_radius, joint.inertia
    t0, p_amb, p_sup = joint.temperature, joint.ambient_pressure, joint.supply_pressure
    coulomb, v_res, backlash = joint.coulomb_torque, joint.reservoir_volume, joint.backlash
    eccentricity = joint.pulley_eccentricity
    sample_time, k_p, k_i, k_q = settings[0], settings[1], settings[2], settings[3]
    p_step, q_step, u_step = settings[4], settings[5], settings[6]
    steps = round(sample_time / STEP)
    h = sample_time / steps
    rt = GAS_CONSTANT * t0
    flow_scale = math.sqrt(293.15 / t0)

    scalars = state.scalars
    q, w, z = scalars[0], scalars[1], scalars[2]
    load_q, m_res, head = scalars[3], scalars[4], int(scalars[5])
    spool, mass, energy, tube_mass = state.spool, state.mass, state.energy, state.tube_mass
    stretch, play, creep, volume = state.stretch, state.play, state.creep, state.volume
    length, gauge, line, filtered = state.length, state.gauge, state.line, state.filtered
    integral, force, spool_play = state.integral, state.force, state.spool_play
    delay_buffer, q_buffer = state.delay_buffer, state.q_buffer
    regulator_speed = state.regulator_speed

    command = np.zeros(2)
    for k in range(first, last):
        # Sensors and control loop, once per sample.
        p_sup = joint.supply_pressure * supply_factor[k]
        q_seen = q_buffer[(head - 1 - round(joint.position_delay / h)) % 4096] if k > 0 else q
        q_seen += joint.position_offset + joint.encoder_eccentricity * math.sin(q_seen + 0.7)
        q_seen = round((q_seen + noise[k, 2]) / q_step) * q_step
        sensed[k, 2] = q_seen
        for i in range(2):
            # A parabola that is right at zero and at full scale, and off between them.
            bent = 4.0 * muscles[i].pressure_curvature * filtered[i] * (1.0 - filtered[i] / 1.0e6)
            shown = filtered[i] * muscles[i].pressure_gain + muscles[i].pressure_bias
            shown += bent + noise[k, i]
            shown = round(shown / p_step) * p_step
            sensed[k, i] = shown
            sensed[k, 3 + i] = force[i] + noise[k, 3 + i]
            wanted = level[k] + (difference[k] if i == 0 else -difference[k])
            if k_q != 0.0:
                correction = k_q * (reference_position[k] - q_seen)
                wanted += correction if i == 0 else -correction
            wanted = min(max(wanted, 2.0e4), 5.5e5)
            error = wanted - shown
            u = k_p * error + integral[i]
            if -1.0 < u < 1.0:
                integral[i] += k_i * error * sample_time
            u = min(max(u, -1.0), 1.0)
            command[i] = round(u / u_step) * u_step
            if muscles[i].regulator > 0.0:
                command[i] = round(wanted / COMMANDED) * COMMANDED
            if use_fixed:
                command[i] = fixed_commands[k, i]
            commands[k, i] = command[i]
        truth[k, 0] = gauge[0]
        truth[k, 1] = gauge[1]
        truth[k, 2] = q

        for _ in range(steps):
            supply = m_res * rt / v_res if v_res > 0.0 else p_sup
            drawn = 0.0
            torque = 0.0
            for i in range(2):
                m = muscles[i]
                side = -1.0 if i == 0 else 1.0
                b0, turns, rest = m.thread_length, m.turns, m.rest_length
                area = 4.0 * math.pi * turns * turns
                # Spool: the nominal pole, then a second one.
                delay_buffer[i, head] = command[i]
                u = delay_buffer[i, (head - round(m.command_delay / h)) % 4096]
                if m.regulator > 0.0:
                    half = m.spool_hysteresis * (joint.supply_pressure - p_amb)
                    spool_play[i] = max(u - half, min(u + half, spool_play[i]))
                    u = spool_play[i] * m.regulator_gain + m.regulator_zero
                spool[i, 0] += (1.0 - math.exp(-h / m.time_constant)) * (u - spool[i, 0])
                if m.second_pole > 0.0:
                    spool[i, 1] += (1.0 - math.exp(-h / m.second_pole)) * (
                        spool[i, 0] - spool[i, 1]
                    )
                else:
                    spool[i, 1] = spool[i, 0]
                x = spool[i, 1]
                if m.regulator > 0.0:
                    # The set point is smoothed twice; the error of the outlet opens the valve.
                    if m.regulator_damping == 1.0:
                        spool[i, 2] += (1.0 - math.exp(-h / m.time_constant)) * (x - spool[i, 2])
                    else:
                        corner = 1.0 / m.time_constant
                        pull_back = (
                            corner * (u - spool[i, 2])
                            - 2.0 * m.regulator_damping * (regulator_speed[i])
                        )
                        regulator_speed[i] += h * corner * pull_back
                        spool[i, 2] += h * regulator_speed[i]
                    x = min(max(m.regulator * (spool[i, 2] - line[i]), -1.0), 1.0)
                elif m.spool_hysteresis > 0.0:
                    spool_play[i] = max(
                        x - m.spool_hysteresis, min(x + m.spool_hysteresis, spool_play[i])
                    )
                    x = spool_play[i]
                x -= m.null_offset
                if m.dead_zone > 0.0:
                    # Overlap with rounded edges, as on a worn spool.
                    width = 0.1 * m.dead_zone
                    reach = abs(x) - m.dead_zone
                    opened = 0.5 * (reach + math.sqrt(reach * reach + width * width)) - 0.5 * (
                        math.sqrt(m.dead_zone * m.dead_zone + width * width) - m.dead_zone
                    )
                    x = math.copysign(min(max(opened, 0.0) / (1.0 - m.dead_zone), 1.0), x)
                # Gas.
                p_valve = line[i] + p_amb
                if x >= 0.0:
                    flow = _iso_flow(m.sonic_conductance * x, supply, p_valve, m.critical_ratio)
                    drawn += flow
                else:
                    flow = -_iso_flow(
                        -m.sonic_conductance * m.exhaust_ratio * x, p_valve, p_amb, m.critical_ratio
                    )
                flow *= flow_scale
                into = flow
                p_abs = gauge[i] + p_amb
                if m.tube_volume > 0.0:
                    gap = p_valve * p_valve - p_abs * p_abs
                    into = m.tube_conductance * 1.185 * gap / math.sqrt(abs(gap) + 1.0e6)
                    tube_mass[i] += (flow - into) * h
                    line[i] = tube_mass[i] * rt / m.tube_volume - p_amb
                if m.leak > 0.0:  # laminar leak, volume flow at upstream density
                    into -= m.leak * 1.185 * gauge[i]
                if joint.cross_leak > 0.0:
                    into += joint.cross_leak * 1.185 * (gauge[1 - i] - gauge[i])
                # Geometry: path, cable, thread.
                path_q = load_q if backlash > 0.0 else q
                path = m.neutral_length + side * (
                    radius * path_q + eccentricity * (1.0 - math.cos(2.0 * path_q + 0.6))
                )
                b = b0
                if m.thread_compliance > 0.0:
                    b = b0 / (
                        1.0
                        - min(0.2, b0 * gauge[i] * length[i] / (0.5 * area) * m.thread_compliance)
                    )
                scale = 1.0 / area
                if m.cable_compliance > 0.0:
                    for _newton in range(2):
                        le = path - stretch[i]
                        pull = gauge[i] * (3 * le * le - b * b) * scale
                        slope = gauge[i] * 6 * le * scale
                        stretch[i] -= (stretch[i] - pull * m.cable_compliance) / (
                            1.0 + slope * m.cable_compliance
                        )
                    stretch[i] = max(stretch[i], 0.0)
                new_length = min(path - stretch[i], 0.999 * b)
                change = new_length - length[i]
                length[i] = new_length
                new_volume = new_length * (b * b - new_length * new_length) * scale + m.dead_volume
                # Energy balance with a state for the energy, or mass only at constant temperature.
                if m.heat_transfer > 0.0:
                    t_gas = energy[i] / (mass[i] * HEAT_CAPACITY)
                    heat = m.heat_transfer * math.sqrt(p_abs / 3.0e5) * (t0 - t_gas)
                    t_flow = t0 if into > 0.0 else t_gas
                    energy[i] += h * (into * (HEAT_CAPACITY + GAS_CONSTANT) * t_flow + heat)
                    energy[i] -= p_abs * (new_volume - volume[i])
                    mass[i] += into * h
                    p_abs = GAS_CONSTANT / HEAT_CAPACITY * energy[i] / new_volume
                else:
                    mass[i] += into * h
                    p_abs = mass[i] * rt / new_volume
                volume[i] = new_volume
                gauge[i] = p_abs - p_amb
                if m.tube_volume <= 0.0:
                    line[i] = gauge[i]
                # Muscle force.
                le = new_length
                effective = rest * (1.0 - m.end_factor * (rest - le) / rest)
                carried = gauge[i]
                if m.threshold_pressure > 0.0:
                    # The bladder comes into contact little by little.
                    beyond = gauge[i] - m.threshold_pressure
                    width = 0.1 * m.threshold_pressure
                    carried = 0.5 * (beyond + math.sqrt(beyond * beyond + width * width))
                pull = carried * (3.0 * effective * effective - b * b) * scale
                if m.bladder_volume > 0.0:
                    x1 = le / rest
                    c = rest * rest / (b * b - rest * rest)
                    y = (b * b - le * le) / (b * b - rest * rest)
                    slope = x1 - c * x1 - 1.0 / (x1**3 * y) + c / (x1 * y * y)
                    other = -1.0 / x1**3 + c * x1 / y**2 + x1 * y - c * x1**3
                    pull += (
                        m.bladder_volume
                        / rest
                        * m.bladder_modulus
                        / 6.0
                        * (1.4 * slope + 0.6 * other)
                    )
                if m.thread_friction > 0.0:
                    total = 0.0
                    for j in range(N_PLAY):
                        reach = m.play_length * 2.0 * (j + 0.5) / N_PLAY
                        old = play[i, j]
                        play[i, j] = max(le - reach, min(le + reach, old))
                        total += (le - play[i, j]) / reach / N_PLAY
                    diameter = math.sqrt(max(b * b - le * le, 0.0)) / (math.pi * turns)
                    pull += m.thread_friction * max(gauge[i], 0.0) * math.pi * diameter * le * total
                if m.creep_stiffness > 0.0:
                    for j in range(N_CREEP):
                        t_j = 0.2 * 3.0**j
                        weight = m.creep_stiffness * (t_j / 0.2) ** (-m.creep_order)
                        creep[i, j] = (creep[i, j] + weight * change) * math.exp(-h / t_j)
                        pull += creep[i, j]
                force[i] = max(pull, 0.0)
                filtered[i] += (
                    (1.0 - math.exp(-h / m.pressure_lag)) * (line[i] - filtered[i])
                    if m.pressure_lag > 0.0
                    else line[i] - filtered[i]
                )
                torque -= side * force[i]
            if v_res > 0.0:
                m_res += h * (_iso_flow(joint.reservoir_conductance, p_sup, supply, 0.4) - drawn)
            path_q = load_q if backlash > 0.0 else q
            arm = radius + 2.0 * eccentricity * math.sin(2.0 * path_q + 0.6)
            torque *= arm
            if backlash > 0.0:
                # The pulley turns freely within the backlash; under load it touches one flank,
                # which is modelled as a stiff spring.
                lean = q - load_q
                if lean > backlash:
                    load_q = q - backlash
                elif lean < -backlash:
                    load_q = q + backlash
                target = q + (backlash if torque > 0.0 else -backlash)
                load_q += min(max(target - load_q, -2.0 * h), 2.0 * h)
                if abs(q - load_q) < 0.9 * backlash:
                    torque *= 0.2
            friction = 0.0
            if coulomb > 0.0:
                stiff = coulomb / joint.bristle_angle
                curve = coulomb + (joint.static_torque - coulomb) / (
                    1.0 + (w / joint.stribeck_speed) ** 2
                )
                dz = w - stiff * abs(w) / curve * z
                z += h * dz
                friction = stiff * z + 0.6 * math.sqrt(stiff * inertia) * dz
            accel = torque - joint.viscous_friction * w - friction
            accel -= joint.gravity_torque * math.sin(q - joint.gravity_angle)
            accel += joint.torque_ripple * math.sin(12.0 * q)
            w += h * accel / inertia
            q += h * w
            if q < joint.lower_limit:
                q, w = joint.lower_limit, max(w, 0.0)
            elif q > joint.upper_limit:
                q, w = joint.upper_limit, min(w, 0.0)
            q_buffer[head] = q
            head = (head + 1) % 4096
            if not math.isfinite(q):
                return k
    scalars[0], scalars[1], scalars[2] = q, w, z
    scalars[3], scalars[4], scalars[5] = load_q, m_res, head
    return last


def slow_noise(
    sensors: Sensors, sample_time: float, count: int, generator: np.random.Generator
) -> Array:
    """Coloured noise of the pressures and drifting zeros, shape (count, 5)."""
    result = np.zeros((count, 5))
    decay = math.exp(-2.0 * math.pi * sensors.pressure_corner * sample_time)
    part = np.linspace(0.0, 1.0, count)
    drifts = [sensors.pressure_drift] * 2 + [sensors.position_drift] + [sensors.force_drift] * 2
    for i, drift in enumerate(drifts):
        bow = generator.uniform(-0.5, 0.5)
        result[:, i] = drift * generator.uniform(-1.0, 1.0) * (part - 0.5 + bow * part * (1 - part))
        if i < 2:
            white = generator.standard_normal(count) * math.sqrt(1.0 - decay**2)
            before = [decay * generator.standard_normal()]
            coloured, _ = signal.lfilter([1.0], [1.0, -decay], white, zi=before)
            result[:, i] += sensors.pressure_colour * coloured
    return result


def run_truth(
    joint: TruthJoint,
    muscles: tuple[TruthMuscle, TruthMuscle],
    excitation: PressureExcitation,
    sensors: Sensors,
    generator: np.random.Generator,
    *,
    fixed_commands: Array | None = None,
    supply: SupplyWander | None = None,
) -> TruthRecording:
    """Run the rig through the excitation and record it.

    Parameters
    ----------
    joint, muscles : TruthJoint, (TruthMuscle, TruthMuscle)
        Agonist first.
    excitation : PressureExcitation
        References of n samples and the loop's gains.
    sensors : Sensors
        Noise and quantisation of the sensors.
    generator : numpy.random.Generator
        Source of the noise.
    fixed_commands : ndarray (n, 2), optional
        Valve commands in place of the control loop, which show how another rig responds to the
        same commands.
    supply : SupplyWander, optional
        How the supply pressure changes; it is constant by default.

    Raises
    ------
    FloatingPointError
        When the drawn rig cannot run, because the joint diverges.
    """
    n = excitation.level.size
    noise = generator.standard_normal((n, 5)) * np.array(
        [sensors.pressure_noise] * 2 + [sensors.position_noise] + [sensors.force_noise] * 2
    )
    time = np.arange(n, dtype=np.float64) * excitation.sample_time
    if sensors.pressure_colour > 0.0 or sensors.pressure_drift > 0.0:
        noise += slow_noise(sensors, excitation.sample_time, n, generator)
    commands, sensed, truth = np.zeros((n, 2)), np.zeros((n, 5)), np.zeros((n, 3))
    settings = np.array(
        [
            excitation.sample_time,
            excitation.proportional,
            excitation.integral,
            excitation.position_gain,
            sensors.pressure_step,
            sensors.position_step,
            sensors.command_step,
        ]
    )
    first, second = float(excitation.level[0]), float(excitation.difference[0])
    done: int = run_samples(
        TruthJoint(*map(float, joint)),
        (TruthMuscle(*map(float, muscles[0])), TruthMuscle(*map(float, muscles[1]))),
        excitation.level,
        excitation.difference,
        excitation.reference_position,
        np.zeros((1, 2)) if fixed_commands is None else fixed_commands,
        fixed_commands is not None,
        settings,
        np.ones(n) if supply is None else supply.factor(time),
        noise,
        commands,
        sensed,
        truth,
        start_state(joint, muscles, (first + second, first - second)),
        0,
        n,
    )
    if done < n:
        raise FloatingPointError(f"the drawn rig diverges at {done * excitation.sample_time:.2f} s")
    return TruthRecording(
        time=time,
        commands=commands,
        pressures=sensed[:, :2],
        position=sensed[:, 2],
        forces=sensed[:, 3:],
        true_pressures=truth[:, :2],
        true_position=truth[:, 2],
    )
