"""A point mass at a distance from the joint's axis."""

from __future__ import annotations

from typing import Final

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import (
    EffectParameter,
    Included,
    Portrait,
    Range,
    RigScales,
    Search,
)
from pam_model.effects.slots import Adjusts

GRAVITY: Final = 9.80665
"""Standard gravity [m/s^2]."""


def inertia_with_payload(inertia: float, mass: float, distance: float, gravity: float) -> float:
    """Inertia about the joint's axis [kg m^2]."""
    return inertia + mass * distance * distance


def gravity_with_payload(
    gravity_torque: float, mass: float, distance: float, gravity: float
) -> float:
    """Amplitude of the gravity torque [N m]."""
    return gravity_torque + mass * gravity * distance


def search_ranges(rig: RigScales) -> dict[str, Range]:
    """Ranges of the search, by the pull of the muscles and the radius of the pulley.

    On a joint that the rig file gives no gravity torque, the axis may be vertical, so that the
    load has no weight about it. How much of gravity acts is then unknown, too.
    """
    radius = rig.torque / rig.force
    mass = 0.01 * rig.force / GRAVITY  # hangs at 10 radii with a tenth of the muscles' torque
    acts = rig.gravity_torque != 0.0
    starts = (GRAVITY,) if acts else (GRAVITY, 0.0)
    return {
        "mass": Range(3e-3 * mass, 60.0 * mass, 0.5, (mass, 4.0 * mass), True),
        "distance": Range(0.7 * radius, 50.0 * radius, 0.5, (10.0 * radius,), True),
        "gravity": Range(GRAVITY if acts else 0.0, GRAVITY, 3.0, starts),
    }


EFFECT = Effect(
    name="payload",
    order=200,
    stage="joint",
    scope="joint",
    description="a point mass at a distance from the axis",
    law="gravity_torque + m g l; inertia + m l^2",
    source="rigid body",
    parameters={
        "mass": EffectParameter("m", "kg", 0.0, 0.0, 100.0, "mass of the load"),
        "distance": EffectParameter("l", "m", 0.3, 0.0, 2.0, "distance from the joint axis", True),
        "gravity": EffectParameter(
            "g",
            "m/s^2",
            GRAVITY,
            0.0,
            GRAVITY,
            "the part of gravity in the plane of the motion; 0 if the axis is vertical",
            True,
        ),
    },
    slots=(
        Adjusts("joint.inertia", inertia_with_payload),
        Adjusts("joint.gravity_torque", gravity_with_payload),
    ),
    control=Included("included in the inverse dynamics and in the gain design"),
    plausibility=Included("the torque balance uses the true inertia and gravity torque"),
    search=Search(
        ranges=search_ranges,
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
