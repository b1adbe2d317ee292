"""The spool of a valve follows its command more slowly than the rig file states."""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Lead, Portrait, Range, Search
from pam_model.effects.slots import Adjusts


def slower_spool(time_constant: float, extra_time_constant: float) -> float:
    """Time constant of the spool [s]."""
    return time_constant + extra_time_constant


EFFECT = Effect(
    name="valve_lag",
    order=30,
    stage="valve",
    scope="muscle",
    description="the spool is slower than the rig file states",
    law="dx/dt = (u - x)/(time_constant + tau_x)",
    source="first-order spool",
    parameters={
        "extra_time_constant": EffectParameter(
            "tau_x", "s", 0.0, 0.0, 0.2, "added to valve.time_constant"
        )
    },
    slots=(Adjusts("valve.time_constant", slower_spool),),
    control=Lead(
        "uses the true time constant in the lead term, in the look-ahead and in the gain design"
    ),
    plausibility=Included("the pressure observer uses the true time constant of the spool"),
    search=Search(
        ranges=lambda rig: {"extra_time_constant": Range(0.0, 0.15, 0.01, (0.01, 0.03))},
        shown_by=("commands",),
    ),
    portrait=Portrait(
        sizes={"extra_time_constant": 0.02},
        signature="The pressure follows the commands late and smoothed, most visibly in fast "
        "changes.",
        easily_taken_for="command_delay (late but not smoothed), tube_restriction, pressure_lag.",
        told_apart_by="Apply a chirp as command.",
    ),
)
