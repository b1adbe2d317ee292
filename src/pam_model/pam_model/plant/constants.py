"""The constants of the kernels, derived from the parameter vector of a plant or of several.

Every effect that adjusts a number of the ideal rig is applied to it here. The parameters of the
laws that the kernels call are stored after these numbers (layout.JOINT_EFFECTS, MUSCLE_EFFECTS).
Each number is a float or, where several plants differ in it, an array (numbers_of_lanes.py).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from pam_model.effects import filled
from pam_model.effects.declaration import Effect
from pam_model.effects.slots import TARGETS, Adjusts, Chamber, DryFriction, Law, Thread
from pam_model.gas import GAS_CONSTANT, choking_slope, reference_density
from pam_model.plant import layout as lay
from pam_model.plant.layout import EffectConstants
from pam_model.plant.muscle_arms import PAIR, MuscleArms, names_of
from pam_model.plant.numbers_of_lanes import (
    Numbers,
    columns_of,
    either,
    larger,
    largest,
    law_of,
    law_where,
    root,
    rows_of,
    smaller,
)
from pam_model.plant.parameters import parameter_names, parameter_table

Vector = npt.NDArray[np.float64]
WIDEST = 25.0
FASTEST_VOLUME = 2.5e5  # 1/s, fastest pressure rate of a tube or reservoir
SHORTEST_SHARE = 0.05  # of the thread length; no braid is as short, but a diverging fit may be
LEAST_DEAD = 4e-4
"""Least dead volume, over b^3/(4 pi n^2): no fit may reach an empty muscle of no volume. A muscle
of any size has the same share, so that the laws do not depend on its size."""
RIGID_CONTACT = 1.0001e-4
"""Presliding angle [rad] up to which a contact is modelled as rigid: encoders hardly resolve it,
and its stiffness would need very short integration steps."""
_FRICTIONS = filled(DryFriction)
_CHAMBERS = filled(Chamber)
_THREADS = filled(Thread)


@dataclass(frozen=True, slots=True)
class _Adjusted:
    """One number of the ideal rig, and the effects that change it."""

    name: str  # the target, preceded by its muscle
    ideal: float  # its value if the rig file does not state it
    written: int  # its index in the vector if the rig file states it, else -1
    # law of each effect, with the indices of the effect's parameters in the vector
    laws: tuple[tuple[Law, tuple[int, ...]], ...]


@dataclass(frozen=True, slots=True)
class _StoredEffect:
    """One effect whose parameters are kernel constants, and their indices in the vector."""

    constants: EffectConstants
    places: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class _Derivation:
    """Where the numbers of a joint with certain muscles are in its vector."""

    # every target of `effects.slots.TARGETS`, of the joint and of each muscle
    adjusted: tuple[_Adjusted, ...]
    # effects whose parameters are kernel constants, by owner: "" or a muscle with a dot
    stored: Mapping[str, tuple[_StoredEffect, ...]]
    # by owner: index of each number that the rig file states of a muscle
    written: Mapping[str, Mapping[str, int]]
    presliding: tuple[int, ...]  # indices of the presliding angles
    index: Mapping[str, int]  # of all parameters


@cache
def _derivation(muscles: MuscleArms) -> _Derivation:
    names = names_of(muscles)
    index = parameter_table(names).index
    of_muscles = tuple(f"{name}." for name in names)
    owners = ("", *of_muscles)

    def places(effect: Effect, owner: str) -> tuple[int, ...]:
        return tuple(index[f"{owner}{effect.name}.{key}"] for key in effect.parameters)

    return _Derivation(
        tuple(
            _Adjusted(
                owner + target,
                0.0 if entry.ideal is None else entry.ideal,
                index[owner + target] if entry.ideal is None else -1,
                tuple(
                    (slot.law, places(effect, owner))
                    for effect, slot in filled(Adjusts)
                    if slot.target == target
                ),
            )
            for owner in owners
            for target, entry in TARGETS.items()
            if entry.scope == ("muscle" if owner else "joint")
        ),
        {
            owner: tuple(
                _StoredEffect(constants, places(constants.effect, owner))
                for constants in (lay.MUSCLE_EFFECTS if owner else lay.JOINT_EFFECTS).values()
            )
            for owner in owners
        },
        {
            owner: {name: index[owner + name] for name, _ in lay.MUSCLE_NOMINAL}
            for owner in of_muscles
        },
        tuple(
            index[name]
            for effect, slot in _FRICTIONS
            for name in parameter_names(effect.name, slot.presliding, names)
        ),
        index,
    )


def adjusted_numbers(values: Vector, muscles: MuscleArms = PAIR) -> dict[str, Numbers]:
    """Every target of `effects.slots.TARGETS` with its effects applied.

    Parameters
    ----------
    values : (n_parameters,) or (n_plant, n_parameters) array
        In the order of the joint's `parameters.parameter_table`.
    muscles : tuple of MuscleArm, optional
        Those of the joint.

    Returns
    -------
    dict of str to float or (n_plant,) array
        By name; targets of a muscle are preceded by its name with a dot. What is the same in all
        plants is a float.
    """
    return _adjusted(columns_of(values), _derivation(muscles))


def _adjusted(v: list[Numbers], known: _Derivation) -> dict[str, Numbers]:
    result: dict[str, Numbers] = {}
    for entry in known.adjusted:
        number = v[entry.written] if entry.written >= 0 else entry.ideal
        for law, places in entry.laws:
            number = law_of(law, number, *[v[i] for i in places])
        result[entry.name] = number
    return result


def derive_constants(
    values: Vector, reservoir_share: float = 1.0, muscles: MuscleArms = PAIR
) -> Vector:
    """The constants of the kernels (layout.C_*, M_*, and those of effects).

    Parameters
    ----------
    values : (n_parameters,) or (n_plant, n_parameters) array
        In the order of the joint's `parameters.parameter_table`.
    reservoir_share : float, optional
        Share of the reservoir and of its refill path that belongs to this joint [-].
    muscles : tuple of MuscleArm, optional
        Those of the joint.

    Returns
    -------
    (n_constants,) or (n_plant, n_constants) array
        Of several plants, they are derived much faster together than one by one.
    """
    v = columns_of(values)
    known = _derivation(muscles)
    index = known.index
    number = _adjusted(v, known)
    temperature = v[index["gas.temperature"]]
    # A list, because its items are read and written much faster.
    c: list[Numbers] = [0.0] * lay.constants_of(len(muscles))
    c[lay.C_TEMPERATURE] = temperature
    c[lay.C_AMBIENT] = v[index["gas.ambient_pressure"]]
    c[lay.C_EXPONENT] = v[index["gas.polytropic_exponent"]]
    c[lay.C_SUPPLY] = v[index["supply_pressure"]]
    c[lay.C_RT] = GAS_CONSTANT * temperature
    c[lay.C_DENSITY] = law_of(reference_density, temperature)
    c[lay.C_RADIUS] = number["joint.pulley_radius"]
    c[lay.C_INERTIA] = number["joint.inertia"]
    c[lay.C_PER_INERTIA] = 1.0 / c[lay.C_INERTIA]
    c[lay.C_VISCOUS] = number["joint.viscous_friction"]
    c[lay.C_GRAVITY] = number["joint.gravity_torque"]
    c[lay.C_GRAVITY_ANGLE] = v[index["joint.gravity_angle"]]
    c[lay.C_DROOP] = 1.0 * (number["reservoir.conductance"] > 0.0)
    c[lay.C_DROOP_CONDUCTANCE] = reservoir_share * number["reservoir.conductance"]
    c[lay.C_DROOP_VOLUME] = reservoir_share * number["reservoir.volume"]
    for stored in known.stored[""]:
        _store(c, 0, stored, v)
    c[lay.C_FRICTION] = largest([c[lay.JOINT_EFFECTS[e.name].is_on] for e, _ in _FRICTIONS])
    # A joint has one contact; of several effects, the softest applies.
    presliding = largest([v[i] for i in known.presliding])
    c[lay.C_PRESLIDING] = either(presliding > RIGID_CONTACT, presliding, 0.0)
    for i, muscle in enumerate(muscles):
        c[lay.constants_of(i) + lay.M_ARM] = muscle.arm
        _muscle_constants(c, lay.constants_of(i), v, number, f"{muscle.name}.", known)
    c[lay.C_DROOP_CRITICAL] = c[lay.C_MUSCLES + lay.M_CRITICAL]
    _limit_stiff_volumes(c)
    c[lay.C_LOWER], c[lay.C_UPPER] = _travel(
        c, v[index["joint.lower_limit"]], v[index["joint.upper_limit"]]
    )
    c[lay.C_RATE] = _fastest_rate(c) / 2.0  # RK4 is stable to 2.78
    return rows_of(c, values)


def _store(c: list[Numbers], first: int, stored: _StoredEffect, v: list[Numbers]) -> None:
    """Write the parameters of one effect, and whether it is switched on."""
    is_on: Numbers = 0.0
    entries = stored.constants.effect.parameters.values()
    for place, at, entry in zip(
        stored.constants.parameters.values(), stored.places, entries, strict=True
    ):
        c[first + place] = v[at]
        if not entry.is_shape:
            is_on = larger(is_on, 1.0 - entry.is_neutral(v[at]))
    c[first + stored.constants.is_on] = is_on


def _given(c: list[Numbers], first: int, constants: EffectConstants) -> list[Numbers]:
    """Read the parameters of an effect from the constants."""
    return [c[first + place] for place in constants.parameters.values()]


def _muscle_constants(
    c: list[Numbers],
    m: int,
    v: list[Numbers],
    number: Mapping[str, Numbers],
    owner: str,
    known: _Derivation,
) -> None:
    index = known.written[owner]

    def written(name: str) -> Numbers:
        return v[index[name]]

    def adjusted(name: str) -> Numbers:
        return number[owner + name]

    b, turns, wall = written("thread_length"), written("turns"), written("wall_thickness")
    is_table = written("model_kind") > 0.0
    d90 = b / (turns * math.pi)
    share = 2.1 * wall / d90
    # A small distance from the end of the domain, where the braid is as thick as its wall.
    longest = b * root(larger(1.0 - share * share, 0.01)) * (1.0 - 1e-6)
    scale = 1.0 / (4.0 * math.pi * turns * turns)
    c[m + lay.M_TABLE] = written("model_kind")
    c[m + lay.M_B] = b
    c[m + lay.M_PER_B] = 1.0 / b
    c[m + lay.M_SCALE] = scale
    c[m + lay.M_WALL] = wall
    c[m + lay.M_D90] = d90
    c[m + lay.M_REST] = written("rest_length")
    c[m + lay.M_NEUTRAL] = written("neutral_length")
    c[m + lay.M_DEAD] = larger(adjusted("dead_volume"), LEAST_DEAD * b * b * b * scale)
    c[m + lay.M_FACTOR] = adjusted("contraction_factor")
    c[m + lay.M_THRESHOLD] = adjusted("threshold_pressure")
    c[m + lay.M_SHORTEST] = either(is_table, written("shortest_length"), SHORTEST_SHARE * b)
    c[m + lay.M_LONGEST] = either(is_table, written("longest_length"), longest)
    c[m + lay.M_TABLE_STEP] = written("table_pressure_step")
    c[m + lay.M_REGULATOR] = written("valve.kind")
    conductance = written("valve.sonic_conductance")
    c[m + lay.M_CONDUCTANCE] = conductance
    c[m + lay.M_EXHAUST] = conductance * adjusted("valve.exhaust_ratio")
    c[m + lay.M_CRITICAL] = written("valve.critical_ratio")
    c[m + lay.M_PER_LAG] = 1.0 / adjusted("valve.time_constant")
    c[m + lay.M_SWING] = 2.0 * (1.0 - written("valve.damping"))
    c[m + lay.M_TUBE] = 1.0 * (adjusted("tube.conductance") > 0.0)
    c[m + lay.M_TUBE_VOLUME] = adjusted("tube.volume")
    c[m + lay.M_TUBE_CONDUCTANCE] = adjusted("tube.conductance")
    c[m + lay.M_DELAY] = adjusted("valve.command_delay")
    c[m + lay.M_CABLE] = adjusted("series_compliance")
    c[m + lay.M_BRAID_AREA] = b * b * scale
    c[m + lay.M_BRAID_SLOPE] = 6.0 * written("rest_length") * scale
    for stored in known.stored[owner]:
        _store(c, m, stored, v)
    c[m + lay.M_THREAD] = largest([c[m + lay.MUSCLE_EFFECTS[e.name].is_on] for e, _ in _THREADS])
    c[m + lay.M_SHUT_EXPONENT] = c[lay.C_EXPONENT]
    for effect, slot in _CHAMBERS:
        is_on = c[m + lay.MUSCLE_EFFECTS[effect.name].is_on]
        c[m + lay.M_THERMAL] = is_on
        c[m + lay.M_SHUT_EXPONENT] = either(is_on > 0.0, slot.exponent, c[lay.C_EXPONENT])


def _travel(c: list[Numbers], lower: Numbers, upper: Numbers) -> tuple[Numbers, Numbers]:
    """Position limits, restricted so that no muscle leaves the domain of its model."""
    for m in _muscles(c):
        arm = abs(c[m + lay.M_ARM]) * c[lay.C_RADIUS]
        lengthens = (c[m + lay.M_LONGEST] - c[m + lay.M_NEUTRAL]) / arm
        shortens = (c[m + lay.M_NEUTRAL] - c[m + lay.M_SHORTEST]) / arm
        turns_up = c[m + lay.M_ARM] > 0.0
        upper = smaller(upper, shortens if turns_up else lengthens)
        lower = larger(lower, -(lengthens if turns_up else shortens))
    return lower, upper


def _muscles(c: list[Numbers]) -> range:
    """Where the constants of each muscle begin."""
    return range(lay.C_MUSCLES, len(c), lay.N_MUSCLE_CONSTANTS)


def _limit_stiff_volumes(c: list[Numbers]) -> None:
    """Limit the dynamics of a tube or reservoir to what the shortest step can integrate.

    A path with WIDEST times the conductance of its valve loses 1/WIDEST^2 of the pressure, so that
    limiting the conductance to this value has no visible influence. A volume that is still too
    small for the shortest step is then increased.
    """
    gain = _gain(c) / FASTEST_VOLUME
    valves: Numbers = 0.0
    for m in _muscles(c):
        valve = larger(c[m + lay.M_CONDUCTANCE], c[m + lay.M_EXHAUST])
        valves += valve
        path = smaller(c[m + lay.M_TUBE_CONDUCTANCE], WIDEST * valve)
        least = gain * law_of(choking_slope, c[m + lay.M_CRITICAL]) * (path + valve)
        c[m + lay.M_TUBE_CONDUCTANCE] = path
        c[m + lay.M_TUBE_VOLUME] = larger(c[m + lay.M_TUBE_VOLUME], least)
    path = smaller(c[lay.C_DROOP_CONDUCTANCE], WIDEST * valves)
    least = gain * law_of(choking_slope, c[lay.C_DROOP_CRITICAL]) * (path + valves)
    c[lay.C_DROOP_CONDUCTANCE] = path
    c[lay.C_DROOP_VOLUME] = larger(c[lay.C_DROOP_VOLUME], least)


def _gain(c: list[Numbers]) -> Numbers:
    """Rate of a pressure [Pa/s] times the volume, over the flow into it [m^3 s^-1 ANR]."""
    return larger(c[lay.C_EXPONENT], 1.0) * c[lay.C_RT] * c[lay.C_DENSITY]


def _fastest_rate(c: list[Numbers]) -> Numbers:
    """An upper estimate of the fastest rate in the plant [1/s], to choose a stable step."""
    fastest = larger(c[lay.C_VISCOUS] * c[lay.C_PER_INERTIA], _rate_of_contact(c))
    gain = _gain(c)
    for m in _muscles(c):
        slope = law_of(choking_slope, c[m + lay.M_CRITICAL])
        arm = abs(c[m + lay.M_ARM]) * c[lay.C_RADIUS]
        longest = smaller(
            c[m + lay.M_NEUTRAL] + arm * larger(-c[lay.C_LOWER], c[lay.C_UPPER]),
            c[m + lay.M_LONGEST],
        )
        b = c[m + lay.M_B]
        braid = larger(longest * (b * b - longest * longest) * c[m + lay.M_SCALE], 0.0)
        volume = c[m + lay.M_DEAD] + 0.8 * braid
        valve = gain * slope * larger(c[m + lay.M_CONDUCTANCE], c[m + lay.M_EXHAUST])
        tube = gain * slope * c[m + lay.M_TUBE_CONDUCTANCE]
        behind_tube = (valve + tube) / c[m + lay.M_TUBE_VOLUME] + tube / volume
        flow = either(c[m + lay.M_TUBE] > 0.0, behind_tube, valve / volume)
        fastest = larger(fastest, flow)
        drawn = len(_muscles(c)) * valve + gain * slope * c[lay.C_DROOP_CONDUCTANCE]
        refill = either(c[lay.C_DROOP] > 0.0, drawn / c[lay.C_DROOP_VOLUME], 0.0)
        fastest = larger(fastest, refill)
        mass = c[lay.C_AMBIENT] * volume / c[lay.C_RT]
        for effect, slot in _CHAMBERS:
            known = lay.MUSCLE_EFFECTS[effect.name]
            given = _given(c, m, known)
            heated = law_where(c[m + known.is_on], slot.heat_rate, mass, *given)
            fastest = larger(fastest, heated)
        fastest = larger(fastest, c[m + lay.M_PER_LAG])
    return fastest


def _rate_of_contact(c: list[Numbers]) -> Numbers:
    """The fastest rate of a contact that yields before it slides [1/s]; 0 of a rigid one."""
    grip: Numbers = 0.0
    for effect, slot in _FRICTIONS:
        known = lay.JOINT_EFFECTS[effect.name]
        grip = grip + law_where(c[known.is_on], slot.law, 0.0, *_given(c, 0, known))
    yields = c[lay.C_PRESLIDING] > 0.0
    angle = either(yields, c[lay.C_PRESLIDING], 1.0)
    return either(yields, 3.0 * root(grip / (angle * c[lay.C_INERTIA])), 0.0)
