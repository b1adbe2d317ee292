"""Positions are stamped later than they were measured."""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import Delay, EffectParameter, Nothing, Portrait, Range, Search
from pam_model.effects.slots import Adjusts


def longer_delay(delay_before: float, delay: float) -> float:
    """Age of a reading at its stamp [s]."""
    return delay_before + delay


EFFECT = Effect(
    name="position_delay",
    order=230,
    stage="sensing",
    scope="joint",
    description="the readings of the encoder are stamped late",
    law="q_measured(t) = q(t - t_q)",
    source="sensor",
    parameters={
        "delay": EffectParameter("t_q", "s", 0.0, 0.0, 0.2, "age of the reading at its stamp")
    },
    slots=(Adjusts("position_sensor.delay", longer_delay),),
    control=Delay(
        "compares the measurement with the reference of that earlier time, and includes the "
        "delay in the gain design"
    ),
    plausibility=Nothing(
        "the torque balance is low-passed over 0.15 s, against which the delay is short"
    ),
    search=Search(
        ranges=lambda rig: {"delay": Range(0.0, 0.15, 0.01, (0.01, 0.03))},
        shown_by=("position",),
        is_sharp=True,
    ),
    portrait=Portrait(
        sizes={"delay": 0.02},
        signature="Only the angle is late: pressures fit, acceleration leads.",
        easily_taken_for="viscous_friction, command_delay.",
        told_apart_by="A chirp of the joint.",
    ),
)
