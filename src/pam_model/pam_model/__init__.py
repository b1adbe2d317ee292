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

from typing import TYPE_CHECKING

from pam_ros.lazy_names import lazy_names

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

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "effects": "EFFECTS",
        "errors": "PamError RigError",
        "identify.compare": "compare",
        "identify.fit": "fit",
        "identify.measurements": "load_measurements",
        "joints.joint_statics": "JointStatics",
        "muscles.force_model": "MuscleGeometry create_force_model registered_models",
        "plant.parameters": "PlantParameters",
        "plant.simulate": "Plant initial_state simulate simulate_measured",
        "rig": "Rig load_rig save_rig",
    },
)
