"""The gas volume outside the braid is larger than the rig file states."""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Portrait, Range, Search
from pam_model.effects.slots import Adjusts


def larger_dead_volume(dead_volume: float, extra_volume: float) -> float:
    """Gas volume outside the braid [m^3], at least 0."""
    return max(0.0, dead_volume + extra_volume)


EFFECT = Effect(
    name="dead_volume",
    order=90,
    stage="valve",
    scope="muscle",
    description="the gas volume outside the braid is larger than the rig file states",
    law="V = V_braid + dead_volume + V_x",
    source="geometry",
    parameters={
        "extra_volume": EffectParameter("V_x", "m^3", 0.0, -1e-3, 0.015, "added to dead_volume")
    },
    slots=(Adjusts("dead_volume", larger_dead_volume),),
    control=Included("uses the true gas volume in the flow and in the gain design"),
    plausibility=Included("the pressure observer uses the true gas volume"),
    search=Search(
        ranges=lambda rig: {
            "extra_volume": Range(
                -0.2 * rig.volume, 5 * rig.volume, 0.2 * rig.volume, (0.2 * rig.volume,)
            )
        },
        shown_by=("commands",),
        shows_when_shut=True,
        is_sharp=True,
    ),
    portrait=Portrait(
        sizes={"extra_volume": 4e-5},
        signature="The same air mass changes the pressure less; with shut valves the joint is "
        "softer.",
        easily_taken_for="thermal; a smaller sonic_conductance than the rig file states.",
        told_apart_by="Move the joint with shut valves.",
    ),
)
