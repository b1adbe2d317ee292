"""Friction between the threads of the braid: rate-independent, growing with pressure.

Pull = h p b^2/(4 pi n^2) z, with the state z of pam_model.physics.dahl. The controller computes
this state along the reference in advance.

Source: P. R. Dahl, "Solid friction damping of mechanical vibrations", AIAA Journal 14(12), 1976.
"""

from __future__ import annotations

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
from pam_model.physics.dahl import dahl_rate, dahl_slope, dahl_step


def friction_area(braid_area: float, amplitude: float) -> float:
    """Saturated friction per gauge pressure [m^2]; `braid_area` is b^2/(4 pi n^2) [m^2]."""
    return amplitude * braid_area


def friction_rate(
    state: float, speed: float, step: float, amplitude: float, presliding_length: float
) -> float:
    """dz/dt [1/s] at dL/dt = `speed` [m/s], limited to what an integration step [s] can follow."""
    return dahl_rate(state, speed, presliding_length, step)


def friction_step(
    state: float, stroke: float, duration: float, amplitude: float, presliding_length: float
) -> float:
    """Exact state z after a monotonic stroke [m] of any size; the duration has no influence."""
    return dahl_step(state, stroke, presliding_length)


def friction_pull(
    state: float,
    pressure: float,
    braid_area: float,
    braid_slope: float,
    amplitude: float,
    presliding_length: float,
) -> tuple[float, float]:
    """Pull [N] that the state adds at a gauge pressure [Pa], and its dF/dp [m^2]."""
    area = friction_area(braid_area, amplitude) * state
    return max(pressure, 0.0) * area, area


def friction_response(
    state: float,
    pressure: float,
    braid_area: float,
    braid_slope: float,
    amplitude: float,
    presliding_length: float,
) -> tuple[float, float, float]:
    """dF/dL [N/m] while lengthening and while shortening; dF/dt at constant length is 0."""
    largest = friction_area(braid_area, amplitude) * max(pressure, 0.0)
    return (
        largest * dahl_slope(state, 1.0, presliding_length),
        largest * dahl_slope(state, -1.0, presliding_length),
        0.0,
    )


def unsettled(length: float, rest_length: float) -> float:
    """The state after an unknown motion is unknown; the middle of its range is assumed."""
    return 0.0


EFFECT = Effect(
    name="hysteresis",
    order=110,
    stage="muscle",
    scope="muscle",
    description="rate-independent thread friction that grows with pressure",
    law="F = F_static + h p b^2/(4 pi n^2) z, dz = (1 - sign(dL) z) dL/s_p (Dahl)",
    source="Coulomb friction with presliding (first-order model of Dahl)",
    parameters={
        "amplitude": EffectParameter(
            "h", "-", 0.0, 0.0, 0.5, "saturated friction over p b^2/(4 pi n^2)"
        ),
        "presliding_length": EffectParameter(
            "s_p", "m", 5e-4, 1e-6, 2e-2, "stroke over which it builds up", True
        ),
    },
    slots=(PullState("hysteresis", friction_pull, friction_rate, friction_response, unsettled),),
    control=TorqueFeedforward(
        "computes Dahl friction along the reference lengths and compensates its torque; the "
        "friction state starts at zero",
        friction_step,
    ),
    plausibility=Nothing(
        "nothing, because the pressures do not determine its state; it is a few per cent of the "
        "pull, which `plausibility.torque_share` tolerates"
    ),
    search=Search(
        ranges=lambda rig: {
            "amplitude": Range(0.0, 0.45, 0.03, (0.03,), ordinary=0.02),
            "presliding_length": Range(2e-5, 1.5e-2, 0.7, (5e-4, 3e-3), True),
        },
        shown_by=("position", "pulls"),
    ),
    portrait=Portrait(
        sizes={"amplitude": 0.05, "presliding_length": 1e-3},
        signature="Force against length is a hysteresis loop: lengthening and shortening give "
        "different forces at any speed, and the difference grows with pressure.",
        easily_taken_for="coulomb_friction, which does not grow with pressure.",
        told_apart_by="Move in slow cycles at two co-contraction levels; use a load cell.",
    ),
)
