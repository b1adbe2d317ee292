"""Overlap of a flow valve's spool: no flow while the spool is inside it.

Inverse: G. Tao, P. V. Kokotovic, Adaptive Control of Systems with Actuator and Sensor
Nonlinearities, Wiley 1996. For openings below ROUNDED a straight line replaces the inverse's jump
across the overlap. Otherwise the noise of a pressure sensor would move the spool across the whole
overlap all the time, which wears the valve.
"""

from __future__ import annotations

import math
from typing import Final

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Inverse, Portrait, Range, Search
from pam_model.effects.slots import Opening

ROUNDED: Final = 0.01  # of full opening


def opening_behind_overlap(opening: float, overlap: float) -> float:
    """Opening [-] of a valve with overlap at a spool position [-] measured from its middle."""
    return math.copysign(max(abs(opening) - overlap, 0.0) / (1.0 - overlap), opening)


def spool_for_opening(opening: float, overlap: float) -> float:
    """Spool position [-] for an opening [-]; the jump at 0 is smoothed."""
    if not overlap > 0.0:
        return opening
    size = abs(opening)
    jump = overlap * min(size / ROUNDED, 1.0)
    return math.copysign(jump + (1.0 - overlap) * size, opening)


EFFECT = Effect(
    name="valve_dead_zone",
    order=10,
    stage="valve",
    scope="muscle",
    description="spool overlap: no flow while the spool is within it; the valve still opens "
    "fully at 1",
    law="x_open = sign(x) max(0, (|x| - x_o)/(1 - x_o))",
    source="spool valve with overlap",
    parameters={
        "overlap": EffectParameter("x_o", "-", 0.0, 0.0, 0.5, "spool travel without flow, each way")
    },
    slots=(Opening(opening_behind_overlap, place=2),),
    control=Inverse(
        "inverts the overlap after the flow inversion; the jump is smoothed for openings below "
        "1 %, where a part of the dead zone remains",
        spool_for_opening,
    ),
    plausibility=Included("the pressure observer uses the same overlap"),
    search=Search(
        ranges=lambda rig: {"overlap": Range(0.0, 0.4, 0.05, (0.05, 0.02, 0.12))},
        shown_by=("commands",),
    ),
    portrait=Portrait(
        sizes={"overlap": 0.05},
        signature="Small commands cause no flow: the pressure oscillates around every set point "
        "(limit cycle), and the command jumps across zero at every reversal of the pressure.",
        easily_taken_for="leakage and valve_null_offset at rest; command_delay in fast motion.",
        told_apart_by="Apply small steps around the closed position of the valve.",
    ),
)
