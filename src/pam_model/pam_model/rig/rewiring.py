"""What has to be written otherwise in a rig file for hoses or an encoder as they are, in words."""

from __future__ import annotations

from dataclasses import replace

from pam_model.effects import EFFECTS
from pam_model.rig.types import Joint, Rig


def crossed_hoses(rig: Rig, joint: Joint) -> str:
    """Which keys of the two muscles change places, as a clause."""
    first, second = (rig.muscle(name) for name in joint.muscles)
    found = {name for name in (*first.effects, *second.effects) if EFFECTS[name].is_of_the_valve}
    keys = ["board", "channel", "pressure_sensor", "valve"]
    *others, last = [*keys, *(f"effects.{name}" for name in EFFECTS if name in found)]
    return f"exchange {', '.join(others)} and {last} of {first.name} and {second.name}"


def turned_encoder(rig: Rig, joint: Joint) -> str:
    """Which keys of a joint are written otherwise, with their values, as a clause."""
    turned = joint.counted_the_other_way()
    parameters = replace(rig, joints=(turned,)).to_parameters()[joint.name]
    keys = ["muscles", "position_limits"]
    if turned.gravity_angle != 0.0:
        keys.append("gravity_angle")
    if turned.effects != joint.effects:
        keys.append("effects")
    texts = [f"{key}: {parameters[key]}".replace("'", "") for key in keys]
    return f"write {', '.join(texts)} for {joint.name}"
