"""The pressure of one muscle that hardly moves its joint, as a test pulse needs it.

Gravity holds a joint back: the pressure whose torque gravity balances at an angle from rest is

    p = gravity_torque sin(angle) / g,   g = r max over q of F(p, L(q)) / p

A joint without gravity is only held back by its inertia J: a torque that grows with t^2 for the
time T and falls as fast turns it by about g p T^2 / (4 J).
"""

from __future__ import annotations

from pam_model.rig.arms import Arm
from pam_model.robot.robot import Robot
from pam_model.views.gravity import largest_gravity_torque
from pam_model.views.muscle_path import lengths_over_travel

_PLACES = 9  # joint positions, to find the largest torque
_LEAST_PULL = 1e-3  # N, of a muscle that is too short to pull


def harmless_pressure(
    robot: Robot, arm: Arm, angle: float, rise: float, at_pressure: float
) -> float:
    """The pressure that turns a joint by no more than an angle [Pa gauge].

    Parameters
    ----------
    arm : Arm
        The muscle at the joint.
    angle : float
        [rad].
    rise : float
        T, time of the pulse [s].
    at_pressure : float
        Pressure at which the torque per pressure is taken [Pa gauge].

    Raises
    ------
    PamError
        If the force model does not cover the range of the joint.
    """
    joint, muscle = robot.joints[arm.joint], robot.muscles[arm.muscle]
    pulls = [
        float(muscle.force_model.force(at_pressure, length))
        for length in lengths_over_travel(robot, muscle, _PLACES)
    ]
    gain = abs(arm.length) * max(*pulls, _LEAST_PULL) / at_pressure
    held_by_gravity = largest_gravity_torque(joint, angle) / gain
    held_by_inertia = angle * 4.0 * joint.inertia / (gain * rise * rise)
    return max(held_by_gravity, held_by_inertia)
