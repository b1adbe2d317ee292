"""A second plant for the blind check, by other literature than `truth_plant` and the diagnosis.

It takes the same rigs and sizes of effects, so that the same draw gives a pair of recordings that
differ by the laws alone: those of `second_laws` for the effects, and for the background

- spool friction that holds the spool until its error is larger (the spool follows as a play does),
- a third-order error of the pressure sensors, and an encoder ring that is oval,
- noise that falls with one over the frequency (Keshner, Proc. IEEE 70(3), 1982), as a sum of three
  relaxations, and zeros that drift as instruments warm up,
- a compressor that fills fast and is drawn from slowly.

What has one form only (an offset, a gain, a bias, a payload, gas volume, more damping, another
radius, a late stamp) is the same in every plant. A late command waits for the next slot of a bus,
so that its delay varies by a quarter about its mean. A lagging pressure sensor is a Butterworth
filter of second order.

Written without the laws of the diagnosis and of the first plant at hand.
"""

from __future__ import annotations

import math

import numpy as np

from pam_check.blind.second_laws import LUMPS, Array, SecondMuscle, compiled
from pam_check.blind.second_motion import (
    OF_JOINT,
    OF_MUSCLE,
    PRESSURE,
    SEEN,
    SHARES,
    SPOOL_DAMPING,
    STATES,
    Q,
    SecondJoint,
    advance,
    at_rest,
    sensed_pressure,
    tension,
)
from pam_check.blind.truth_plant import (
    PressureExcitation,
    Sensors,
    SupplyWander,
    TruthJoint,
    TruthMuscle,
    TruthRecording,
)

STEP = 1e-4  # s
TUBE_STEP = 2.5e-5  # s, for the pressure waves in its lumps
FULL_SCALE = 1.0e6  # Pa
FARTHEST = 1.5  # of the limits
LEAK_PRESSURE = 4.0e5  # Pa absolute, at which a laminar leak equals one by its conductance
AMBIENT = 1.01325e5  # Pa
DENSITY = 1.185  # kg/m^3, of ISO 6358
WARM_UP = (5.0, 60.0)  # s
USUAL_OPENING = 0.3  # of the spool, at which a silencer leaves the share that is drawn


def laminar(conductance: float) -> float:
    """Laminar leak [kg/(s Pa^2)] that a sonic conductance is about equal to."""
    return conductance * DENSITY * LEAK_PRESSURE / (LEAK_PRESSURE**2 - AMBIENT**2)


def tube_of(volume: float, conductance: float) -> tuple[float, float]:
    """Diameter and length [m] of a tube with this volume and sonic conductance.

    The conductance follows C = 0.029 D^2 / sqrt(L / D^1.25 + 510), in SI units (Eckersten, as
    makers of tubes state it).
    """
    low, high = 2e-4, 2e-2
    for _ in range(60):
        diameter = math.sqrt(low * high)
        length = 4.0 * volume / (math.pi * diameter**2)
        if 0.029 * diameter**2 / math.sqrt(length / diameter**1.25 + 510.0) < conductance:
            low = diameter
        else:
            high = diameter
    return diameter, length


def muscle_of(truth: TruthMuscle) -> SecondMuscle:
    """The numbers that the laws need."""
    diameter, length = 0.0, 0.0
    lump = 0.0
    if truth.tube_volume > 0.0:
        diameter, length = tube_of(truth.tube_volume, truth.tube_conductance)
        lump = truth.tube_volume / (2 * LUMPS)
    slow = truth.second_pole
    frequency = 2.0 * SPOOL_DAMPING / (truth.time_constant + slow) if slow > 0.0 else 0.0
    ratio = truth.exhaust_ratio
    return SecondMuscle(
        thread_length=truth.thread_length,
        turns=truth.turns,
        rest_length=truth.rest_length,
        neutral_length=truth.neutral_length,
        dead_volume=truth.dead_volume + lump,
        conductance=truth.sonic_conductance,
        critical_ratio=truth.critical_ratio,
        time_constant=truth.time_constant,
        spool_frequency=frequency,
        overlap=truth.dead_zone,
        null=truth.null_offset,
        spool_friction=truth.spool_hysteresis,
        silencer=USUAL_OPENING / math.sqrt(ratio**-2 - 1.0) if ratio < 1.0 else 0.0,
        leak=laminar(truth.leak),
        tube_diameter=diameter,
        tube_length=length,
        heat=truth.heat_transfer,
        rub=truth.thread_friction,
        play=truth.play_length,
        creep_stiffness=2.0 * truth.creep_stiffness,
        creep_share=4.0 * truth.creep_order,
        rubber=truth.bladder_volume * truth.bladder_modulus / 3.0,
        taper=16.0 * (truth.end_factor - 1.0),
        hoop=truth.threshold_pressure,
        yarn=truth.thread_compliance,
        cable=700.0 * truth.cable_compliance,
    )


