"""Pneumatic artificial muscles: force models, joints, the rig file, effects, the simulated plant.

The public names, without ROS:

- `load_rig`, `save_rig`, `Rig`: read, check and write a rig file, the description of a robot.
- `create_force_model`, `registered_models`, `MuscleGeometry`: force from length and pressure.
- `JointStatics`: a joint's torque and stiffness from the pressures of its muscles, and the inverse.
- `EFFECTS`: the effects by which a real rig differs from the ideal one, by name.
- `PlantParameters`, `initial_state`, `simulate`, `simulate_measured`, `Plant`: the simulated joint.
- `load_measurements`, `fit`, `compare`: identify and rank force models with measured points.
- `PamError`, `RigError`: a user's mistake, reported in one line.

A name is imported when it is first used, so that importing the package is fast.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pam_model.effects import EFFECTS
    from pam_model.errors import PamError, RigError
    from pam_model.identify.compare import compare
    from pam_model.identify.fit import fit
    from pam_model.identify.measurements import load_measurements
    from pam_model.joints.joint_statics import JointStatics
    from pam_model.muscles.force_model import MuscleGeometry, create_force_model, registered_models
    from pam_model.plant.parameters import PlantParameters
    from pam_model.plant.simulate import Plant, initial_state, simulate, simulate_measured
    from pam_model.rig import Rig, load_rig, save_rig

__all__ = [
    "EFFECTS",
    "JointStatics",
    "MuscleGeometry",
    "PamError",
    "Plant",
    "PlantParameters",
    "Rig",
    "RigError",
    "compare",
    "create_force_model",
    "fit",
    "initial_state",
    "load_measurements",
    "load_rig",
    "registered_models",
    "save_rig",
    "simulate",
    "simulate_measured",
]


def __getattr__(name: str) -> Any:
    """Import a public name at its first use."""
    match name:
        case "__version__":
            from pam_ros.version import installed_version

            return installed_version(__name__)
        case "EFFECTS":
            from pam_model import effects

            return getattr(effects, name)
        case "PamError" | "RigError":
            from pam_model import errors

            return getattr(errors, name)
        case "compare":
            from pam_model.identify import compare

            return getattr(compare, name)
        case "fit":
            from pam_model.identify import fit

            return getattr(fit, name)
        case "load_measurements":
            from pam_model.identify import measurements

            return getattr(measurements, name)
        case "JointStatics":
            from pam_model.joints import joint_statics

            return getattr(joint_statics, name)
        case "MuscleGeometry" | "create_force_model" | "registered_models":
            from pam_model.muscles import force_model

            return getattr(force_model, name)
        case "PlantParameters":
            from pam_model.plant import parameters

            return getattr(parameters, name)
        case "Plant" | "initial_state" | "simulate" | "simulate_measured":
            from pam_model.plant import simulate

            return getattr(simulate, name)
        case "Rig" | "load_rig" | "save_rig":
            from pam_model import rig

            return getattr(rig, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """All names, including those that were not used yet."""
    return sorted({*globals(), *__all__})
