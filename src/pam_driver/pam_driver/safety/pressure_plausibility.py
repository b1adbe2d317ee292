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
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from pam_driver.safety.limits_by_size import OBSERVER_GAIN, pressure_residual
from pam_model.errors import PamError
from pam_model.joints.sensor_correction import SensorCorrection
from pam_model.robot import Robot, RobotJoint, RobotMuscle
from pam_model.views.expected_pressure import ExpectedPressure
from pam_model.views.torque_balance import (
    dry_friction_at_rest,
    inertia_torque,
    muscle_torque,
    torque_scale,
    unbalanced_torque,
)

TORQUE_MEMORY: Final = 0.15  # s
PAIR_SHARE: Final = 0.5  # of the limit of one muscle, for both muscles in opposite directions
LONGEST_GAP: Final = 0.05  # s; at the largest flow the model's error of a few per cent adds 5 kPa
# The torques are balanced with measurements that are not older than this [s].
_FRESH: Final = 0.02
_END_STOP: Final = 0.03  # rad; closer to a limit, the end stop may carry torque
_TORQUE_EVERY: Final = 5  # updates of the gas per update of the torques


class Deviation(NamedTuple):
    """How far a measurement deviates from its expected value."""

    kind: str  # "pressure_implausible" or "torque_implausible"
    subject: str  # muscle or joint
    size: float  # ratio of the deviation to the limit in the rig file; 1 and above is a fault
    text: str  # one line for the user


class _MuscleObserver:
    """Observer of the gas in one muscle."""

    def __init__(self, robot: Robot, muscle: RobotMuscle, period: float) -> None:
        self.muscle = muscle
        self.residual = 0.0
        self.limit = pressure_residual(robot, muscle)
        self.pair_limit = PAIR_SHARE * self.limit
        self.restarts = 0
        self._gas = ExpectedPressure(robot, muscle, period)
        self.behind_tube = self._gas.behind_tube
        self._state = self._gas.init()
        self._ambient = robot.gas.ambient_pressure
        self._period = period
        self._gap = 0.0

    def restart(self) -> None:
        """Forget the pressure; the next measurement is the first."""
        self.restarts += not math.isnan(self._state.at_sensor)
        self._state = self._state.known(math.nan)
        self.residual = 0.0

    def update(
        self,
        command: float,
        pressure: float,
        positions: Sequence[float],
        velocities: Sequence[float],
        supply: float,
    ) -> None:
        self._state, acting = self._gas.delayed(self._state, command)
        state = self._state
        measured = pressure + self._ambient
        known = math.isfinite(measured)
        if not known and self._gap + self._period > LONGEST_GAP + 1e-9:
            self.restart()
            state = self._state
        if not state.at_sensor > 0.0:
            if not known:
                return
            state = state.known(max(measured, 1.0))
            self._gap = 0.0
        before = state.at_sensor
        state = self._gas.step(state, acting, positions, velocities, supply)
        self._gap += self._period
        correction = 0.0
        if known:
            self.residual = measured - before
            correction = self._gap * OBSERVER_GAIN * self.residual
            self._gap = 0.0
        self._state = state.corrected(correction)

    @property
    def inside(self) -> float:
        """Pressure in the muscle behind its tube [Pa gauge]; NaN before the first measurement."""
        return self._state.inside - self._ambient


class _JointBalance:
    """Torque balance of one joint."""

    def __init__(self, robot: Robot, joint: RobotJoint) -> None:
        self.robot, self.joint = robot, joint
        self.imbalance = 0.0
        self.muscles = joint.muscles
        # its direction at rest is unknown: an imbalance up to this torque is not a deviation
        self._dry_friction = dry_friction_at_rest(joint)
        self.limit = robot.plausibility.torque_share * torque_scale(robot, joint)
        self._velocity = math.nan
        self._settled = 0.0

    def restart(self) -> None:
        """Forget what was balanced."""
        self.imbalance = self._settled = 0.0
        self._velocity = math.nan

    def update(
        self,
        pressures: Sequence[float],
        positions: Sequence[float],
        velocity: float,
        elapsed: float,
    ) -> None:
        joint = self.joint
        weight = 1.0 - math.exp(-elapsed / TORQUE_MEMORY)
        low, high = joint.position_limits
        known = sum([pressures[place] for place in self.muscles])
        if not low + _END_STOP < positions[joint.place] < high - _END_STOP or math.isnan(known):
            self.restart()
            return
        if self._velocity != self._velocity:
            self._velocity = velocity
        try:
            muscles = muscle_torque(self.robot, joint, pressures, positions)
        except PamError:  # the force model is not defined at this length
            self.imbalance = 0.0
            return
        rest = unbalanced_torque(joint, muscles, positions[joint.place], velocity)
        # the low pass of the acceleration, without differentiating
        acceleration = (velocity - self._velocity) / TORQUE_MEMORY
        self._velocity += weight * (velocity - self._velocity)
        self._settled += weight * (rest - self._settled)
        imbalance = self._settled - inertia_torque(joint, acceleration)
        beyond = max(abs(imbalance) - self._dry_friction, 0.0)
        self.imbalance = math.copysign(beyond, imbalance)