def joint_of(truth: TruthJoint) -> SecondJoint:
    """The numbers that the laws need."""
    return SecondJoint(
        pulley_radius=truth.pulley_radius,
        inertia=truth.inertia,
        viscous_friction=truth.viscous_friction,
        gravity_torque=truth.gravity_torque,
        gravity_angle=truth.gravity_angle,
        lower_limit=truth.lower_limit,
        upper_limit=truth.upper_limit,
        temperature=truth.temperature,
        ambient=truth.ambient_pressure,
        supply=truth.supply_pressure,
        sliding=truth.coulomb_torque,
        breaking=max(truth.static_torque, truth.coulomb_torque),
        stribeck_speed=truth.stribeck_speed,
        presliding=truth.bristle_angle,
        reservoir=truth.reservoir_volume,
        reservoir_conductance=truth.reservoir_conductance,
        oval=truth.pulley_eccentricity,
        ripple=truth.torque_ripple,
        cross_leak=laminar(truth.cross_leak),
        gap=truth.backlash,
    )


@compiled
def delivered(commands: Array, at: float, delay: float, dt: float, i: int) -> float:
    """Command at the valve at the time `at` [s], over a bus with slots of half the delay."""
    if delay > 0.0:
        slot = 0.5 * delay
        at = math.floor((at - 0.75 * delay) / slot) * slot
    k = math.floor(at / dt + 1e-6)
    return 0.0 if k < 0 else float(commands[k, i])


@compiled
def sensor_error(gauge: float, bent: float) -> float:
    """Error of a sensor [Pa] that is right at zero, half and full scale."""
    x = gauge / FULL_SCALE
    return bent * FULL_SCALE * x * (1.0 - x) * (1.0 - 2.0 * x) / 0.0962


@compiled
def quantised(value: float, step: float) -> float:
    """The nearest step of a converter."""
    return round(value / step) * step


@compiled
def control(
    k: int, loop: Array, level: Array, difference: Array, goal: Array, seen: Array, sums: Array,
    commands: Array,
) -> None:  # fmt: skip
    """Set the valve commands of a sample: a PI loop for each pressure, that of the angle beside."""
    dt, proportional, integral, gain, step = loop
    split = difference[k] + gain * (goal[k] - seen[2] if gain > 0.0 else 0.0)
    for i in range(2):
        error = max(level[k] + (1 - 2 * i) * split, 0.0) - seen[i]
        wanted = proportional * error + sums[i]
        if abs(wanted) < 1.0:
            sums[i] += integral * error * dt
        commands[k, i] = quantised(min(max(wanted, -1.0), 1.0), step)


@compiled
def play(
    joint: SecondJoint, muscles: tuple[SecondMuscle, SecondMuscle], y: Array, step: float,
    loop: Array, references: tuple[Array, Array, Array], fixed: bool, sensing: Array,
    late: Array, supply: Array, noise: Array, commands: Array, sensed: Array, truth: Array,
    stuck: Array, sums: Array, begin: int, end: int,
) -> int:  # fmt: skip
    """Run the samples from `begin` to before `end`; return where the joint diverged, or `end`.

    `stuck` and `sums` are kept between two calls, as the states `y` are. `sensing` has a row for
    each pressure (gain, bias, time of the filter, bend), and one for the position (offset, delay,
    oval ring, not used); `late` has the delays of both commands [s].
    """
    dt = loop[0]
    steps = max(1, math.ceil(dt / step - 1e-9))
    h = dt / steps
    work, seen = np.zeros((5, STATES)), np.zeros(3)
    offset, delay, ring = sensing[2, 0], sensing[2, 1], sensing[2, 2]
    for k in range(begin, end):
        truth[k, 2] = y[Q]
        for i in range(2):
            at = OF_JOINT + i * OF_MUSCLE
            truth[k, i] = y[at + PRESSURE] - joint.ambient
            gauge = sensed_pressure(muscles[i], y, at) - joint.ambient
            if sensing[i, 2] > 0.0:
                gauge = y[at + SEEN]
            bent = gauge + sensor_error(gauge, sensing[i, 3])
            seen[i] = sensing[i, 0] * bent + sensing[i, 1] + noise[k, i]
            seen[i] = sensed[k, i] = quantised(seen[i], loop[5])
            sensed[k, 3 + i] = tension(joint, muscles[i], y, at, 1.0 - 2.0 * i) + noise[k, 3 + i]
        behind = max(k - delay / dt, 0.0)
        low = int(behind)
        q = truth[low, 2]
        if low < k:
            q += (behind - low) * (truth[low + 1, 2] - q)
        q += offset + ring * (math.sin(2.0 * q + 0.6) - math.sin(0.6))
        seen[2] = sensed[k, 2] = quantised(q + noise[k, 2], loop[6])
        if not fixed:
            control(k, loop[:5], *references, seen, sums, commands)
        for j in range(steps):
            now = k * dt + j * h
            command_a = delivered(commands, now, late[0], dt, 0)
            command_b = delivered(commands, now, late[1], dt, 1)
            advance(joint, muscles, y, command_a, command_b, supply[k], h, stuck, work)
            for i in range(2):
                if sensing[i, 2] > 0.0:
                    at = OF_JOINT + i * OF_MUSCLE
                    w = math.sqrt(2.0) / sensing[i, 2]
                    goal = sensed_pressure(muscles[i], y, at) - joint.ambient
                    pushed = w * w * (goal - y[at + SEEN]) - math.sqrt(2.0) * w * y[at + SEEN + 1]
                    y[at + SEEN + 1] += h * pushed
                    y[at + SEEN] += h * y[at + SEEN + 1]
        farthest = FARTHEST * max(joint.upper_limit, -joint.lower_limit)
        if not abs(y[Q]) < farthest:
            return k
    return end


