"""A tube lies between the muscle and the valve, where the pressure sensor is."""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Portrait, Range, Search
from pam_model.effects.slots import Adjusts


def tube_conductance(ideal: float, conductance: float, volume: float) -> float:
    """Conductance of the tube [m^3/(s Pa)]; 0: there is no tube."""
    return conductance


def tube_volume(ideal: float, conductance: float, volume: float) -> float:
    """Volume of the tube, on the valve's side of its restriction [m^3]."""
    return volume


EFFECT = Effect(
    name="tube_restriction",
    order=60,
    stage="valve",
    scope="muscle",
    description="a tube lies between the muscle and the valve, where the pressure sensor is",
    law="two chambers: valve -> V_t, then ISO 6358 with C_t -> muscle",
    source="ISO 6358-1, flow-rate characteristics of pneumatic components",
    parameters={
        "conductance": EffectParameter("C_t", "m^3/(s Pa)", 0.0, 0.0, 1e-6, "tube; 0: no tube"),
        "volume": EffectParameter("V_t", "m^3", 1e-5, 1e-8, 1e-2, "gas volume of the tube", True),
    },
    slots=(
        Adjusts("tube.conductance", tube_conductance),
        Adjusts("tube.volume", tube_volume),
    ),
    control=Included(
        "controls the pressure in the muscle, which it computes from the flow and the loss in the "
        "tube; the adaptation finds a tube that is not named, and corrects the loss of one that is"
    ),
    plausibility=Included(
        "the pressure observer has a chamber for the tube, where the sensor is, and one for the "
        "muscle"
    ),
    search=Search(
        ranges=lambda rig: {
            "conductance": Range(
                0.03 * rig.flow, 3.0 * rig.flow, 0.7, (0.5 * rig.flow, 1.5 * rig.flow), True
            ),
            "volume": Range(
                0.02 * rig.volume, rig.volume, 0.7, (0.05 * rig.volume, 0.15 * rig.volume), True
            ),
        },
        shown_by=("commands",),
    ),
    portrait=Portrait(
        sizes={"conductance": 2e-9, "volume": 1.5e-5},
        signature="The sensor at the valve leads the muscle: the pressure jumps and then changes "
        "slowly while the flow decays; the force follows late.",
        easily_taken_for="valve_lag, where the force follows the measured pressure at once; "
        "pressure_lag, where it leads.",
        told_apart_by="Use a load cell, or apply steps with the joint locked.",
    ),
)
