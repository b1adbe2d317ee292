"""The equilibria at which a joint's loop is designed and checked."""

from __future__ import annotations

from collections.abc import Sequence

from pam_model.errors import PamError
from pam_model.joints.joint_statics import JointStatics
from pam_model.robot import RobotJoint
from pam_model.views.inverse_dynamics import InverseDynamics
from pam_model.views.linearised_joint import PRESSURE_STEP, OperatingPoint, operating_point

POSITION_SHARES = (0.05, 0.5, 0.95)


def operating_grid(
    joint: RobotJoint, model: JointStatics, stiffnesses: Sequence[float]
) -> list[tuple[float, OperatingPoint]]:
    """Equilibria over the joint's range and these stiffnesses.

    Parameters
    ----------
    joint : RobotJoint
        Range and gravity.
    model : JointStatics
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
            pressures = [pressure + PRESSURE_STEP for pressure in reached.pressures]
            points.append((stiffness, operating_point(joint, model, position, pressures)))
    if not points:
        raise PamError(f"{joint.name}: its muscles cannot hold it at any position of its range")
    return points
