"""Estimates of muscles and joints from the latest pressures and positions: the model node's core.

A measurement is valid while it is younger than `max_age`. If a measurement is missing or too old,
the estimates that need it are NaN, never zero and never the last value. No ROS is needed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from pam_model.errors import DomainError
from pam_model.joints.joint_statics import JointStatics
from pam_model.joints.sensor_correction import SensorCorrection
from pam_model.robot.robot import Robot

NAN = math.nan


@dataclass(slots=True)
class Estimate:
    """One estimate, in the order of the rig's muscles and joints; NaN for unknown values."""

    stamp: float | None  # time of the newest measurement used [s]; None if there is none
    # muscle_lengths, muscle_speeds, muscle_forces: [m], [m/s] (lengthening), [N]
    muscle_lengths: list[float] = field(default_factory=list)
    muscle_speeds: list[float] = field(default_factory=list)
    muscle_forces: list[float] = field(default_factory=list)
    # joint_torques, joint_stiffnesses: [N m], [N m/rad]
    joint_torques: list[float] = field(default_factory=list)
    joint_stiffnesses: list[float] = field(default_factory=list)
    # the reasons for values that are NaN, one line each
    problems: list[str] = field(default_factory=list)


class JointEstimator:
    """Forces, torques and stiffnesses from pressures and positions.

    Sensor errors that the rig file names (gain and bias of a pressure, offset of a position) are
    corrected first.

    Parameters
    ----------
    robot : Robot
        The robot with the effects of its rig file.
    max_age : float, optional
        Older measurements are not used [s].
    closed_chambers : bool, optional
        Estimate the stiffness with shut valves instead of that at constant pressures.
    """

    def __init__(
        self, robot: Robot, max_age: float = 0.1, *, closed_chambers: bool = False
    ) -> None:
        self.robot = robot
        self.max_age = max_age
        self.closed_chambers = closed_chambers
        self._joints = tuple(JointStatics.from_robot(robot, joint) for joint in robot.joints)
        self._correction = SensorCorrection(robot)
        self._muscle_numbers = {name: number for number, name in enumerate(robot.muscle_names)}
        self._joint_numbers = {name: number for number, name in enumerate(robot.joint_names)}
        self._pressures: dict[str, tuple[float, float]] = {}
        self._positions: dict[str, tuple[float, float, float]] = {}

    def take_pressures(self, stamp: float, names: Sequence[str], pressures: Sequence[float]) -> int:
        """Store measured gauge pressures [Pa]; names that are not in the rig are ignored.

        Returns the number of names that belong to this rig.
        """
        taken = 0
        for index, name in enumerate(names):
            number = self._muscle_numbers.get(name)
            if number is not None:
                taken += 1
                if self._is_overtaken(stamp, self._pressures.get(name)):
                    continue
                value = pressures[index] if index < len(pressures) else NAN
                self._pressures[name] = stamp, self._correction.pressure(number, value)
        return taken

    def take_positions(
        self,
        stamp: float,
        names: Sequence[str],
        positions: Sequence[float],
        velocities: Sequence[float],
    ) -> int:
        """Store measured positions [rad] and velocities [rad/s]; either list may be empty.

        Returns the number of names that belong to this rig.
        """
        taken = 0
        for index, name in enumerate(names):
            number = self._joint_numbers.get(name)
            if number is not None:
                taken += 1
                if self._is_overtaken(stamp, self._positions.get(name)):
                    continue
                position = positions[index] if index < len(positions) else NAN
                velocity = velocities[index] if index < len(velocities) else NAN
                corrected = self._correction.position(number, position)
                self._positions[name] = stamp, corrected, velocity
        return taken

    def _is_overtaken(self, stamp: float, kept: tuple[float, ...] | None) -> bool:
        """Whether the stored value is newer, by at most `max_age`; else the clock was set back."""
        return kept is not None and 0.0 < kept[0] - stamp <= self.max_age

    def estimate(self, now: float) -> Estimate:
        """The estimate at time `now` [s] from the stored measurements."""
        result = Estimate(None)
        stamps: list[float] = []
        by_muscle: dict[str, tuple[float, float, float]] = {}
        names = self.robot.muscle_names
        for joint, statics in zip(self.robot.joints, self._joints, strict=True):
            own = [names[place] for place in joint.muscles]
            position, velocity = self._position(joint.name, now, stamps, result.problems)
            pressures = [self._pressure(name, now, stamps, result.problems) for name in own]
            torque = stiffness = NAN
            none = (NAN,) * len(own)
            lengths = forces = none
            if not math.isnan(position):
                lengths = statics.lengths(position)
                speed = 0.0 if math.isnan(velocity) else velocity
                try:
                    # if one pressure is missing, the pulls of other muscles are still estimated
                    known = [0.0 if math.isnan(each) else each for each in pressures]
                    pulls = statics.tensions(known, position, speed)
                    forces = tuple(
                        NAN if math.isnan(pressure) else pull
                        for pressure, pull in zip(pressures, pulls, strict=True)
                    )
                    if known == pressures:
                        torque = statics.torque_of(forces)
                        rate = (
                            statics.closed_stiffness if self.closed_chambers else statics.stiffness
                        )
                        stiffness = rate(pressures, position)
                except DomainError as error:
                    forces = none
                    torque = stiffness = NAN
                    result.problems.append(f"{joint.name} at {position:.4g} rad: {error}")
            for name, arm, length, force in zip(own, statics.arms, lengths, forces, strict=True):
                by_muscle[name] = length, -arm * velocity, force
            result.joint_torques.append(torque)
            result.joint_stiffnesses.append(stiffness)
        for name in names:
            length, speed, force = by_muscle.get(name, (NAN, NAN, NAN))
            result.muscle_lengths.append(length)
            result.muscle_speeds.append(speed)
            result.muscle_forces.append(force)
        result.stamp = max(stamps, default=None)
        return result

    def _position(
        self, name: str, now: float, stamps: list[float], problems: list[str]
    ) -> tuple[float, float]:
        stamp, position, velocity = self._positions.get(name, (NAN, NAN, NAN))
        if not self._usable("position", name, now - stamp, position, problems):
            return NAN, NAN
        stamps.append(stamp)
        return position, velocity if math.isfinite(velocity) else NAN

    def _pressure(self, name: str, now: float, stamps: list[float], problems: list[str]) -> float:
        stamp, pressure = self._pressures.get(name, (NAN, NAN))
        if not self._usable("pressure", name, now - stamp, pressure, problems):
            return NAN
        stamps.append(stamp)
        return pressure

    def _usable(
        self, quantity: str, name: str, age: float, value: float, problems: list[str]
    ) -> bool:
        if math.isnan(age):
            problems.append(f"{name}: no {quantity} was received yet")
        elif abs(age) > self.max_age:
            problems.append(f"{name}: {quantity} is {age:.3g} s old, limit {self.max_age:g} s")
        elif not math.isfinite(value):
            problems.append(f"{name}: {quantity} is {value}")
        else:
            return True
        return False
