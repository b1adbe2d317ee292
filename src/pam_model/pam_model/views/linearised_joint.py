"""A joint and its gas, linearised about an equilibrium.

With deviations q of the position, and pa, pb of the pressures in closed chambers,

    (J s^2 + B s + K) q = na pa + nb pb
    s pi = -ci s q

The derivatives of torque and stiffness are finite differences of the force model, so that any force
model can be used. Torque r (F_a - F_b) and stiffness r^2 (K_a + K_b) follow the rig's nominal
physics.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pam_model.joints.joint_statics import JointStatics
from pam_model.robot.robot import RobotJoint
from pam_model.views.inverse_dynamics import InverseDynamics

PRESSURE_STEP = 10.0  # Pa
POSITION_STEP = 1e-5  # rad
Pair = tuple[float, float]


@dataclass(frozen=True, slots=True)
class OperatingPoint:
    """One joint at rest: the coefficients of its linear equations.

    Attributes
    ----------
    position : float
        [rad].
    stiffness : float
        Stiffness of the muscles at constant pressure [N m/rad].
    pressures : (float, float)
        Agonist, antagonist, gauge [Pa].
    inertia : float
        J [kg m^2].
    damping : float
        B [N m s/rad].
    spring : float
        K: muscles at constant pressure, and gravity [N m/rad].
    torque_slopes : (float, float)
        na, nb [N m/Pa].
    motion_pressure : (float, float)
        ca, cb [Pa/rad].
    per_torque : (float, float)
        Pressure change per torque at constant stiffness and position [Pa/(N m)].
    per_position : (float, float)
        Pressure change per angle at constant torque and stiffness [Pa/rad].
    """

    position: float
    stiffness: float
    pressures: Pair
    inertia: float
    damping: float
    spring: float
    torque_slopes: Pair
    motion_pressure: Pair
    per_torque: Pair
    per_position: Pair

    def swinging_spring(self, frequency: float) -> float:
        """Spring [N m/rad] on which the joint would swing with a frequency [Hz]."""
        return self.inertia * (2.0 * math.pi * frequency) ** 2

    def dynamic_stiffness(self, s: Any) -> Any:
        """J s^2 + B s + K at a Laplace variable s [1/s]: torque per position [N m/rad]."""
        return self.inertia * s * s + self.damping * s + self.spring

    def heavier(self, factor: float) -> OperatingPoint:
        """The joint with a multiple of its inertia."""
        return dataclasses.replace(self, inertia=factor * self.inertia)

    def inertia_beyond(self, other: OperatingPoint, s: Any) -> Any:
        """Dynamic stiffness beyond that of a joint that differs in its inertia [N m/rad]."""
        return (self.inertia - other.inertia) * s * s

    def accelerations(self, *torques: float) -> list[float]:
        """Acceleration [rad/s^2] for each torque [N m]."""
        return [torque / self.inertia for torque in torques]


def operating_point(
    joint: RobotJoint, model: JointStatics, position: float, pressures: Sequence[float]
) -> OperatingPoint:
    """Linearise one joint at rest.

    Parameters
    ----------
    joint : RobotJoint
        Inertia, friction and gravity.
    model : JointStatics
        Its muscles.
    position : float
        [rad].
    pressures : (float, float)
        Gauge pressures of agonist and antagonist [Pa].
    """

    def statics(a: float, b: float, q: float) -> list[float]:
        return [model.torque((a, b), q), model.stiffness((a, b), q)]

    a, b = pressures
    h, e = PRESSURE_STEP, POSITION_STEP
    by_agonist = _slope(statics(a + h, b, position), statics(a - h, b, position), h)
    by_antagonist = _slope(statics(a, b + h, position), statics(a, b - h, position), h)
    by_position = _slope(statics(a, b, position + e), statics(a, b, position - e), e)
    jacobian = np.array([by_agonist, by_antagonist]).T
    per_torque = np.linalg.solve(jacobian, [1.0, 0.0])
    per_position = -np.linalg.solve(jacobian, by_position)
    motion = [
        model.exponent * (pressure + model.ambient_pressure) * slope / volume
        for pressure, slope, volume in zip(
            pressures, model.volume_slopes(position), model.volumes(position), strict=True
        )
    ]
    dynamics = InverseDynamics.from_joint(joint)
    return OperatingPoint(
        position=position,
        stiffness=statics(a, b, position)[1],
        pressures=(a, b),
        inertia=dynamics.inertia,
        damping=dynamics.viscous_friction,
        spring=-by_position[0] + dynamics.gravity_stiffness(position),
        torque_slopes=(by_agonist[0], by_antagonist[0]),
        motion_pressure=(motion[0], motion[1]),
        per_torque=(float(per_torque[0]), float(per_torque[1])),
        per_position=(float(per_position[0]), float(per_position[1])),
    )


def _slope(high: Sequence[float], low: Sequence[float], step: float) -> list[float]:
    return [(x - y) / (2.0 * step) for x, y in zip(high, low, strict=True)]
