"""Creep of a viscoelastic bladder: a Maxwell element in parallel with the bladder's spring.

Pull = c K_3 (L - L_c), dL_c/dt = (L - L_c)/tau_c. K_3 is dF/dL of the nominal braid at 3 bar and
its rest length; it turns the ratio c into a stiffness. The state is the stretch L - L_c that has
not relaxed yet.

Source: standard linear solid, e.g. J. D. Ferry, Viscoelastic Properties of Polymers, Wiley 1980.
"""

from __future__ import annotations

import math
from typing import Final

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import (
    EffectParameter,
    Nothing,
    Portrait,
    Range,
    Search,
    TorqueFeedforward,
)
from pam_model.effects.slots import PullState

REFERENCE_PRESSURE: Final = 3e5  # Pa gauge, at which K_3 is taken


def creep_stiffness(braid_slope: float, ratio: float) -> float:
    """Stiffness c K_3 [N/m]; `braid_slope` is 6 rest_length/(4 pi n^2) [m]."""
    return ratio * REFERENCE_PRESSURE * braid_slope


def maxwell_rate(
    stretch: float, speed: float, step: float, ratio: float, time_constant: float
) -> float:
    """Rate of the stretch that has not relaxed [m/s] at dL/dt = `speed` [m/s]."""
    return speed - stretch / time_constant


def maxwell_step(
    stretch: float, stroke: float, duration: float, ratio: float, time_constant: float
) -> float:
    """Exact stretch [m] after a `stroke` [m] at constant speed within `duration` [s]."""
    if duration <= 0.0:
        return stretch + stroke
    decay = math.exp(-duration / time_constant)
    return stretch * decay + stroke * time_constant / duration * (1.0 - decay)


def creep_pull(
    stretch: float,
    pressure: float,
    braid_area: float,
    braid_slope: float,
    ratio: float,
    time_constant: float,
) -> tuple[float, float]:
    """Pull [N] that the stretch adds, and its dF/dp [m^2], which is 0."""
    return creep_stiffness(braid_slope, ratio) * stretch, 0.0


def creep_response(
    stretch: float,
    pressure: float,
    braid_area: float,
    braid_slope: float,
    ratio: float,
    time_constant: float,
) -> tuple[float, float, float]:
    """dF/dL [N/m] in either direction, and dF/dt [N/s] of the relaxation at constant length."""
    stiffness = creep_stiffness(braid_slope, ratio)
    return stiffness, stiffness, -stiffness * stretch / time_constant


def unsettled(length: float, rest_length: float) -> float:
    """The full stretch from the rest length [m]: none of it has relaxed."""
    return length - rest_length


EFFECT = Effect(
    name="creep",
    order=120,
    stage="muscle",
    scope="muscle",
    description="viscoelastic bladder: it resists a change of length, and the resistance relaxes "
    "within seconds to minutes",
    law="F = F_static + c K_3 (L - L_c), dL_c/dt = (L - L_c)/tau_c; K_3 is dF/dL of the braid "
    "at 3 bar and its rest length",
    source="Maxwell element in parallel with the bladder's spring (standard linear solid)",
    parameters={
        "ratio": EffectParameter("c", "-", 0.0, 0.0, 0.5, "relaxing stiffness over K_3"),
        "time_constant": EffectParameter("tau_c", "s", 10.0, 0.1, 1e3, "of the relaxation", True),
    },
    slots=(PullState("creep", creep_pull, maxwell_rate, creep_response, unsettled),),
    control=TorqueFeedforward(
        "computes a Maxwell element along the reference lengths and compensates its torque; the "
        "element starts in the relaxed state",
        maxwell_step,
    ),
    plausibility=Nothing(
        "nothing, because creep is a few per cent of the pull, which `plausibility.torque_share` "
        "tolerates"
    ),
    search=Search(
        ranges=lambda rig: {
            "ratio": Range(0.0, 0.45, 0.05, (0.08,), ordinary=0.02),
            "time_constant": Range(0.15, 300.0, 0.7, (1.5, 10.0), True),
        },
        shown_by=("position", "pulls"),
    ),
    portrait=Portrait(
        sizes={"ratio": 0.08, "time_constant": 5.0},
        signature="After each step the joint continues to drift for seconds to minutes at constant "
        "pressure.",
        easily_taken_for="leakage without a pressure sensor; bladder_elasticity in short "
        "recordings.",
        told_apart_by="Hold a position for a long time.",
    ),
)
