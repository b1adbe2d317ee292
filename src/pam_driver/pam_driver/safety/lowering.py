"""Empties the muscles so that no joint is thrown: loaded joints sink slowly (stop category 1).

If both valves of a joint open their exhausts at once, the muscle with the higher pressure per lever
wins for a moment, and the arm may rise before it falls. Here the exhausts share the work. In each
cycle the measured pressures and the measured angle give the torque of the muscles (the rig's force
models) and the torque of gravity. The law wants a sum of both that lets the joint sink with
`speed`, never more than gravity alone would give:

    wanted = Kp (v_wanted - v) + I,   dI/dt = Ki (v_wanted - v),   wanted <= gravity torque

where v_wanted points to where gravity pulls and vanishes where gravity does. The sum follows what
is wanted with the rate R = K (wanted - sum) [N m/s]; K and Kp are smaller where valves are slow.
Exhausts only let air out, so

    rate = -u_a rho_a + u_b rho_b = R,   0 <= u <= MOST_OPEN, one alone up to 1

where rho is the rate of torque per opening from ISO 6358 and the polytropic chamber, as in the
nominal plant. Of the two openings that give R, the largest are used, so that both muscles become
empty: the one against gravity as fast as the other allows. A flow valve gets -u; the set point of a
pressure regulator falls from where it was by the pressure that would leave through the opening u,
and stands for its pressure in the sum, since the measured one lags behind it.

At the start, the sum at rest must be zero; what the model says instead (a payload that the rig file
does not have, a sensor's zero) is where the integral begins. Muscles without a joint are emptied at
once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from pam_model.errors import PamError
from pam_model.joints.sensor_correction import SensorCorrection
from pam_model.robot import Robot, RobotJoint
from pam_model.views.exhaust_torque import exhaust_pressure_rate, exhaust_torque_rate
from pam_model.views.gravity import gravity_torque, largest_gravity_torque
from pam_model.views.torque_balance import inertia_torque, muscle_torque

MOST_OPEN: Final = 0.5  # of full opening; leaves room to be wrong about the other exhaust
_VELOCITY_RATE: Final = 20.0  # 1/s, Kp over the inertia at most
_INTEGRAL_RATE: Final = 8.0  # 1/s, Ki over Kp
_TORQUE_RATE: Final = 30.0  # 1/s, K at most
# K and Kp over the inertia, times the time constant of the slower valve, stay below these.
_TORQUE_LAG: Final = 0.25
_VELOCITY_LAG: Final = 0.15
_AT_REST: Final = 0.3  # rad/s; the initial sum counts fully at rest and not at all above this speed
# The wanted speed falls to zero where gravity's torque is below this share of its largest value.
_REST_SHARE: Final = 0.1
_LONGEST_STEP: Final = 0.02  # s; after a pause of the host, the set points do not jump
_LOWEST_RATE: Final = 1e-6  # N m/s, of a muscle that is empty already


class _JointLowering:
    """The law of one joint."""

    def __init__(self, robot: Robot, joint: RobotJoint, speed: float) -> None:
        self.places = joint.muscles
        self._robot, self._joint = robot, joint
        slowest = max(robot.muscles[place].valve.time_constant for place in joint.muscles)
        self._torque_rate = min(_TORQUE_RATE, _TORQUE_LAG / slowest)
        self._gain = inertia_torque(joint, min(_VELOCITY_RATE, _VELOCITY_LAG / slowest))
        self._most_load = largest_gravity_torque(joint)
        self._speed = speed
        self._integral = math.nan

    def start(self) -> None:
        """Forget the last lowering."""
        self._integral = math.nan

    def openings(
        self,
        pressures: Sequence[float],
        positions: Sequence[float],
        velocity: float,
        period: float,
    ) -> tuple[float, float]:
        """Openings of the exhausts of agonist and antagonist, 0 to 1.

        Raises
        ------
        PamError
            If a force model is not defined at this position.
        """
        robot, joint = self._robot, self._joint
        load = gravity_torque(joint, positions[joint.place])
        total = muscle_torque(robot, joint, pressures, positions) + load
        down = math.copysign(1.0, load)
        share = min(abs(load) / max(_REST_SHARE * self._most_load, 1e-9), 1.0)
        if math.isnan(self._integral):
            self._integral = total * max(0.0, 1.0 - abs(velocity) / _AT_REST)
        miss = down * share * self._speed - velocity
        wanted = self._gain * miss + self._integral
        # never faster downwards than gravity alone; a joint that rises may be braked
        most = max(abs(load), -down * self._gain * velocity)
        if down * wanted <= most:
            self._integral += _INTEGRAL_RATE * self._gain * miss * period
        wanted = down * min(down * wanted, most)
        rate = self._torque_rate * (wanted - total)
        falls, rises = (
            exhaust_torque_rate(robot, arm, pressures[arm.muscle], positions) for arm in joint.arms
        )
        return _share(rate, falls, rises)


def _share(rate: float, first: float, second: float) -> tuple[float, float]:
    """The openings whose torque rates -u_a first + u_b second give `rate`, or nearly.

    Both are as large as possible up to `MOST_OPEN`; one alone opens further if it has to.
    """
    first, second = max(first, _LOWEST_RATE), max(second, _LOWEST_RATE)
    one = (MOST_OPEN * second - rate) / first
    other = (MOST_OPEN * first + rate) / second
    if one < 0.0:
        return 0.0, min(rate / second, 1.0)
    if other < 0.0:
        return min(-rate / first, 1.0), 0.0
    return (one, MOST_OPEN) if one <= MOST_OPEN else (MOST_OPEN, other)


class LoweringSetpoints:
    """Set points that lower all joints of a rig and empty all muscles; never lets air in.

    Parameters
    ----------
    robot : Robot
        Its models say which exhaust moves a joint in which direction.
    speed : float
        Speed with which a loaded joint sinks [rad/s].
    """

    def __init__(self, robot: Robot, speed: float) -> None:
        self._robot = robot
        self._joints = tuple(_JointLowering(robot, joint, speed) for joint in robot.joints)
        self._correction = SensorCorrection(robot)
        self._scales = tuple(
            (muscle.valve.full_scale or 1.0) if muscle.valve.kind != "flow" else None
            for muscle in robot.muscles
        )
        self._setpoints: list[float] = []
        self._time = 0.0

    def start(self, setpoints: Sequence[float], now: float) -> None:
        """Begin to lower.

        Parameters
        ----------
        setpoints : sequence of float
            By muscle, the last set point as fraction of full scale; a regulator's falls from it.
        now : float
            Monotonic time [s].
        """
        self._setpoints = list(setpoints)
        self._time = now
        for joint in self._joints:
            joint.start()

    def setpoints(
        self,
        pressures: Sequence[float],
        positions: Sequence[float],
        velocities: Sequence[float],
        now: float,
    ) -> tuple[float, ...]:
        """The set points of one cycle as fractions of full scale, by muscle.

        Parameters
        ----------
        pressures : sequence of float
            By muscle [Pa gauge]; NaN if unknown.
        positions, velocities : sequence of float
            By joint [rad], [rad/s]; NaN if unknown: then its exhausts open fully.
        now : float
            Monotonic time [s].
        """
        period = min(max(now - self._time, 0.0), _LONGEST_STEP)
        self._time = now
        true_pressures = self._correction.pressures(pressures)
        true_positions = self._correction.positions(positions)
        found = [-1.0 if scale is None else 0.0 for scale in self._scales]
        acting = [self._acting(place, measured) for place, measured in enumerate(true_pressures)]
        for place, (joint, velocity) in enumerate(zip(self._joints, velocities, strict=True)):
            known = [acting[muscle] for muscle in joint.places]
            if not math.isfinite(sum(known) + true_positions[place] + velocity):
                continue
            try:
                openings = joint.openings(acting, true_positions, velocity, period)
            except PamError:  # the force model is not defined at this length
                continue
            for muscle, opening in zip(joint.places, openings, strict=True):
                scale = self._scales[muscle]
                if scale is None:
                    found[muscle] = -opening
                else:
                    fall = (
                        opening
                        * period
                        * exhaust_pressure_rate(
                            self._robot, self._robot.muscles[muscle], acting[muscle], true_positions
                        )
                    )
                    found[muscle] = max(self._setpoints[muscle] - fall / scale, 0.0)
        self._setpoints = found
        return tuple(found)

    def _acting(self, place: int, measured: float) -> float:
        """The pressure that acts in a muscle, or soon will [Pa gauge]; NaN if not measured."""
        scale = self._scales[place]
        return measured if scale is None else self._setpoints[place] * scale + 0.0 * measured
