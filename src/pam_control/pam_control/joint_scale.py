"""Levels and limits of a joint that follow from its size where the settings leave them open.

A finger of 0.1 N m and a knee of 200 N m need other limits than an elbow. The shares are those that
the elbow of config/ was tuned with, so that a joint of any size is driven as that elbow is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

from pam_control.settings import BY_SIZE, ControlSettings
from pam_model.joints.antagonistic_joint import AntagonisticJoint
from pam_model.robot import RobotJoint

STIFFNESS_SHARES: Final = {"default_stiffness": 0.43, "stiffness_rate": 0.61}  # -, 1/s
GRID_SHARES: Final = (0.18, 0.37, 0.61)
TORQUE_SHARES: Final = {
    "integral_limit": 0.33,
    "observer_limit": 0.16,
    "adaptation_limit": 0.16,
    "float_hold_torque": 0.01,
}
DAMPING_RATIO: Final = 0.3  # -, of the law impedance at the default stiffness
_ALL: Final = 1e9  # N m/rad, more than any joint has


@dataclass(slots=True)
class JointScale:
    """How strong and how stiff a joint can be in the middle of its range.

    Attributes
    ----------
    torque : float
        Largest torque, the mean of both directions [N m].
    stiffness : float
        Largest stiffness without torque [N m/rad].
    inertia : float
        [kg m^2].
    """

    torque: float
    stiffness: float
    inertia: float
    _asked: ControlSettings | None = field(default=None, init=False, repr=False)
    _complete: ControlSettings = field(default=ControlSettings(), init=False, repr=False)

    @classmethod
    def of(cls, joint: RobotJoint, model: AntagonisticJoint) -> JointScale:
        """The size of a joint.

        Parameters
        ----------
        joint : RobotJoint
            Its range and inertia.
        model : AntagonisticJoint
            Its muscles, with the pressures that the controller may ask for.
        """
        middle = 0.5 * sum(joint.position_limits)
        first, second = model.agonist.high_pressure, model.antagonist.high_pressure
        torque = model.torque(first, 0.0, middle) - model.torque(0.0, second, middle)
        return cls(0.5 * torque, model.pressures_for(0.0, _ALL, middle).stiffness, joint.inertia)

    def complete(self, settings: ControlSettings) -> ControlSettings:
        """The settings with the values of this joint where they are left to its size.

        Parameters
        ----------
        settings : ControlSettings
            As a user gave them.
        """
        if settings is not self._asked:
            sizes = [(TORQUE_SHARES, self.torque), (STIFFNESS_SHARES, self.stiffness)]
            found = {
                name: share * size
                for shares, size in sizes
                for name, share in shares.items()
                if getattr(settings, name) == BY_SIZE
            }
            grid = settings.stiffness_grid or tuple(s * self.stiffness for s in GRID_SHARES)
            if settings.impedance_damping == BY_SIZE:
                stiffness = found.get("default_stiffness", settings.default_stiffness)
                found["impedance_damping"] = (
                    2.0 * DAMPING_RATIO * math.sqrt(stiffness * self.inertia)
                )
            self._complete = settings.replace(**found, stiffness_grid=grid)
            self._asked = settings
        return self._complete
