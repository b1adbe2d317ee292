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

from typing import TYPE_CHECKING, Any

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


def __getattr__(name: str) -> Any:
    """Import a public name."""
    match name:
        case "__version__":
            from pam_ros.version import installed_version

            return installed_version(__name__)
        case "ControlOutput" | "Measurement":
            from pam_control import control_step

            return getattr(control_step, name)
        case "Controller":
            from pam_control import controller

            return getattr(controller, name)
        case "Law":
            from pam_control.laws import law

            return getattr(law, name)
        case "PressureRatioPid":
            from pam_control.laws import pressure_ratio_pid

            return getattr(pressure_ratio_pid, name)
        case "ControlSettings":
            from pam_control import settings

            return getattr(settings, name)
        case "TrajectoryPoint":
            from pam_control.references import trajectory

            return getattr(trajectory, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """All names, including public names that were not imported yet."""
    return sorted({*globals(), *__all__})
