"""The equilibria at which a joint's loop is designed and checked.

The derivatives of torque and stiffness are finite differences of the force model, so that any force
model can be used. Torque r (F_a - F_b) and stiffness r^2 (K_a + K_b) follow the rig's nominal
physics.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pam_control.feedback.linear_joint import OperatingPoint
from pam_model.errors import PamError
from pam_model.joints.antagonistic_joint import AntagonisticJoint
from pam_model.robot import RobotJoint
from pam_model.views.inverse_dynamics import InverseDynamics

POSITION_SHARES = (0.05, 0.5, 0.95)
PRESSURE_STEP = 10.0  # Pa
POSITION_STEP = 1e-5  # rad


def operating_point(
    joint: RobotJoint, model: AntagonisticJoint, position: float, pressures: tuple[float, float]
) -> OperatingPoint:
    """Linearise one joint at rest.

    Parameters
    ----------
    joint : RobotJoint
        Inertia, friction and gravity.
    model : AntagonisticJoint
        Its muscles.
    position : float
        [rad].
    pressures : (float, float)
        Gauge pressures of agonist and antagonist [Pa].
    """

    def statics(a: float, b: float, q: float) -> list[float]:
        return [model.torque(a, b, q), model.stiffness(a, b, q)]

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
        pressures=pressures,
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


def operating_grid(
    joint: RobotJoint, model: AntagonisticJoint, stiffnesses: Sequence[float]
) -> list[tuple[float, OperatingPoint]]:
    """Equilibria over the joint's range and these stiffnesses.

    Parameters
    ----------
    joint : RobotJoint
        Range and gravity.
    model : AntagonisticJoint
        Inverse model of the joint.
    stiffnesses : sequence of float
        Desired values [N m/rad]. Where gravity or the pressures do not allow one, the nearest
        possible stiffness is used.

    Returns
    -------
    list of (float, OperatingPoint)
        The desired stiffness [N m/rad] and the equilibrium.

    Raises
    ------
    PamError
        When the muscles cannot hold the joint at any point of the grid.
    """
    dynamics = InverseDynamics.from_joint(joint)
    lower, upper = joint.position_limits
    points: list[tuple[float, OperatingPoint]] = []
    for share in POSITION_SHARES:
        position = lower + share * (upper - lower)
        torque = dynamics.gravity(position)
        for stiffness in stiffnesses:
            reached = model.pressures_for(torque, stiffness, position)
            if reached.torque_limited:
                continue
            a, b = reached.agonist + PRESSURE_STEP, reached.antagonist + PRESSURE_STEP
            points.append((stiffness, operating_point(joint, model, position, (a, b))))
    if not points:
        raise PamError(f"{joint.name}: its muscles cannot hold it at any position of its range")
    return points
