"""The exhaust path of a valve lets less air through than its supply path."""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import (
    EffectParameter,
    Included,
    Inverse,
    Portrait,
    Range,
    RigScales,
    Search,
)
from pam_model.effects.slots import Adjusts


def exhaust_ratio(ratio_before: float, ratio: float) -> float:
    """Exhaust conductance over supply conductance [-]."""
    return ratio_before * ratio


def wider_exhaust(opening: float, ratio: float) -> float:
    """Opening [-] that gives the flow of `opening` on a valve with two equal paths."""
    return opening / ratio if opening < 0.0 else opening


def search_ranges(rig: RigScales) -> dict[str, Range]:
    """Range of the search. A good pressure regulator vents more slowly than it fills.

    The flow through an opening is proportional to the absolute pressure before it (ISO 6358), so
    that an inner loop with one gain is about half as fast in venting as in filling.
    """
    start, ordinary = (0.4, 0.5) if rig.is_regulated else (0.75, 0.0)
    return {"ratio": Range(0.1, 1.0, 0.2, (start,), ordinary=ordinary)}


EFFECT = Effect(
    name="exhaust_restriction",
    order=40,
    stage="valve",
    scope="muscle",
    description="the exhaust path lets less air through than the supply path",
    law="C = C_e/C_s sonic_conductance for x < 0",
    source="ISO 6358-1, flow-rate characteristics of pneumatic components",
    parameters={
        "ratio": EffectParameter("C_e/C_s", "-", 1.0, 0.05, 2.0, "exhaust over supply conductance")
    },
    slots=(Adjusts("valve.exhaust_ratio", exhaust_ratio),),
    control=Inverse(
        "divides the exhaust opening by the ratio, up to full opening, and plays trajectories that "
        "need larger flows more slowly",
        wider_exhaust,
    ),
    plausibility=Included("the pressure observer uses the true conductance of the exhaust path"),
    search=Search(
        ranges=search_ranges,
        shown_by=("commands",),
        # A silencer in series has its own conductance, and hardly limits a small opening; a
        # narrow path in the valve is a constant ratio.
    ),
    portrait=Portrait(
        sizes={"ratio": 0.6},
        signature="Venting is slower than filling: each cycle of symmetric commands raises the "
        "pressure.",
        easily_taken_for="valve_null_offset on both valves.",
        told_apart_by="Apply steps of equal size up and down.",
    ),
)