class PressurePlausibility:
    """Compares the measurements of a rig with its physics and the effects that its file names.

    Parameters
    ----------
    robot : Robot
        Its `plausibility` holds the limits.
    period : float
        Time between updates [s].

    Attributes
    ----------
    period : float
        Time between updates [s].
    """

    def __init__(self, robot: Robot, period: float) -> None:
        self.period = period
        self._limits = robot.plausibility
        self._correction = SensorCorrection(robot)
        self._muscles = tuple(_MuscleObserver(robot, muscle, period) for muscle in robot.muscles)
        self._joints = tuple(_JointBalance(robot, joint) for joint in robot.joints)
        self._pressures = [math.nan] * len(robot.muscles)
        self._ages = [math.inf] * len(robot.muscles)
        self._positions = [0.0] * len(robot.joints)
        self._velocities = [0.0] * len(robot.joints)
        self._counts = [0] * len(robot.joints)

    @property
    def restarts(self) -> int:
        """How often the observer of any muscle has restarted after a gap."""
        return sum([muscle.restarts for muscle in self._muscles])

    def restart(self) -> None:
        """Restart all observers, after a pause in which nothing was measured or commanded."""
        for muscle in self._muscles:
            muscle.restart()
        for joint in self._joints:
            joint.restart()
        self._counts = [0] * len(self._joints)

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
        for place, (position, velocity) in enumerate(zip(positions, velocities, strict=True)):
            if not math.isnan(position + velocity):
                self._positions[place], self._velocities[place] = position, velocity
        for index, muscle in enumerate(self._muscles):
            if math.isfinite(pressures[index]):
                self._pressures[index], self._ages[index] = pressures[index], 0.0
            else:
                self._ages[index] += self.period
            muscle.update(
                commands[index],
                pressures[index],
                self._positions,
                self._velocities,
                supply_pressures[index],
            )
            if muscle.behind_tube:  # the sensor does not show what pulls
                self._pressures[index] = muscle.inside
        for place, joint in enumerate(self._joints):
            self._counts[place] += 1
            age = max([self._ages[index] for index in joint.muscles])
            elapsed = self._counts[place] * self.period
            if age > LONGEST_GAP:
                joint.restart()
                self._counts[place] = 0
            elif self._counts[place] >= _TORQUE_EVERY and age <= _FRESH:
                joint.update(self._pressures, positions, velocities[place], elapsed)
                self._counts[place] = 0

    def deviations(self) -> list[Deviation]:
        """The deviations above the warning share of their limit."""
        found: list[Deviation] = []
        share = self._limits.warning_share
        # a muscle below this share of both its limits has none, however the other one deviates
        if any(abs(muscle.residual) / muscle.pair_limit > share for muscle in self._muscles):
            found += self._of_pressures()
        for joint in self._joints:
            size = abs(joint.imbalance) / joint.limit
            if size > share:
                text = (
                    f"pressures and motion disagree by {joint.imbalance:+.2f} N m "
                    f"(limit {joint.limit:.2f} N m): sensor or load"
                )
                found.append(Deviation("torque_implausible", joint.joint.name, size, text))
        return found

    def _of_pressures(self) -> Iterator[Deviation]:
        """The deviations of the gas."""
        share, pairs = self._limits.warning_share, self._opposite_residuals()
        for muscle, opposite in zip(self._muscles, pairs, strict=True):
            size = abs(muscle.residual) / muscle.limit
            limit, cause = muscle.limit, "leak, valve or sensor"
            if opposite / muscle.pair_limit > max(size, share):
                size, limit = opposite / muscle.pair_limit, muscle.pair_limit
                cause = "the other muscle of the joint the other way: hoses, sensors or encoder"
            if size > share:
                text = (
                    f"pressure deviates by {muscle.residual:+.0f} Pa from what the valve command "
                    f"should cause (limit {limit:.0f} Pa): {cause}"
                )
                yield Deviation("pressure_implausible", muscle.muscle.name, size, text)

    def _opposite_residuals(self) -> list[float]:
        """By muscle, by how much both muscles of its joint deviate in opposite directions [Pa]."""
        found = [0.0] * len(self._muscles)
        for joint in self._joints:
            first, second = (self._muscles[place].residual for place in joint.muscles)
            if first * second < 0.0:
                for place in joint.muscles:
                    found[place] = min(abs(first), abs(second))
        return found
