"""The plant's parameters that a rig file states, and how far the true ones may be from them."""

from __future__ import annotations

from collections.abc import Sequence

from pam_model.plant.joint_muscles import SIDES
from pam_model.rig import Joint, Rig

JOINT = ("inertia", "viscous_friction", "gravity_torque", "gravity_angle")
VALVE = ("sonic_conductance", "critical_ratio", "time_constant")
LENGTHS = ("thread_length", "turns", "neutral_length", "wall_thickness")
"""Numbers of a muscle that `length_tolerance` of the rig file concerns."""


def written_numbers(
    rig: Rig, joint: Joint, sides: Sequence[str] = SIDES
) -> tuple[tuple[str, float], ...]:
    """The parameters of a joint with a tolerance: each name, and its tolerance over its value [-].

    A number that is 0 in the rig file has none. On a bench (one side), nothing of the invented
    joint has one, nor the neutral length, from which the measured length is counted.
    """
    tolerance, on_bench = rig.parameter_tolerance, len(sides) == 1
    of_lengths = tolerance if rig.length_tolerance is None else rig.length_tolerance
    of_joint = (("pulley_radius", of_lengths), *((key, tolerance) for key in JOINT))
    of_muscle = (*((key, of_lengths) for key in LENGTHS), ("dead_volume", tolerance))
    found = [("supply_pressure", tolerance)]
    for key, reach in () if on_bench else of_joint:
        if getattr(joint, key) != 0.0:
            found.append((f"joint.{key}", reach))
    for side, name in zip(sides, joint.muscles, strict=False):
        muscle = rig.muscle(name)
        for key, reach in of_muscle:
            if getattr(muscle, key) != 0.0 and not (on_bench and key == "neutral_length"):
                found.append((f"{side}.{key}", reach))
        found += [(f"{side}.valve.{key}", tolerance) for key in VALVE]
    return tuple(found)
