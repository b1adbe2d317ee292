"""The closed position of a flow valve's spool is not at zero."""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Inverse, Portrait, Range, Search
from pam_model.effects.slots import Opening


def opening_beside_null(opening: float, offset: float) -> float:
    """Position [-] measured from the valve's true middle, limited to its travel."""
    return min(max(opening + offset, -1.0), 1.0)


def spool_beside_null(opening: float, offset: float) -> float:
    """Spool command [-] for a position [-] measured from the true middle."""
    return opening - offset


EFFECT = Effect(
    name="valve_null_offset",
    order=20,
    stage="valve",
    scope="muscle",
    description="the valve is closed at a command other than zero",
    law="x_open = x + x_n, limited to [-1, 1]",
    source="spool valve",
    parameters={"offset": EffectParameter("x_n", "-", 0.0, -0.3, 0.3, "opening at zero command")},
    slots=(Opening(opening_beside_null, place=1),),
    control=Inverse(
        "subtracts the offset from the spool command",
        spool_beside_null,
    ),
    plausibility=Included("the pressure observer uses the same offset"),
    search=Search(
        ranges=lambda rig: {"offset": Range(-0.25, 0.25, 0.03, (0.02, -0.02))},
        shown_by=("commands",),
        is_one_sided=True,
        is_sharp=True,
    ),
    portrait=Portrait(
        sizes={"offset": 0.03},
        signature="One valve needs a constant command to hold the pressure; at zero command its "
        "pressure drifts and the other one does not.",
        easily_taken_for="leakage of the same muscle, which grows with pressure, while an offset "
        "does not.",
        told_apart_by="Hold two pressures.",
    ),
)
