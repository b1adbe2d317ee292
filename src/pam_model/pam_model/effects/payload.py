"""A point mass at a distance from the joint's axis."""

from __future__ import annotations

from typing import Final

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Portrait, Range, Search
from pam_model.effects.slots import Adjusts

GRAVITY: Final = 9.80665
"""Standard gravity [m/s^2]."""


def inertia_with_payload(inertia: float, mass: float, distance: float) -> float:
    """Inertia about the joint's axis [kg m^2]."""
    return inertia + mass * distance * distance


def gravity_with_payload(gravity_torque: float, mass: float, distance: float) -> float:
    """Amplitude of the gravity torque [N m]."""
    return gravity_torque + mass * GRAVITY * distance


EFFECT = Effect(
    name="payload",
    order=200,
    stage="joint",
    scope="joint",
    description="a point mass at a distance from the axis",
    law="gravity_torque + m g l; inertia + m l^2; g = 9.80665 m/s^2",
    source="rigid body",
    parameters={
        "mass": EffectParameter("m", "kg", 0.0, 0.0, 100.0, "mass of the load"),
        "distance": EffectParameter("l", "m", 0.3, 0.0, 2.0, "distance from the joint axis", True),
    },
    slots=(
        Adjusts("joint.inertia", inertia_with_payload),
        Adjusts("joint.gravity_torque", gravity_with_payload),
    ),
    control=Included("included in the inverse dynamics and in the gain design"),
    plausibility=Included("the torque balance uses the true inertia and gravity torque"),
    search=Search(
        ranges=lambda rig: {
            "mass": Range(1e-3, 30.0, 0.5, (0.3,), True),
            "distance": Range(0.02, 1.5, 0.5, (0.3,), True),
        },
        shown_by=("position",),
        is_sharp=True,
    ),
    portrait=Portrait(
        sizes={"mass": 0.8, "distance": 0.25},
        signature="The same angle away from the vertical needs more pressure, and the joint swings "
        "more slowly.",
        easily_taken_for="pulley_radius, bladder_elasticity.",
        told_apart_by="Mount the joint upside down, or let it swing with vented muscles.",
    ),
)
