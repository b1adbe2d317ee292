"""Limits of motion of a rig's joints: those of the rig file, and what the valves can drive."""

from __future__ import annotations

import math
from dataclasses import replace

from pam_control.joint_models import JointModels
from pam_control.references.motion_limiter import REFERENCE_SHARE, MotionLimits
from pam_control.valve_limits import JERK_SHARE, ValveDemand
from pam_model.errors import PamError
from pam_model.robot import Robot

STIFFNESS_STEP = 0.05  # relative; the limits are computed for stiffnesses that are so far apart
LEAST_STIFFNESS = 1e-3  # N m/rad


class DrivableLimits:
    """The limits of all joints at the stiffnesses that were asked for.

    Parameters
    ----------
    robot : Robot
        What is controlled.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._known: dict[tuple[str, int], MotionLimits] = {}

    def at(self, models: JointModels, stiffness: float, *, reduced: bool = False) -> MotionLimits:
        """The limits of a joint at about this stiffness [N m/rad], perhaps at reduced speed."""
        limits = self._at(models, stiffness)
        if not reduced:
            return limits
        velocity = REFERENCE_SHARE * models.joint.reduced_velocity
        return replace(limits, velocity=min(velocity, limits.velocity))

    def knows(self, models: JointModels, stiffness: float) -> bool:
        """Whether the limits at this stiffness [N m/rad] were computed before."""
        return _key(models, stiffness) in self._known

    def _at(self, models: JointModels, stiffness: float) -> MotionLimits:
        key = _key(models, stiffness)
        if key not in self._known:
            self._known[key] = self._limits(models, math.exp(STIFFNESS_STEP * key[1]))
        return self._known[key]

    def _limits(self, models: JointModels, stiffness: float) -> MotionLimits:
        joint = models.joint
        velocity = REFERENCE_SHARE * joint.max_velocity
        try:
            demand = ValveDemand(self._robot, models, stiffness)
        except PamError:  # the muscles cannot hold the joint, so that nothing is known
            return MotionLimits(velocity, joint.max_acceleration)
        own_velocity, own_acceleration, own_jerk = demand.everywhere()
        return MotionLimits(
            velocity,
            joint.max_acceleration,
            own_velocity,
            own_acceleration,
            own_jerk,
            jerk=own_jerk / JERK_SHARE,
            valve_share=demand.share,
        )


def _key(models: JointModels, stiffness: float) -> tuple[str, int]:
    step = round(math.log(max(stiffness, LEAST_STIFFNESS)) / STIFFNESS_STEP)
    return models.name, step
