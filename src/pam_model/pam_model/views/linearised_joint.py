"""A joint and its gas, linearised about an equilibrium.

With deviations q of the position, and pa, pb, ... of the pressures in closed chambers,

    (J s^2 + B s + K) q = na pa + nb pb + ...
    s pi = -ci s q

The derivatives of torque and stiffness are finite differences of the force model, so that any force
model can be used.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pam_model.joints.joint_statics import JointStatics
from pam_model.robot.robot import RobotJoint
from pam_model.views.gravity import gravity_stiffness

PRESSURE_STEP = 10.0  # Pa
POSITION_STEP = 1e-5  # rad
PerMuscle = tuple[float, ...]
"""One number for each muscle of the joint."""


@dataclass(frozen=True, slots=True)
class OperatingPoint:
    """One joint at rest: the coefficients of its linear equations."""

    position: float  # [rad]
    stiffness: float  # stiffness of the muscles at constant pressure [N m/rad]
    pressures: PerMuscle  # of the muscles, gauge [Pa]
    inertia: float  # J [kg m^2]
    damping: float  # B [N m s/rad]
    spring: float  # K: muscles at constant pressure, and gravity [N m/rad]
    # na, nb, ... [N m/Pa].
    torque_slopes: PerMuscle
    # ca, cb, ... [Pa/rad].
    motion_pressure: PerMuscle
    # pressure change per torque at constant stiffness and position [Pa/(N m)]; of more than two
    # muscles the least one, of one muscle that of its torque
    per_torque: PerMuscle
    per_position: PerMuscle  # pressure change per angle at constant torque and stiffness [Pa/rad]

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
    pressures : sequence of float
        Gauge pressures of its muscles [Pa].
    """

    def statics(at: Sequence[float], q: float) -> list[float]:
        return [model.torque(at, q), model.stiffness(at, q)]

    def with_more(index: int, step: float) -> list[float]:
        return [each + step if k == index else each for k, each in enumerate(pressures)]

    h, e = PRESSURE_STEP, POSITION_STEP
    by_pressure = [
        _slope(statics(with_more(k, h), position), statics(with_more(k, -h), position), h)
        for k in range(len(pressures))
    ]
    by_position = _slope(statics(pressures, position + e), statics(pressures, position - e), e)
    jacobian = np.array(by_pressure).T
    per_torque = _pressure_change(jacobian, [1.0, 0.0])
    per_position = [-each for each in _pressure_change(jacobian, by_position)]
    motion = [
        model.exponent * (pressure + model.ambient_pressure) * slope / volume
        for pressure, slope, volume in zip(
            pressures, model.volume_slopes(position), model.volumes(position), strict=True
        )
    ]
    return OperatingPoint(
        position=position,
        stiffness=statics(pressures, position)[1],
        pressures=tuple(pressures),
        inertia=joint.inertia,
        damping=joint.viscous_friction,
        spring=-by_position[0] + gravity_stiffness(joint, position),
        torque_slopes=tuple(torque for torque, _ in by_pressure),
        motion_pressure=tuple(motion),
        per_torque=tuple(per_torque),
        per_position=tuple(per_position),
    )


def _pressure_change(jacobian: npt.NDArray[np.float64], wanted: Sequence[float]) -> list[float]:
    """Changes [Pa] of the pressures for a change of torque and stiffness [N m], [N m/rad]."""
    match jacobian.shape[1]:
        case 1:  # it reaches a torque only
            return [float(wanted[0] / jacobian[0, 0])]
        case 2:
            return [float(each) for each in np.linalg.solve(jacobian, wanted)]
    return [float(each) for each in np.linalg.lstsq(jacobian, wanted, rcond=None)[0]]


def _slope(high: Sequence[float], low: Sequence[float], step: float) -> list[float]:
    return [(x - y) / (2.0 * step) for x, y in zip(high, low, strict=True)]
