"""Transport delay between a command and the valve."""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import Delay, EffectParameter, Portrait, Range, Search
from pam_model.effects.slots import Adjusts


def longer_delay(delay_before: float, delay: float) -> float:
    """Transport delay of the command [s]."""
    return delay_before + delay


EFFECT = Effect(
    name="command_delay",
    order=70,
    stage="valve",
    scope="muscle",
    description="pure transport delay between the command and the valve",
    law="u(t) = u_commanded(t - t_d)",
    source="transport delay",
    parameters={"delay": EffectParameter("t_d", "s", 0.0, 0.0, 0.2, "dead time")},
    slots=(Adjusts("valve.command_delay", longer_delay),),
    control=Delay(
        "looks ahead for each valve by its own delay, and includes the delay in the gain design"
    ),
    plausibility=Delay("the pressure observer uses the command that was sent one delay earlier"),
    search=Search(
        ranges=lambda rig: {"delay": Range(0.0, 0.15, 0.01, (0.01, 0.03))},
        shown_by=("commands",),
        is_sharp=True,
    ),
    portrait=Portrait(
        sizes={"delay": 0.02},
        signature="Everything happens later by the same amount of time.",
        easily_taken_for="position_delay, where only the angle is late.",
        told_apart_by="Apply steps and measure the time to the first reaction.",
    ),
)
