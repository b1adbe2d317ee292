"""The time stamps of the positions are later than the measurements."""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import Delay, EffectParameter, Nothing, Portrait, Range, Search
from pam_model.effects.slots import Adjusts


def longer_delay(delay_before: float, delay: float) -> float:
    """Age of a reading at its time stamp [s]."""
    return delay_before + delay


EFFECT = Effect(
    name="position_delay",
    order=230,
    stage="sensing",
    scope="joint",
    description="the time stamps of the encoder's readings are late",
    law="q_measured(t) = q(t - t_q)",
    source="sensor model",
    parameters={
        "delay": EffectParameter("t_q", "s", 0.0, 0.0, 0.2, "age of the reading at its time stamp")
    },
    slots=(Adjusts("position_sensor.delay", longer_delay),),
    control=Delay(
        "compares the measurement with the reference of that earlier time, and includes the "
        "delay in the gain design"
    ),
    plausibility=Nothing(
        "nothing, because the torque balance is low-pass filtered over 0.15 s, which is long "
        "compared with the delay"
    ),
    search=Search(
        ranges=lambda rig: {"delay": Range(0.0, 0.15, 0.01, (0.01, 0.03))},
        shown_by=("position",),
        is_sharp=True,
    ),
    portrait=Portrait(
        sizes={"delay": 0.02},
        signature="Only the angle is late: the pressures agree with the model, but the measured "
        "motion follows them too late.",
        easily_taken_for="viscous_friction, command_delay.",
        told_apart_by="Move the joint with a chirp.",
    ),
)