def slow_errors(sensors: Sensors, dt: float, n: int, random: np.random.Generator) -> Array:
    """Noise with a falling spectrum and drifting zeros, shape (n, 5)."""
    result = np.zeros((n, 5))
    time = np.arange(n) * dt
    drifts = [sensors.pressure_drift] * 2 + [sensors.position_drift] + [sensors.force_drift] * 2
    for i, drift in enumerate(drifts):
        warm = random.uniform(*WARM_UP)
        result[:, i] = drift * random.uniform(-1.0, 1.0) * -np.expm1(-time / warm)
    for i in range(2):
        for corner in sensors.pressure_corner * np.array([0.25, 1.0, 4.0]):
            decay = math.exp(-2.0 * math.pi * corner * dt)
            state = random.standard_normal()
            kicks = random.standard_normal(n) * math.sqrt(1.0 - decay**2)
            kicks[0] += decay * state
            result[:, i] += sensors.pressure_colour / math.sqrt(3.0) * relaxed(kicks, decay)
    return result


@compiled
def relaxed(kicks: Array, decay: float) -> Array:
    """Sum of kicks that decay from one sample to the next."""
    result = kicks.copy()
    for k in range(1, kicks.size):
        result[k] += decay * result[k - 1]
    return result


def supply_share(supply: SupplyWander | None, time: Array) -> Array:
    """Supply pressure over its mean: filled for a fifth of a period, then emptied; and strokes."""
    if supply is None:
        return np.ones(time.size)
    part = time / supply.period % 1.0
    wave = np.where(part < 0.2, part / 0.1 - 1.0, 1.0 - (part - 0.2) / 0.4)
    strokes = np.abs(np.sin(math.pi * supply.frequency * time)) - 2.0 / math.pi
    return np.asarray(1.0 + supply.wander * wave + 1.5 * supply.ripple * strokes)


