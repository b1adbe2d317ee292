"""The braid's threads stretch with their tension: b grows, in the force and in the volume.

By virtual work on the nominal braid: thread tension P b L/(2 pi n^2 N_t) over N_t threads of
stiffness EA, so that c_b = b_0/(2 pi n^2 N_t EA).
"""

from __future__ import annotations

from typing import Final

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Portrait, Range, Search
from pam_model.effects.slots import Thread

LEAST_SHRINK: Final = 0.5
"""A stretch of half the thread is far outside any braid; the cut keeps a fit finite."""


def stretched_thread(
    pressure: float, length: float, thread_length: float, compliance: float
) -> tuple[float, float, float]:
    """Thread length b under tension [m], db/dp [m/Pa] and db/dL [-]."""
    shrink = max(1.0 - compliance * max(pressure, 0.0) * length, LEAST_SHRINK)
    stretched = thread_length / shrink
    gain = stretched * compliance / shrink
    return stretched, gain * length, gain * pressure


EFFECT = Effect(
    name="braid_extensibility",
    order=150,
    stage="muscle",
    scope="muscle",
    description="threads stretch with their tension: b grows, in the force and in the volume",
    law="b = b_0/(1 - c_b P L), P gauge",
    source="virtual work on the nominal braid, thread tension P b L/(2 pi n^2 N_t) over N_t "
    "threads of stiffness EA: c_b = b_0/(2 pi n^2 N_t EA)",
    parameters={
        "compliance": EffectParameter(
            "c_b", "1/(Pa m)", 0.0, 0.0, 1e-6, "thread strain per pressure and length"
        )
    },
    slots=(Thread(stretched_thread),),
    control=Included(
        "included in the muscle force and inverted by iteration; the gas volume remains that of "
        "the stiff braid"
    ),
    plausibility=Included("in the muscle's force of the torque balance"),
    search=Search(
        ranges=lambda rig: {
            "compliance": Range(0.0, 0.2 / rig.reach, 0.01 / rig.reach, (0.01 / rig.reach,))
        },
        shown_by=("position", "pulls"),
    ),
    portrait=Portrait(
        sizes={"compliance": 1e-7},
        signature="High pressure makes the threads longer: the muscle pulls less and holds more "
        "gas than it should, the more the higher the pressure.",
        easily_taken_for="end_caps, pressure_gain on both sensors.",
        told_apart_by="Holds at several pressures; a load cell.",
    ),
)
