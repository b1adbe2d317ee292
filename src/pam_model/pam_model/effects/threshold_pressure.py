"""The pressure that the bladder takes before the muscle pulls.

A bladder must be widened until it lies against the braid and carries it along. The pressure that
this takes does not pull. Chou and Hannaford found that a pressure P_th is needed to overcome the
radial elasticity of the bladder, and that the stiffness of their muscles grows with P - P_th, not
with P. Muscles with threads in a thick rubber wall take most: 1.25 bar with a maker's 10 mm muscle
that is held at 0 to 12 % of contraction. Below P_th the muscle is slack.
"""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Portrait, Range, Search
from pam_model.effects.slots import Adjusts

HIGHEST = 3e5
"""No muscle that is sold is without pull up to 3 bar, half of the usual highest pressure [Pa]."""
LEAST_SOUGHT = 2e3
"""The zero error of a good pressure sensor; a smaller threshold cannot be told from it [Pa]."""


def threshold(before: float, pressure: float) -> float:
    """Pressure that does not pull [Pa]."""
    return before + pressure


EFFECT = Effect(
    name="threshold_pressure",
    order=145,
    stage="muscle",
    scope="muscle",
    description="the bladder takes a pressure to widen, which does not pull",
    law="force at p - P_th, never below 0",
    source="Chou and Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996",
    parameters={"pressure": EffectParameter("P_th", "Pa", 0.0, 0.0, HIGHEST, "without pull")},
    slots=(Adjusts("threshold_pressure", threshold),),
    control=Included("included in the muscle force and inverted exactly"),
    plausibility=Included("included in the muscle force of the torque balance"),
    search=Search(
        # Both muscles of a joint have bladders of one kind, hence one size.
        ranges=lambda rig: {
            "pressure": Range(
                LEAST_SOUGHT,
                min(HIGHEST, 2.0 * rig.pressure),
                0.7,
                (0.1 * rig.pressure, 0.4 * rig.pressure),
                logarithmic=True,
            )
        },
        shown_by=("position", "pulls"),
    ),
    portrait=Portrait(
        sizes={"pressure": 4e4},
        signature="The muscle pulls as if its pressure were lower by the same amount at every "
        "length. Held short, it is slack up to a pressure well above zero.",
        easily_taken_for="pressure_bias, which is seen in an empty muscle as well; "
        "bladder_elasticity.",
        told_apart_by="Hold several lengths and raise the pressure slowly from zero, with a load "
        "cell.",
    ),
)