class SecondPlant:
    """A rig at rest at position 0 with its sensors, which runs for some samples at a time.

    Parameters
    ----------
    joint, muscles : TruthJoint, (TruthMuscle, TruthMuscle)
        Agonist first.
    sensors : Sensors
        Noise and quantisation of what is seen.
    generator : numpy.random.Generator
        Source of the noise.
    period : float
        Time between two samples [s]; commands are held meanwhile.
    count : int
        Number of samples that can be run.
    pressures : tuple of float
        Gauge pressures of the muscles at first [Pa].
    supply : ndarray
        Pressure of the supply in each sample over that of the rig, shape (count,) [-].
    step : float, optional
        Longest step of the integration [s]; a quarter of it with tubes.

    Attributes
    ----------
    commands : ndarray
        Of both valves in each sample, shape (count, 2).
    loop : ndarray
        Period [s], gains of the pressure loops (proportional, integral) and of the angle, and steps
        of command, pressure and position. Without gains, the commands are those given.
    references : tuple of ndarray or None
        Level and difference of the pressures [Pa], and position [rad], for the loops; None: the
        commands are given.
    sensed, truth : ndarray
        As of `running_truth.RunningTruth`.
    samples : int
        Number of samples that have been run.
    """

    def __init__(
        self,
        joint: TruthJoint,
        muscles: tuple[TruthMuscle, TruthMuscle],
        sensors: Sensors,
        generator: np.random.Generator,
        *,
        period: float,
        count: int,
        pressures: tuple[float, float],
        supply: Array,
        step: float = STEP,
    ) -> None:
        self._step, self._share = step, supply
        self._noise = generator.standard_normal((count, 5)) * np.array(
            [sensors.pressure_noise] * 2 + [sensors.position_noise] + [sensors.force_noise] * 2
        )
        if sensors.pressure_colour > 0.0 or sensors.pressure_drift > 0.0:
            self._noise += slow_errors(sensors, period, count, generator)
        steps = [sensors.command_step, sensors.pressure_step, sensors.position_step]
        self.loop = np.array([period, 0.0, 0.0, 0.0, *steps])
        self.references: tuple[Array, Array, Array] | None = None
        self.commands = np.zeros((count, 2))
        self.sensed, self.truth = np.zeros((count, 5)), np.zeros((count, 3))
        self.samples = 0
        self.becomes(joint, muscles)
        inside, pair = joint_of(joint), (muscle_of(muscles[0]), muscle_of(muscles[1]))
        self._states = at_rest(inside, pair, pressures)
        self._stuck, self._sums = np.zeros(len(SHARES)), np.zeros(2)

    def becomes(self, joint: TruthJoint, muscles: tuple[TruthMuscle, TruthMuscle]) -> None:
        """Change the rig while it runs, as when a payload is put on; its state is kept."""
        self._joint = SecondJoint(*map(float, joint_of(joint)))
        first, second = map(muscle_of, muscles)
        self._muscles = SecondMuscle(*map(float, first)), SecondMuscle(*map(float, second))
        self._supply = joint.supply_pressure * self._share
        self._late = np.array([float(m.command_delay) for m in muscles])
        self._sensing = np.array([
            *([m.pressure_gain, m.pressure_bias, m.pressure_lag, m.pressure_curvature]
              for m in muscles),
            [joint.position_offset, joint.position_delay, joint.encoder_eccentricity, 0.0],
        ])  # fmt: skip

    def run(self, end: int) -> None:
        """Run the samples to before `end`.

        Raises
        ------
        FloatingPointError
            When the rig cannot run, because the joint diverges.
        """
        tubes = any(m.tube_length > 0.0 for m in self._muscles)
        none = np.zeros(0)
        done: int = play(
            self._joint,
            self._muscles,
            self._states,
            self._step * (TUBE_STEP / STEP if tubes else 1.0),
            self.loop,
            self.references or (none, none, none),
            self.references is None,
            self._sensing,
            self._late,
            self._supply,
            self._noise,
            self.commands,
            self.sensed,
            self.truth,
            self._stuck,
            self._sums,
            self.samples,
            end,
        )
        if done < end:
            raise FloatingPointError(f"the drawn rig diverges at {done * self.loop[0]:.2f} s")
        self.samples = end


def run_second(
    joint: TruthJoint,
    muscles: tuple[TruthMuscle, TruthMuscle],
    excitation: PressureExcitation,
    sensors: Sensors,
    generator: np.random.Generator,
    *,
    fixed_commands: Array | None = None,
    supply: SupplyWander | None = None,
    step: float = STEP,
) -> TruthRecording:
    """Run the rig through the excitation and record it.

    Parameters
    ----------
    joint, muscles, excitation, sensors, generator, fixed_commands, supply
        As for `truth_plant.run_truth`.
    step : float
        Longest step of the integration [s]; a quarter of it with tubes.

    Raises
    ------
    FloatingPointError
        When the drawn rig cannot run, because the joint diverges.
    """
    n, dt = excitation.level.size, excitation.sample_time
    time = np.arange(n, dtype=np.float64) * dt
    level, difference = float(excitation.level[0]), float(excitation.difference[0])
    plant = SecondPlant(
        joint,
        muscles,
        sensors,
        generator,
        period=dt,
        count=n,
        pressures=(level + difference, level - difference),
        supply=supply_share(supply, time),
        step=step,
    )
    if fixed_commands is None:
        plant.loop[1:4] = excitation.proportional, excitation.integral, excitation.position_gain
        plant.references = excitation.level, excitation.difference, excitation.reference_position
    else:
        plant.commands[:] = fixed_commands
    plant.run(n)
    commands, sensed, truth = plant.commands, plant.sensed, plant.truth
    return TruthRecording(
        time=time,
        commands=commands,
        pressures=sensed[:, :2],
        position=sensed[:, 2],
        forces=sensed[:, 3:],
        true_pressures=truth[:, :2],
        true_position=truth[:, 2],
    )
