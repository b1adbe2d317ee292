"""The size of a joint, from which values follow that the settings leave open.

A finger of 0.1 N m and a knee of 200 N m need other limits than an elbow. The shares of torque and
stiffness stand where the parameters are declared (`settings` and the laws). They are those that
the elbow of config/ was tuned with, so that a joint of any size is driven as that elbow is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from pam_control.declared import sized
from pam_control.settings import ControlSettings
from pam_model.joints.joint_statics import JointStatics
from pam_model.robot import RobotJoint

GRID_SHARES: Final = (0.18, 0.37, 0.61)
_ALL: Final = 1e9  # N m/rad, more than any joint has


@dataclass(frozen=True, slots=True)
class JointScale:
    """How strong and how stiff a joint can be in the middle of its range."""

    torque: float  # largest torque, the mean of both directions [N m]
    stiffness: float  # largest stiffness without torque [N m/rad]
    joint: RobotJoint  # the joint itself

    @classmethod
    def of(cls, joint: RobotJoint, model: JointStatics) -> JointScale:
        """The size of a joint.

        Parameters
        ----------
        joint : RobotJoint
            Its range and inertia.
        model : JointStatics
            Its muscles, with the pressures that the controller may ask for.
        """
        middle = 0.5 * sum(joint.position_limits)
        pressures = [muscle.high_pressure for muscle in model.muscles]
        least, most = model.torque_range(pressures, middle)
        return cls(0.5 * (most - least), model.pressures_for(0.0, _ALL, middle).stiffness, joint)

    def complete(self, settings: ControlSettings) -> ControlSettings:
        """The settings with the values that follow from the size of this joint.

        Parameters
        ----------
        settings : ControlSettings
            As a user gave them.
        """
        complete = sized(settings, self)
        if complete.stiffness_grid:
            return complete
        return complete.replace(stiffness_grid=tuple(s * self.stiffness for s in GRID_SHARES))
