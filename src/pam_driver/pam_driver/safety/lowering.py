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

from pam_model.effects import adjusted
from pam_model.errors import PamError
from pam_model.gas import pressure_rate, valve_flow
from pam_model.joints.effective_force_model import effective_force_model
from pam_model.joints.sensor_correction import SensorCorrection
from pam_model.rig import Joint, Muscle, Rig

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
_PRESSURE_STEP: Final = 1e3  # Pa, of the difference quotient of force and pressure
_LOWEST_RATE: Final = 1e-6  # N m/s, of a muscle that is empty already


class _Exhaust:
    """One muscle: the torque that it gives, and how fast its exhaust takes it away."""

    def __init__(self, rig: Rig, muscle: Muscle, lever: float) -> None:
        self._rig, self._muscle, self._lever = rig, muscle, lever
        self._model = effective_force_model(rig, muscle.name)
        self._ratio = adjusted("valve.exhaust_ratio", None, muscle.effects)
        self._dead_volume = max(0.0, adjusted("dead_volume", muscle.dead_volume, muscle.effects))

    def length(self, position: float) -> float:
        return self._muscle.neutral_length + self._lever * position

    def torque(self, pressure: float, position: float) -> float:
        """Magnitude [N m]."""
        force = self._model.force(max(pressure, 0.0), self.length(position))
        return abs(self._lever) * float(force)

    def pressure_rate(self, pressure: float, position: float) -> float:
        """How fast the pressure falls with the exhaust fully open [Pa/s], at least 0."""
        gas, valve = self._rig.gas, self._muscle.valve
        inside = max(pressure, 0.0) + gas.ambient_pressure
        flow = valve_flow(
            -1.0,
            inside,
            supply_pressure=self._rig.supply_pressure,
            ambient_pressure=gas.ambient_pressure,
            conductance=valve.sonic_conductance * self._ratio,
            critical_ratio=valve.critical_ratio,
            temperature=gas.temperature,
        )
        volume = float(self._model.volume(self.length(position))) + self._dead_volume
        rate = pressure_rate(
            flow,
            inside,
            volume,
            temperature=gas.temperature,
            exponent=gas.polytropic_exponent,
        )
        return max(-float(rate), 0.0)

    def torque_rate(self, pressure: float, position: float) -> float:
        """How fast its torque falls with the exhaust fully open [N m/s], at least 0."""
        more = self.torque(pressure + _PRESSURE_STEP, position)
        slope = (more - self.torque(pressure, position)) / _PRESSURE_STEP
        return max(slope, 0.0) * self.pressure_rate(pressure, position)


class _JointLowering:
    """The law of one joint."""

    def __init__(self, rig: Rig, joint: Joint, speed: float) -> None:
        effects = joint.effects
        radius = adjusted("joint.pulley_radius", joint.pulley_radius, effects)
        self.places = tuple(rig.muscle_names.index(name) for name in joint.muscles)
        self.exhausts = tuple(
            _Exhaust(rig, rig.muscle(name), lever)
            for name, lever in zip(joint.muscles, (-radius, radius), strict=True)
        )
        self._gravity = adjusted("joint.gravity_torque", joint.gravity_torque, effects)
        self._gravity_angle = joint.gravity_angle
        slowest = max(
            adjusted("valve.time_constant", muscle.valve.time_constant, muscle.effects)
            for muscle in map(rig.muscle, joint.muscles)
        )
        self._torque_rate = min(_TORQUE_RATE, _TORQUE_LAG / slowest)
        inertia = adjusted("joint.inertia", joint.inertia, effects)
        self._gain = min(_VELOCITY_RATE, _VELOCITY_LAG / slowest) * inertia
        self._speed = speed
        self._integral = math.nan

    def start(self) -> None:
        """Forget the last lowering."""
        self._integral = math.nan

    def openings(
        self, pressures: tuple[float, float], position: float, velocity: float, period: float
    ) -> tuple[float, float]:
        """Openings of the exhausts of agonist and antagonist, 0 to 1.

        Raises
        ------
        PamError
            If a force model is not defined at this position.
        """
        first, second = self.exhausts
        load = -self._gravity * math.sin(position - self._gravity_angle)
        pull = first.torque(pressures[0], position) - second.torque(pressures[1], position)
        total = pull + load
        down = math.copysign(1.0, load)
        share = min(abs(load) / max(_REST_SHARE * abs(self._gravity), 1e-9), 1.0)
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
        falls = first.torque_rate(pressures[0], position)
        rises = second.torque_rate(pressures[1], position)
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


class Lowering:
    """Set points that lower all joints of a rig and empty all muscles; never lets air in.

    Parameters
    ----------
    rig : Rig
        Its models say which exhaust moves a joint in which direction.
    speed : float
        Speed with which a loaded joint sinks [rad/s].
    """

    def __init__(self, rig: Rig, speed: float) -> None:
        self._joints = tuple(_JointLowering(rig, joint, speed) for joint in rig.joints)
        self._correction = SensorCorrection(rig)
        self._scales = tuple(
            (muscle.valve.full_scale or 1.0) if muscle.valve.kind != "flow" else None
            for muscle in rig.muscles
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
        for joint, position, velocity in zip(self._joints, true_positions, velocities, strict=True):
            first, second = joint.places
            pair = (
                self._acting(first, true_pressures[first]),
                self._acting(second, true_pressures[second]),
            )
            if not math.isfinite(sum(pair) + position + velocity):
                continue
            try:
                openings = joint.openings(pair, position, velocity, period)
            except PamError:  # the force model is not defined at this length
                continue
            for place, exhaust, opening, pressure in zip(
                joint.places, joint.exhausts, openings, pair, strict=True
            ):
                scale = self._scales[place]
                if scale is None:
                    found[place] = -opening
                else:
                    fall = opening * exhaust.pressure_rate(pressure, position) * period
                    found[place] = max(self._setpoints[place] - fall / scale, 0.0)
        self._setpoints = found
        return tuple(found)

    def _acting(self, place: int, measured: float) -> float:
        """The pressure that acts in a muscle, or soon will [Pa gauge]; NaN if not measured."""
        scale = self._scales[place]
        return measured if scale is None else self._setpoints[place] * scale + 0.0 * measured
