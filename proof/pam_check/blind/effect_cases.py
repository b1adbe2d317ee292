"""The table of effects for all checks, with one row per effect; no check has another one.

A row says from which range the blind check draws an effect (ranges that occur on real rigs), at
which size it is hidden from the controller, and by which laws the two independent plants bring it
about. A size is moderate: near the middle of what is drawn, so that a rig with it is a rig that
people have, and its owner does not know of it. Reasons refer to the elbow of config/.

The first law is that of `truth_plant`, the second that of `second_laws` and `second_motion`, whose
docstrings name the literature. Both are switched on by the same fields of `TruthJoint` and
`TruthMuscle`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

from pam_check.blind.draw import Draw
from pam_check.blind.hidden_size import HiddenSize
from pam_check.blind.plants import FIRST, PLANTS
from pam_model.effects import EFFECTS
from pam_model.rig import Joint, Muscle

type Numbers = Mapping[str, float]
"""Parameters of a joint or a muscle of the drawn rig (`truth_plant.TruthJoint`, `TruthMuscle`)."""

EVERY_PLANT: Final = tuple(PLANTS)
SAME: Final = "has one form only"


@dataclass(frozen=True, slots=True)
class TrueValue[Part: (Joint, Muscle)]:
    """True value of a parameter, from the drawn joint or muscle and its part of the rig file."""

    of: Callable[[Numbers, Part], float]
    counts_in: tuple[str, ...] = EVERY_PLANT
    """Plants in which the parameter means the same as in the simulation that is fitted."""


@dataclass(frozen=True, slots=True)
class EffectCase:
    """What the checks need to know of an effect.

    Attributes
    ----------
    draw : callable
        Gives the rig that is drawn the effect at a drawn size.
    first_law, second_law : str
        Laws of the two plants.
    magnitudes : tuple of str
        Fields of the drawn rig that a weaker effect changes in proportion; the others shape it.
    size : HiddenSize or None
        Size hidden from the controller; None for an effect outside the table of effects.
    stage : str
        Stage of an effect outside the table; the others have it in `pam_model.effects`.
    fades_behind_a_regulator : bool
        Whether the inner loop of a pressure regulator takes the effect away.
    of_joint, of_muscle : mapping
        True values of parameters of the effect, by their names.
    """

    draw: Callable[[Draw], None]
    first_law: str
    second_law: str
    magnitudes: tuple[str, ...] = ()
    size: HiddenSize | None = None
    stage: str = ""
    fades_behind_a_regulator: bool = False
    of_joint: Mapping[str, TrueValue[Joint]] = field(default_factory=dict)
    of_muscle: Mapping[str, TrueValue[Muscle]] = field(default_factory=dict)


def _both(reason: str, **values: float) -> HiddenSize:
    return HiddenSize(reason, muscles=(values, values))


def _agonist(reason: str, **values: float) -> HiddenSize:
    return HiddenSize(reason, muscles=(values, {}))


def _payload(d: Draw) -> None:
    mass, distance = d.span(0.4, 1.5), d.span(0.15, 0.3)
    d.on_joint(
        gravity_torque=d.joint.gravity_torque + mass * 9.81 * distance,
        inertia=d.joint.inertia + mass * distance**2,
    )


def _coulomb(d: Draw) -> None:
    torque = d.span(0.25, 1.2)
    d.on_joint(coulomb_torque=torque, static_torque=torque)


def _stribeck(d: Draw) -> None:
    torque = d.span(0.25, 0.7)
    d.on_joint(
        coulomb_torque=torque,
        static_torque=torque * d.span(1.6, 2.5),
        stribeck_speed=d.span(0.05, 0.2),
    )


def _pulley(d: Draw) -> None:
    d.on_joint(pulley_radius=d.joint.pulley_radius * (1.0 + d.sign() * d.span(0.06, 0.15)))


KNOWN: Final[dict[str, EffectCase]] = {
    "valve_dead_zone": EffectCase(
        lambda d: d.both(dead_zone=d.span(0.03, 0.12)),
        "an overlap with rounded edges, as on a worn spool",
        "sharp edges with a radial clearance",
        ("dead_zone",),
        _both("an overlap of 6 % of the stroke is usual", dead_zone=0.06),
        fades_behind_a_regulator=True,
        of_muscle={"overlap": TrueValue(lambda m, _: m["dead_zone"], ())},
    ),
    "valve_null_offset": EffectCase(
        lambda d: d.one(null_offset=d.sign() * d.span(0.015, 0.06)),
        SAME,
        SAME,
        ("null_offset",),
        _agonist("a valve that was not adjusted, 3 % open", null_offset=0.03),
        fades_behind_a_regulator=True,
        # The plants state the command at which the valve is shut, the effect the opening at zero.
        of_muscle={"offset": TrueValue(lambda m, _: -m["null_offset"])},
    ),
    "valve_lag": EffectCase(
        lambda d: d.both(second_pole=d.span(0.01, 0.04)),
        "a second pole after the stated one",
        "a damped spool of second order",
        ("second_pole",),
        _both("a second pole of 20 ms, four times the stated lag", second_pole=0.02),
        of_muscle={"extra_time_constant": TrueValue(lambda m, _: m["second_pole"], ())},
    ),
    "exhaust_restriction": EffectCase(
        lambda d: d.both(exhaust_ratio=d.span(0.45, 0.8)),
        "a smaller conductance of the exhaust",
        "a silencer in series with the valve",
        ("exhaust_ratio",),
        _both("a silencer takes 40 % of the flow", exhaust_ratio=0.6),
        fades_behind_a_regulator=True,
        of_muscle={"ratio": TrueValue(lambda m, _: m["exhaust_ratio"], (FIRST,))},
    ),
    "supply_droop": EffectCase(
        lambda d: d.on_joint(
            reservoir_volume=d.span(2e-4, 2e-3), reservoir_conductance=d.span(1e-10, 6e-10)
        ),
        "a reservoir behind an orifice",
        "a reservoir behind a regulator whose poppet opens with the drop",
        (),
        HiddenSize(
            "a 0.6 l reservoir behind a thin hose",
            joint={"reservoir_volume": 6e-4, "reservoir_conductance": 2.5e-10},
        ),
        fades_behind_a_regulator=True,
        of_joint={
            "volume": TrueValue(lambda j, _: j["reservoir_volume"], (FIRST,)),
            "conductance": TrueValue(lambda j, _: j["reservoir_conductance"], (FIRST,)),
        },
    ),
    "tube_restriction": EffectCase(
        lambda d: d.both(tube_volume=d.span(5e-6, 3e-5), tube_conductance=d.span(1e-9, 4e-9)),
        "a volume behind a square-root law of flow",
        "a line of lumps with inertance, and laminar or turbulent resistance",
        ("tube_volume",),
        _both(
            "a metre of narrow tube between valve and muscle",
            tube_volume=6e-6,
            tube_conductance=3e-9,
        ),
    ),
    "command_delay": EffectCase(
        lambda d: d.both(command_delay=d.span(0.008, 0.03)),
        "a fixed delay",
        "a wait for the next slot of a bus",
        ("command_delay",),
        _both("a bus cycle of 20 ms that nobody stated", command_delay=0.019),
        of_muscle={"delay": TrueValue(lambda m, _: m["command_delay"])},
    ),
    "leakage": EffectCase(
        lambda d: d.both(leak=d.span(2e-11, 2e-10)),
        "a laminar leak by its volume flow at upstream density",
        "laminar compressible flow in a narrow gap",
        ("leak",),
        _both("hisses audibly: 2 % of the valve", leak=7e-11),
        fades_behind_a_regulator=True,
    ),
    "dead_volume": EffectCase(
        lambda d: d.both(dead_volume=d.muscles[0].dead_volume + d.span(1.5e-5, 6e-5)),
        SAME,
        SAME,
        ("dead_volume",),
        HiddenSize("fittings of 30 ml more", added_to_muscles={"dead_volume": 3e-5}),
        fades_behind_a_regulator=True,
        of_muscle={"extra_volume": TrueValue(lambda m, rig: m["dead_volume"] - rig.dead_volume)},
    ),
    "thermal": EffectCase(
        lambda d: d.both(heat_transfer=d.span(0.1, 1.0)),
        "convection that grows with the density",
        "convection that grows with the root of pressure and temperature, to a wall that warms",
        (),
        _both("between isothermal and adiabatic at 1 Hz", heat_transfer=0.3),
        fades_behind_a_regulator=True,
    ),
    "hysteresis": EffectCase(
        lambda d: d.both(thread_friction=d.span(0.004, 0.02), play_length=d.span(5e-4, 2e-3)),
        "Prandtl-Ishlinskii play operators",
        "generalised Bouc-Wen hysteresis with unequal branches",
        ("thread_friction",),
        _both(
            "six per cent of the muscle's force, dry threads",
            thread_friction=0.006,
            play_length=1e-3,
        ),
    ),
    "creep": EffectCase(
        lambda d: d.both(creep_stiffness=d.span(250.0, 1200.0), creep_order=d.span(0.15, 0.4)),
        "a springpot of Maxwell elements",
        "a Burgers chain",
        ("creep_stiffness",),
        _both("a tenth of the joint's stiffness", creep_stiffness=550.0, creep_order=0.25),
    ),
    "bladder_elasticity": EffectCase(
        lambda d: d.both(bladder_volume=d.span(8e-6, 2.5e-5), bladder_modulus=d.span(0.6e6, 1.6e6)),
        "a Mooney-Rivlin solid",
        "three terms of Ogden",
        ("bladder_volume",),
        _both("1.5 mm of rubber of 1 MPa", bladder_volume=1.4e-5, bladder_modulus=1e6),
    ),
    "end_caps": EffectCase(
        lambda d: d.both(end_factor=d.span(1.05, 1.25)),
        "a factor on the contraction",
        "frusta between braid and fittings, by virtual work",
        ("end_factor",),
        _both("contraction is 12 % more than a cylinder's", end_factor=1.12),
        of_muscle={"factor": TrueValue(lambda m, _: m["end_factor"], (FIRST,))},
    ),
    "threshold_pressure": EffectCase(
        lambda d: d.both(threshold_pressure=d.span(2e4, 8e4)),
        "a bladder that comes into contact little by little",
        "a neo-Hookean tube that is narrower than the braid",
        ("threshold_pressure",),
        _both("a thick bladder takes a tenth of the usual pressure", threshold_pressure=3e4),
        of_muscle={"pressure": TrueValue(lambda m, _: m["threshold_pressure"], (FIRST,))},
    ),
    "braid_extensibility": EffectCase(
        lambda d: d.both(thread_compliance=d.span(8e-6, 4e-5)),
        "a linear thread with implicit tension",
        "a yarn that stiffens as its crimp is pulled out",
        ("thread_compliance",),
        _both("nylon threads, 1 % at 4 bar", thread_compliance=1.8e-5),
    ),
    "cable_compliance": EffectCase(
        lambda d: d.both(cable_compliance=d.span(3e-6, 2e-5)),
        "a linear cable",
        "the exponential law of slack fibres",
        ("cable_compliance",),
        _both("a Dyneema cable with knots, 125 N/mm", cable_compliance=8e-6),
        of_muscle={"compliance": TrueValue(lambda m, _: m["cable_compliance"], (FIRST,))},
    ),
    "coulomb_friction": EffectCase(
        _coulomb,
        "LuGre friction",
        "generalised Maxwell slip",
        ("coulomb_torque", "static_torque"),
        HiddenSize(
            "a tenth of the torque that holds the limb level",
            joint={"coulomb_torque": 0.55, "static_torque": 0.55},
        ),
        of_joint={"torque": TrueValue(lambda j, _: j["coulomb_torque"])},
    ),
    "stribeck_friction": EffectCase(
        _stribeck,
        "LuGre friction",
        "generalised Maxwell slip with the velocity weakening of Hess and Soom",
        ("coulomb_torque", "static_torque"),
        HiddenSize(
            "breaks away at twice the friction of the moving joint",
            joint={"coulomb_torque": 0.42, "static_torque": 0.84, "stribeck_speed": 0.1},
        ),
    ),
    "viscous_friction": EffectCase(
        lambda d: d.on_joint(viscous_friction=d.joint.viscous_friction + d.span(0.15, 0.8)),
        SAME,
        SAME,
        ("viscous_friction",),
        HiddenSize(
            "2.4 times the stated damping, as of stiff grease",
            added_to_joint={"viscous_friction": 0.35},
        ),
        of_joint={"extra": TrueValue(lambda j, rig: j["viscous_friction"] - rig.viscous_friction)},
    ),
    "payload": EffectCase(
        _payload,
        SAME,
        SAME,
        ("gravity_torque", "inertia"),
        HiddenSize(
            "0.8 kg at 0.21 m in the hand",
            added_to_joint={"gravity_torque": 0.8 * 9.81 * 0.21, "inertia": 0.8 * 0.21**2},
        ),
    ),
    "pulley_radius": EffectCase(
        _pulley,
        SAME,
        SAME,
        ("pulley_radius",),
        HiddenSize("10 % more, a cable that lies higher", scaled_joint={"pulley_radius": 1.1}),
        of_joint={"scale": TrueValue(lambda j, rig: j["pulley_radius"] / rig.pulley_radius)},
    ),
    "position_offset": EffectCase(
        lambda d: d.on_joint(position_offset=d.sign() * d.span(0.02, 0.1)),
        SAME,
        SAME,
        ("position_offset",),
        HiddenSize("an encoder put on by eye, 2.6 degrees", joint={"position_offset": 0.045}),
        of_joint={"offset": TrueValue(lambda j, _: j["position_offset"])},
    ),
    "position_delay": EffectCase(
        lambda d: d.on_joint(position_delay=d.span(0.008, 0.04)),
        SAME,
        SAME,
        ("position_delay",),
        HiddenSize("an encoder read over a slow bus", joint={"position_delay": 0.018}),
        of_joint={"delay": TrueValue(lambda j, _: j["position_delay"])},
    ),
    "pressure_gain": EffectCase(
        lambda d: d.one(pressure_gain=1.0 + d.sign() * d.span(0.04, 0.12)),
        SAME,
        SAME,
        ("pressure_gain",),
        _agonist("a sensor of another range, 7 % off", pressure_gain=1.07),
        of_muscle={"gain": TrueValue(lambda m, _: m["pressure_gain"])},
    ),
    "pressure_bias": EffectCase(
        lambda d: d.one(pressure_bias=d.sign() * d.span(5e3, 2e4)),
        SAME,
        SAME,
        ("pressure_bias",),
        _agonist("a zero that drifted by 10 kPa", pressure_bias=1e4),
        of_muscle={"bias": TrueValue(lambda m, _: m["pressure_bias"])},
    ),
    "pressure_lag": EffectCase(
        lambda d: d.both(pressure_lag=d.span(0.01, 0.05)),
        "a filter of first order",
        "a Butterworth filter of second order",
        ("pressure_lag",),
        _both("a filter of 6 Hz in the sensor", pressure_lag=0.026),
        of_muscle={"time_constant": TrueValue(lambda m, _: m["pressure_lag"], (FIRST,))},
    ),
}
"""Effects of the table of effects, in its order."""

OUTSIDE: Final[dict[str, EffectCase]] = {
    "pulley_eccentricity": EffectCase(
        lambda d: d.on_joint(pulley_eccentricity=d.span(0.002, 0.005)),
        "an oval pulley whose axes are turned",
        "an oval pulley",
        ("pulley_eccentricity",),
        stage="joint",
    ),
    "encoder_eccentricity": EffectCase(
        lambda d: d.on_joint(encoder_eccentricity=d.span(0.03, 0.1)),
        "a ring that is off its centre",
        "a ring that is oval",
        ("encoder_eccentricity",),
        stage="sensing",
    ),
    "torque_ripple": EffectCase(
        lambda d: d.on_joint(torque_ripple=d.span(0.4, 1.2)),
        "a sine of the angle",
        "a triangle wave of the angle",
        ("torque_ripple",),
        stage="joint",
    ),
    "cross_leak": EffectCase(
        lambda d: d.on_joint(cross_leak=d.span(5e-11, 3e-10)),
        "a volume flow in proportion to the difference of pressures",
        "laminar compressible flow in a narrow gap",
        ("cross_leak",),
        stage="valve",
        fades_behind_a_regulator=True,
    ),
    "spool_hysteresis": EffectCase(
        lambda d: d.both(spool_hysteresis=d.span(0.02, 0.06)),
        "a play between command and spool",
        "friction that holds the spool until its error is larger",
        ("spool_hysteresis",),
        stage="valve",
        fades_behind_a_regulator=True,
    ),
    "backlash": EffectCase(
        lambda d: d.on_joint(backlash=d.span(0.02, 0.06)),
        "a pulley that goes to a flank and pulls less between them",
        "a pulley of its own between two flanks",
        ("backlash",),
        stage="joint",
    ),
}
"""Effects outside the table; the correct answer is `unknown`."""


def case_of(effect: str) -> EffectCase:
    """The row of an effect, within the table of effects or outside."""
    return KNOWN[effect] if effect in KNOWN else OUTSIDE[effect]


def stage_of(effect: str) -> str:
    """The stage of an effect."""
    return case_of(effect).stage or EFFECTS[effect].stage


def size_of(effect: str) -> HiddenSize:
    """The size at which an effect of the table is hidden from the controller.

    Raises
    ------
    ValueError
        If its row states none.
    """
    size = case_of(effect).size
    if size is None:
        raise ValueError(f"effect_cases.py states no size of {effect}")
    return size
