"""Position and stiffness control of joints that antagonistic pneumatic muscles drive.

The public names, without ROS:

- `Controller`: controls all joints of a rig, stepped periodically.
- `ControlSettings`: its settings.
- `Law`: what a control law is; `PressureRatioPid` is one. `Controller` takes one, by default the
  model-based law.
- `Measurement`, `ControlOutput`: input and output of a control step.
- `TrajectoryPoint`: a point of a trajectory that `references.follow` of a control law takes.

The names are imported when they are first used, so that importing the package takes no time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pam_ros.lazy_names import lazy_names

if TYPE_CHECKING:
    from pam_control.control_step import ControlOutput, Measurement
    from pam_control.controller import Controller
    from pam_control.laws.law import Law
    from pam_control.laws.pressure_ratio_pid import PressureRatioPid
    from pam_control.references.trajectory import TrajectoryPoint
    from pam_control.settings import ControlSettings

__all__ = [
    "ControlOutput",
    "ControlSettings",
    "Controller",
    "Law",
    "Measurement",
    "PressureRatioPid",
    "TrajectoryPoint",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "control_step": "ControlOutput Measurement",
        "controller": "Controller",
        "laws.law": "Law",
        "laws.pressure_ratio_pid": "PressureRatioPid",
        "references.trajectory": "TrajectoryPoint",
        "settings": "ControlSettings",
    },
)
