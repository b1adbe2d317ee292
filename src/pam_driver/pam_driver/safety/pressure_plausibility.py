"""Whether measured pressures are plausible: gas balance per muscle, torque balance per joint.

Gas balance: an observer of the gas (ISO 6358 valve, polytropic chamber) takes the valve command as
its input and is corrected slowly towards the measurement. Its residual grows with everything that
this physics does not contain: a leak, a burst, a stuck valve, a stuck or swapped sensor.

Torque balance: the low-pass filtered difference between the torque that the measured pressures
produce and the torque that inertia, friction and gravity require. It detects a pressure sensor that
drifts, which the gas balance cannot detect because its observer follows the drift. Nothing is
judged close to the end stops.

Both muscles of a joint together: crossed hoses, exchanged pressure sensors and an angle that is not
the joint's make the residuals of the pair grow in opposite directions. A supply or a temperature
that differs from the rig file makes them grow in the same direction. Opposite residuals of both
muscles are therefore a fault at a smaller limit, `PAIR_SHARE`, than the residual of one.

Measurements may be missing for a moment. Across a gap of up to `LONGEST_GAP` the observer predicts
the pressure from the valve command, and the next measurement corrects it for the whole time since
the last one, so that gaps hide no fault. After a longer gap the observer restarts.

Both balances contain the effects that the rig file names: the file of each effect
(`pam_model.effects`) describes how this check treats it, and defines the law that is used here.

The observer is a Luenberger observer with one gain (D. G. Luenberger, IEEE Trans. Military
Electronics 8, 1964). Fault detection by its residual: R. J. Patton, P. M. Frank, R. N. Clark, Fault
Diagnosis in Dynamic Systems, 1989.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from pam_driver.safety.limits_by_size import OBSERVER_GAIN, pressure_residual
from pam_driver.safety.tube_gas import LOWEST, TubeGas
from pam_model.effects import adjusted, switched_on
from pam_model.effects.slots import DryFriction, JointTorque, Leak, Opening
from pam_model.errors import PamError
from pam_model.gas import pressure_rate, reference_density, valve_flow
from pam_model.joints.effective_force_model import effective_force_model
from pam_model.joints.sensor_correction import SensorCorrection
from pam_model.rig import Joint, Muscle, Rig

TORQUE_MEMORY: Final = 0.15  # s
PAIR_SHARE: Final = 0.5  # of the limit of one muscle, for both muscles in opposite directions
LONGEST_GAP: Final = 0.05  # s; at the largest flow the model's error of a few per cent adds 5 kPa
# The torques are balanced with measurements that are not older than this [s].
_FRESH: Final = 0.02
_END_STOP: Final = 0.03  # rad; closer to a limit, the end stop may carry torque
_VOLUME_POINTS: Final = 16
_TORQUE_EVERY: Final = 5  # updates of the gas per update of the torques


class Deviation(NamedTuple):
    """How far a measurement deviates from its expected value.

    Attributes
    ----------
    kind : str
        "pressure_implausible" or "torque_implausible".
    subject : str
        Muscle or joint.
    size : float
        Ratio of the deviation to the limit in the rig file; 1 and above is a fault.
    text : str
        One line for the user.
    """

    kind: str
    subject: str
    size: float
    text: str


def _radius(joint: Joint) -> float:
    return adjusted("joint.pulley_radius", joint.pulley_radius, joint.effects)


class _MuscleObserver:
    """Observer of the gas in one muscle."""

    def __init__(self, rig: Rig, muscle: Muscle, period: float) -> None:
        self.muscle = muscle
        self.residual = 0.0
        self.limit = pressure_residual(rig, muscle)
        joint = rig.joint_of(muscle.name)
        self.joint = None if joint is None else rig.joints.index(joint)
        sign = 0.0 if joint is None else -1.0 if joint.agonist == muscle.name else 1.0
        self._lever = 0.0 if joint is None else sign * _radius(joint)
        self._limits = (0.0, 0.0) if joint is None else joint.position_limits
        model = rig.force_model(muscle.name)
        spread = np.linspace(*self._limits, _VOLUME_POINTS) if joint else np.zeros(1)
        lengths = muscle.neutral_length + self._lever * spread
        volumes = [float(model.volume(float(length))) for length in lengths]
        # A cubic polynomial is exact for a cylindrical braid and accurate enough for other models.
        # It is fitted in the stroke: powers of the length alone are nearly dependent.
        fit = np.polyfit(self._lever * spread, volumes, 3 if joint else 0)
        self._volume = tuple(float(c) for c in np.concatenate([np.zeros(4 - len(fit)), fit]))
        valve, effects = muscle.valve, muscle.effects
        self._dead_volume = max(0.0, adjusted("dead_volume", muscle.dead_volume, effects))
        self._openings = [(slot.law, values) for _, slot, values in switched_on(Opening, effects)]
        self._leaks = [(slot.law, values) for _, slot, values in switched_on(Leak, effects)]
        self._exhaust_ratio = adjusted("valve.exhaust_ratio", None, effects)
        self._density = reference_density(rig.gas.temperature)
        time_constant = adjusted("valve.time_constant", valve.time_constant, effects)
        self._is_flow = valve.kind == "flow"
        self._ambient = rig.gas.ambient_pressure
        self._supply = rig.supply_pressure
        self._exponent, self._temperature = rig.gas.polytropic_exponent, rig.gas.temperature
        self._keep = math.exp(-period / time_constant)
        self._period = period
        self._command = -1.0 if self._is_flow else 0.0
        delay = round(adjusted("valve.command_delay", None, effects) / period)
        # the oldest entry is the command that acts now
        self._commands = deque([self._command], maxlen=delay + 1)
        conductance = adjusted("tube.conductance", None, effects)
        tube = (conductance, adjusted("tube.volume", None, effects), valve, rig.gas, period)
        self._tube = TubeGas(*tube) if conductance > 0.0 else None
        self._pressure = math.nan
        self._gap = 0.0
        self.restarts = 0

    def restart(self) -> None:
        """Forget the pressure; the next measurement is the first."""
        self.restarts += not math.isnan(self._pressure)
        self._pressure = math.nan
        self.residual = 0.0

    def update(
        self, command: float, pressure: float, position: float, velocity: float, supply: float
    ) -> None:
        self._commands.append(command)
        command = self._commands[0]
        measured = pressure + self._ambient
        known = math.isfinite(measured)
        if not known and self._gap + self._period > LONGEST_GAP + 1e-9:
            self.restart()
        if not self._pressure > 0.0:
            if not known:
                return
            self._pressure = max(measured, 1.0)
            if self._tube is not None:
                self._tube.inside = self._pressure
            self._gap = 0.0
        low, high = self._limits
        length_rate = self._lever * velocity if low < position < high else 0.0
        stroke = self._lever * min(max(position, low), high)
        a, b, c, d = self._volume
        volume = ((a * stroke + b) * stroke + c) * stroke + d + self._dead_volume
        volume_rate = ((3.0 * a * stroke + 2.0 * b) * stroke + c) * length_rate
        self._command = command + self._keep * (self._command - command)
        supply = self._supply if math.isnan(supply) else supply
        inside = self._pressure
        if self._tube is None:
            rate = pressure_rate(
                self._entering(inside, supply) - self._leaving(inside),
                inside,
                volume,
                volume_rate,
                temperature=self._temperature,
                exponent=self._exponent,
            )
            inside_next = inside + self._period * float(rate)
        else:
            inside_next = self._tube.advance(
                inside, lambda at: self._entering(at, supply), self._leaving, volume, volume_rate
            )
        self._gap += self._period
        if known:
            self.residual = measured - inside
            correction = self._gap * OBSERVER_GAIN * self.residual
            inside_next += correction
            if self._tube is not None:
                self._tube.inside = max(self._tube.inside + correction, LOWEST)
            self._gap = 0.0
        self._pressure = max(inside_next, LOWEST)

    @property
    def behind_tube(self) -> bool:
        """Whether the rig file names a tube."""
        return self._tube is not None

    @property
    def inside(self) -> float:
        """Pressure in the muscle behind its tube [Pa gauge]; NaN before the first measurement."""
        return math.nan if self._tube is None else self._tube.inside - self._ambient

    def _entering(self, pressure: float, supply: float) -> float:
        """Flow of the valve [kg/s] at a pressure behind it [Pa absolute]."""
        valve = self.muscle.valve
        if self._is_flow:
            opening = min(max(self._command, -1.0), 1.0)
            for law, values in self._openings:
                opening = law(opening, *values)
        else:
            target = self._command * (valve.full_scale or 0.0) + self._ambient
            # a regulator opens fully until the pressure is close to its set point
            opening = min(max((target - pressure) / 2e4, -1.0), 1.0)
        if opening < 0.0:
            opening *= self._exhaust_ratio
        return float(
            valve_flow(
                opening,
                pressure,
                supply_pressure=supply,
                ambient_pressure=self._ambient,
                conductance=valve.sonic_conductance,
                critical_ratio=valve.critical_ratio,
                temperature=self._temperature,
            )
        )

    def _leaving(self, pressure: float) -> float:
        """Flow of the leaks [kg/s] at a pressure [Pa absolute]."""
        critical = self.muscle.valve.critical_ratio
        return self._density * sum(
            law(pressure, self._ambient, critical, *values) for law, values in self._leaks
        )


class _JointBalance:
    """Torque balance of one joint."""

    def __init__(self, rig: Rig, joint: Joint) -> None:
        self.joint = joint
        self.imbalance = 0.0
        self.muscles = tuple(rig.muscle_names.index(name) for name in joint.muscles)
        effects = joint.effects
        self._radius = _radius(joint)
        self._inertia = adjusted("joint.inertia", joint.inertia, effects)
        self._damping = adjusted("joint.viscous_friction", joint.viscous_friction, effects)
        self._gravity = adjusted("joint.gravity_torque", joint.gravity_torque, effects)
        self._torques = [
            (slot.law, values) for _, slot, values in switched_on(JointTorque, effects)
        ]
        # its direction at rest is unknown: an imbalance up to this torque is not a deviation
        self._dry_friction = sum(
            slot.law(0.0, *values) for _, slot, values in switched_on(DryFriction, effects)
        )
        self._models = tuple(effective_force_model(rig, name) for name in joint.muscles)
        self._neutral = tuple(rig.muscle(name).neutral_length for name in joint.muscles)
        highest = rig.muscle(joint.agonist).max_pressure
        self.scale = self._radius * float(self._models[0].force(highest, self._neutral[0]))
        self._velocity = math.nan
        self._settled = 0.0

    def restart(self) -> None:
        """Forget what was balanced."""
        self.imbalance = self._settled = 0.0
        self._velocity = math.nan

    def update(
        self, pressures: Sequence[float], position: float, velocity: float, elapsed: float
    ) -> None:
        joint = self.joint
        weight = 1.0 - math.exp(-elapsed / TORQUE_MEMORY)
        low, high = joint.position_limits
        first, second = (max(pressures[index], 0.0) for index in self.muscles)
        if not low + _END_STOP < position < high - _END_STOP or math.isnan(first + second):
            self.restart()
            return
        if self._velocity != self._velocity:
            self._velocity = velocity
        radius = self._radius
        try:
            torque = radius * float(
                self._models[0].force(first, self._neutral[0] - radius * position)
            ) - radius * float(self._models[1].force(second, self._neutral[1] + radius * position))
        except PamError:  # the force model is not defined at this length
            self.imbalance = 0.0
            return
        # the low pass of the acceleration, without differentiating
        acceleration = (velocity - self._velocity) / TORQUE_MEMORY
        self._velocity += weight * (velocity - self._velocity)
        rest = (
            torque
            - self._damping * velocity
            - self._gravity * math.sin(position - joint.gravity_angle)
        )
        for law, values in self._torques:
            rest += law(position, velocity, *values)
        self._settled += weight * (rest - self._settled)
        imbalance = self._settled - self._inertia * acceleration
        beyond = max(abs(imbalance) - self._dry_friction, 0.0)
        self.imbalance = math.copysign(beyond, imbalance)


class PressurePlausibility:
    """Compares the measurements of a rig with its physics and the effects that its file names.

    Parameters
    ----------
    rig : Rig
        Its `plausibility` holds the limits.
    period : float
        Time between updates [s].

    Attributes
    ----------
    period : float
        Time between updates [s].
    """

    def __init__(self, rig: Rig, period: float) -> None:
        self.period = period
        self._limits = rig.plausibility
        self._correction = SensorCorrection(rig)
        self._muscles = tuple(_MuscleObserver(rig, muscle, period) for muscle in rig.muscles)
        self._joints = tuple(_JointBalance(rig, joint) for joint in rig.joints)
        self._pressures = [math.nan] * len(rig.muscles)
        self._ages = [math.inf] * len(rig.muscles)
        self._poses = [(0.0, 0.0)] * len(rig.joints)
        self._counts = [0] * len(rig.joints)

    @property
    def restarts(self) -> int:
        """How often the observer of any muscle has restarted after a gap."""
        return sum(muscle.restarts for muscle in self._muscles)

    def restart(self) -> None:
        """Restart all observers, after a pause in which nothing was measured or commanded."""
        for muscle in self._muscles:
            muscle.restart()

    def update(
        self,
        commands: Sequence[float],
        pressures: Sequence[float],
        positions: Sequence[float],
        velocities: Sequence[float],
        supply_pressures: Sequence[float],
    ) -> None:
        """Advance by one period.

        Parameters
        ----------
        commands : sequence of float
            By muscle, the last command sent to its valve as fraction of full scale; a vent is -1
            for a flow valve and 0 for a regulator.
        pressures : sequence of float
            New measurements by muscle [Pa gauge]; NaN if there is none since the last update.
        positions, velocities : sequence of float
            Measurements by joint [rad], [rad/s].
        supply_pressures : sequence of float
            By muscle [Pa absolute]; NaN if unknown: the value of the rig file is used.
        """
        pressures = self._correction.pressures(pressures)
        positions = self._correction.positions(positions)
        for place, pose in enumerate(zip(positions, velocities, strict=True)):
            if not math.isnan(sum(pose)):
                self._poses[place] = pose
        for index, muscle in enumerate(self._muscles):
            if math.isfinite(pressures[index]):
                self._pressures[index], self._ages[index] = pressures[index], 0.0
            else:
                self._ages[index] += self.period
            position, velocity = (0.0, 0.0) if muscle.joint is None else self._poses[muscle.joint]
            muscle.update(
                commands[index], pressures[index], position, velocity, supply_pressures[index]
            )
            if muscle.behind_tube:  # the sensor does not show what pulls
                self._pressures[index] = muscle.inside
        for place, joint in enumerate(self._joints):
            self._counts[place] += 1
            age = max(self._ages[index] for index in joint.muscles)
            elapsed = self._counts[place] * self.period
            if age > LONGEST_GAP:
                joint.restart()
                self._counts[place] = 0
            elif self._counts[place] >= _TORQUE_EVERY and age <= _FRESH:
                joint.update(self._pressures, positions[place], velocities[place], elapsed)
                self._counts[place] = 0

    def deviations(self) -> Iterator[Deviation]:
        """The deviations above the warning share of their limit."""
        limits = self._limits
        pairs = self._opposite_residuals()
        for muscle, opposite in zip(self._muscles, pairs, strict=True):
            size = abs(muscle.residual) / muscle.limit
            limit, cause = muscle.limit, "leak, valve or sensor"
            pair_limit = PAIR_SHARE * muscle.limit
            if opposite / pair_limit > max(size, limits.warning_share):
                size, limit = opposite / pair_limit, pair_limit
                cause = "the other muscle of the joint the other way: hoses, sensors or encoder"
            if size > limits.warning_share:
                text = (
                    f"pressure deviates by {muscle.residual:+.0f} Pa from what the valve command "
                    f"should cause (limit {limit:.0f} Pa): {cause}"
                )
                yield Deviation("pressure_implausible", muscle.muscle.name, size, text)
        for joint in self._joints:
            size = abs(joint.imbalance) / (limits.torque_share * joint.scale)
            if size > limits.warning_share:
                text = (
                    f"pressures and motion disagree by {joint.imbalance:+.2f} N m "
                    f"(limit {limits.torque_share * joint.scale:.2f} N m): sensor or load"
                )
                yield Deviation("torque_implausible", joint.joint.name, size, text)

    def _opposite_residuals(self) -> list[float]:
        """By muscle, by how much both muscles of its joint deviate in opposite directions [Pa]."""
        found = [0.0] * len(self._muscles)
        for joint in self._joints:
            first, second = (self._muscles[place].residual for place in joint.muscles)
            if first * second < 0.0:
                for place in joint.muscles:
                    found[place] = min(abs(first), abs(second))
        return found
