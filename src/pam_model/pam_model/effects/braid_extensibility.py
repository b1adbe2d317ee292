"""The threads of the braid stretch with their tension: force and volume depend on a longer b.

Virtual work on the nominal braid gives the tension P b L/(2 pi n^2 N_t) of each of the N_t threads.
With the stiffness EA of a thread, c_b = b_0/(2 pi n^2 N_t EA).
"""

from __future__ import annotations

from typing import Final

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Portrait, Range, Search
from pam_model.effects.slots import Thread

LEAST_SHRINK: Final = 0.5
"""No braid stretches as far as this limit; it keeps a diverging fit finite."""


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
    description="the threads of the braid stretch with their tension; force and gas volume follow "
    "from the longer thread",
    law="b = b_0/(1 - c_b P L), P gauge",
    source="virtual work on the nominal braid with N_t threads of stiffness EA and tension "
    "P b L/(2 pi n^2 N_t): c_b = b_0/(2 pi n^2 N_t EA)",
    parameters={
        "compliance": EffectParameter(
            "c_b", "1/(Pa m)", 0.0, 0.0, 1e-4, "thread strain per pressure and length"
        )
    },
    slots=(Thread(stretched_thread),),
    control=Included(
        "included in the muscle force and inverted by iteration; included in the gas volume, which "
        "grows with the pressure"
    ),
    plausibility=Included("included in the muscle force of the torque balance"),
    search=Search(
        ranges=lambda rig: {
            "compliance": Range(0.0, 0.2 / rig.reach, 0.01 / rig.reach, (0.01 / rig.reach,))
        },
        shown_by=("position", "pulls"),
    ),
    portrait=Portrait(
        sizes={"compliance": 1e-7},
        signature="Pressure makes the threads longer: the muscle pulls less and holds more gas "
        "than the nominal braid, and the difference grows with the pressure.",
        easily_taken_for="end_caps; pressure_gain on both sensors.",
        told_apart_by="Hold several pressures and measure the force with a load cell.",
    ),
)
