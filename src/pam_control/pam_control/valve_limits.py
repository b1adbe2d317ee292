"""The motion that the valves of a joint can drive.

Moving air costs time: a fully open valve changes the pressure of its muscle with a limited rate
(ISO 6358 flow, polytropic chamber). A motion of the joint with speed v, acceleration a and jerk j
needs, at constant stiffness, the pressure rate

    dp/dt = (p_q + p_t g_q + c) v + p_t (J j + B a)

of each muscle: p_q is the pressure per angle and p_t the pressure per torque of the joint's
inverse, g_q the slope of gravity, c what the moved gas is compressed per angle, J the inertia and B
the viscous friction. Divided by the rate that the open valve gives at the pressure which the motion
has there, this is the share of the valve that the motion needs. Above 1, the pressures lag behind,
and the joint overshoots its reference.

All is tabulated over the joint's range at one stiffness.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pam_control.joint_models import JointModels
from pam_control.references.spline import Array
from pam_model.errors import PamError
from pam_model.gas import mass_flow, pressure_rate
from pam_model.robot import Robot, RobotMuscle
from pam_model.views.linearised_joint import operating_point

PLACES = 9  # over the joint's range
RANGE_SHARES = (0.05, 0.95)  # the ends themselves are reached at rest
HIGHEST_SHARE = 0.85  # of the supply's gauge pressure; above it, a valve hardly fills
LOWEST_SHARE = 0.1  # the same for emptying
JERK_SHARE = 0.6  # of the valves' flow for the jerk of a motion; the rest is for its speed
SPEED_SHARE = 0.9  # of the valves' flow for a constant speed


@dataclass(frozen=True, slots=True)
class _Side:
    """One muscle over the joint's range; arrays of shape (PLACES,)."""

    pressure: Array  # at rest [Pa absolute]
    per_torque: Array  # [Pa/(N m)]
    per_velocity: Array  # [Pa/rad]
    volume: Array  # [m^3]
    muscle: RobotMuscle


class ValveDemand:
    """What the motions of a joint need of its valves at one stiffness.

    Parameters
    ----------
    robot : Robot
        Gas and supply.
    stiffness : float
        [N m/rad].

    Raises
    ------
    PamError
        When the muscles cannot hold the joint anywhere.
    """

    def __init__(self, robot: Robot, models: JointModels, stiffness: float) -> None:
        self._robot = robot
        self._moving_torque = models.dynamics.moving_torque
        low, high = models.joint.position_limits
        rows: list[list[tuple[float, float, float, float]]] = []
        places: list[float] = []
        for share in np.linspace(*RANGE_SHARES, PLACES).tolist():
            position = low + share * (high - low)
            try:
                rows.append(_at(models, stiffness, position))
            except PamError:  # the muscles cannot hold the joint there
                continue
            places.append(position)
        if not places:
            raise PamError(f"{models.name}: its muscles cannot hold it anywhere")
        self._places = np.array(places)
        table = np.array(rows)  # place, side, number
        self._sides = []
        for side, muscle in enumerate(models.muscles):
            pressure, per_torque, per_velocity, volume = table[:, side].T
            self._sides.append(_Side(pressure, per_torque, per_velocity, volume, muscle))

    def share(self, position: Array, velocity: Array, acceleration: Array, jerk: Array) -> Array:
        """Share of the valves' flow that a motion needs [-], of the valve that needs more.

        Parameters
        ----------
        position, velocity, acceleration, jerk : ndarray, shape (n,)
            [rad], [rad/s], [rad/s^2], [rad/s^3].
        """
        torque = self._moving_torque(velocity, acceleration)
        torque_rate = self._moving_torque(acceleration, jerk)
        found = np.zeros_like(position)
        for side in self._sides:
            pressure, per_torque, per_velocity, volume = (
                np.interp(position, self._places, row)
                for row in (side.pressure, side.per_torque, side.per_velocity, side.volume)
            )
            needed = per_velocity * velocity + per_torque * torque_rate
            filling, emptying = self._rates(side.muscle, pressure + per_torque * torque, volume)
            found = np.maximum(found, np.where(needed > 0.0, needed / filling, -needed / emptying))
        return found

    def _rates(self, muscle: RobotMuscle, pressure: Array, volume: Array) -> tuple[Array, Array]:
        """Rates [Pa/s] of a fully open valve at a pressure [Pa absolute]; both above 0."""
        gas, supply, valve = self._robot.gas, self._robot.supply.pressure, muscle.valve
        span = supply - gas.ambient_pressure
        flows = (
            (supply, np.minimum(pressure, gas.ambient_pressure + HIGHEST_SHARE * span)),
            (
                np.maximum(pressure, gas.ambient_pressure + LOWEST_SHARE * span),
                gas.ambient_pressure,
            ),
        )
        filling, emptying = (
            pressure_rate(
                mass_flow(
                    valve.sonic_conductance, valve.critical_ratio, above, below, gas.temperature
                ),
                pressure,
                volume,
                temperature=gas.temperature,
                exponent=gas.polytropic_exponent,
            )
            for above, below in flows
        )
        return filling, emptying * valve.exhaust_ratio

    def everywhere(self) -> tuple[float, float, float]:
        """Speed, acceleration and jerk of a motion that the valves can drive anywhere.

        The speed at the end of an acceleration that grows and fades with this jerk leaves enough of
        the valves for the jerk.

        Returns
        -------
        velocity, acceleration, jerk : float
            [rad/s], [rad/s^2], [rad/s^3].
        """
        still, one = np.zeros_like(self._places), np.ones_like(self._places)
        per_speed, per_jerk = (
            max(
                float(self.share(self._places, sign * v, still, sign * j).max())
                for sign in (1.0, -1.0)
            )
            for v, j in ((one, still), (still, one))
        )
        velocity, jerk = 1.0 / per_speed, JERK_SHARE / per_jerk
        acceleration = math.sqrt(2.0 * jerk * (1.0 - JERK_SHARE) * velocity)
        return SPEED_SHARE * velocity, acceleration, jerk


def _at(
    models: JointModels, stiffness: float, position: float
) -> list[tuple[float, float, float, float]]:
    """The rows of `_Side` for both muscles at one position [rad]."""
    gravity = models.dynamics.gravity(position)
    reached = models.model.pressures_for(gravity, stiffness, position)
    point = operating_point(models.joint, models.model, position, reached.pressures)
    slope = models.dynamics.gravity_stiffness(position)
    return [
        (
            pressure + models.model.ambient_pressure,
            per_torque,
            per_position + slope * per_torque + motion,
            volume,
        )
        for pressure, per_torque, per_position, motion, volume in zip(
            reached.pressures,
            point.per_torque,
            point.per_position,
            point.motion_pressure,
            models.model.volumes(position),
            strict=True,
        )
    ]
