"""Air leaks from the muscle to ambient, independent of the valve."""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Portrait, Range, Search
from pam_model.effects.slots import Leak
from pam_model.gas.flow import reference_flow


def leaking_flow(
    pressure: float, ambient_pressure: float, critical_ratio: float, conductance: float
) -> float:
    """Mass flow out of the muscle over rho0 [m^3/s]; pressures absolute [Pa]."""
    return reference_flow(conductance, critical_ratio, pressure, ambient_pressure)


EFFECT = Effect(
    name="leakage",
    order=80,
    stage="valve",
    scope="muscle",
    description="air leaks from the muscle to ambient",
    law="mdot = ISO 6358 with C_l from muscle to ambient, always open",
    source="ISO 6358-1, flow-rate characteristics of pneumatic components",
    parameters={"conductance": EffectParameter("C_l", "m^3/(s Pa)", 0.0, 0.0, 1e-8, "of the leak")},
    slots=(Leak(leaking_flow),),
    control=Included("adds the flow of the leak to the flow of the valve"),
    plausibility=Included("the pressure observer includes the flow of the leak"),
    search=Search(
        ranges=lambda rig: {
            "conductance": Range(
                0.0, 0.5 * rig.flow, 0.01 * rig.flow, (0.01 * rig.flow,), ordinary=0.003 * rig.flow
            )
        },
        shown_by=("commands",),
        shows_when_shut=True,
    ),
    portrait=Portrait(
        sizes={"conductance": 6e-11},
        signature="The pressure falls while the valves are shut, faster at higher pressure; "
        "holding a pressure needs a constant positive command.",
        easily_taken_for="valve_null_offset, which does not depend on the pressure.",
        told_apart_by="Record the pressure decay with shut valves.",
    ),
)
