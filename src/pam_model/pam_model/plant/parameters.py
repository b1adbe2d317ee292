"""The plant's parameters: one flat vector with named entries, and what the kernels derive from it.

Names: `gas.temperature`, `joint.inertia`, `agonist.thread_length` for what a rig file writes;
`coulomb_friction.torque` or `agonist.leakage.conductance` for effects (pam_model.effects holds
their units, bounds, neutral values and laws). Every nominal number is in the vector as well, so
that a fit can vary it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pam_model.effects import EFFECTS, effect_value
from pam_model.errors import PamError
from pam_model.gas import GAS_CONSTANT, REFERENCE_DENSITY, REFERENCE_TEMPERATURE
from pam_model.plant import layout as lay
from pam_model.plant.force_table import NO_TABLE, closed_form, make_table
from pam_model.plant.gas_stage import HEAT_CAPACITY, LINEAR_FROM
from pam_model.rig import Joint, Muscle, Rig

Vector = npt.NDArray[np.float64]
GRAVITY = 9.80665
CREEP_PRESSURE = 3e5  # Pa gauge
WIDEST = 25.0
FASTEST_VOLUME = 2.5e5  # 1/s, of a tube or reservoir
SHORTEST_SHARE = 0.05  # of the thread: no braid contracts so far, a diverging fit may


def _names() -> tuple[tuple[str, str], ...]:
    names = list(lay.JOINT_NOMINAL)
    for muscle in lay.MUSCLES:
        names += [(f"{muscle}.{name}", unit) for name, unit in lay.MUSCLE_NOMINAL]
    for effect in EFFECTS.values():
        owners = [f"{muscle}." for muscle in lay.MUSCLES] if effect.scope == "muscle" else [""]
        for owner in owners:
            names += [
                (f"{owner}{effect.name}.{key}", entry.unit)
                for key, entry in effect.parameters.items()
            ]
    return tuple(names)


UNITS: Mapping[str, str] = dict(_names())
NAMES: tuple[str, ...] = tuple(UNITS)
INDEX: Mapping[str, int] = {name: i for i, name in enumerate(NAMES)}


def neutral_values() -> dict[str, float]:
    """Every effect's parameter by its name in the vector, at its neutral value."""
    result = {}
    for effect in EFFECTS.values():
        owners = [f"{muscle}." for muscle in lay.MUSCLES] if effect.scope == "muscle" else [""]
        for owner in owners:
            for key, entry in effect.parameters.items():
                result[f"{owner}{effect.name}.{key}"] = entry.neutral
    return result


def parameter_names(effect: str, parameter: str) -> tuple[str, ...]:
    """Where one effect's parameter lies in the vector: once, or once per muscle."""
    if EFFECTS[effect].scope == "muscle":
        return tuple(f"{muscle}.{effect}.{parameter}" for muscle in lay.MUSCLES)
    return (f"{effect}.{parameter}",)


@dataclass(frozen=True, eq=False)
class PlantParameters:
    """One joint's parameters, as `values[INDEX[name]]`.

    Attributes
    ----------
    values : (n_parameters,) array
        In the order of NAMES, units in UNITS.
    tables : pair of arrays
        Force tables of muscles whose model has no closed form here; placeholders otherwise.
    """

    values: Vector
    tables: tuple[Vector, Vector] = field(default=(NO_TABLE, NO_TABLE))

    @classmethod
    def from_rig(cls, rig: Rig, joint: int = 0, *, with_effects: bool = True) -> PlantParameters:
        """The joint number `joint` of a rig, with the effects the rig names or without.

        Raises
        ------
        PamError
            For a joint the rig has not.
        """
        if not 0 <= joint < len(rig.joints):
            raise PamError(f"the rig has {len(rig.joints)} joints, none with number {joint}")
        entry = rig.joints[joint]
        muscles = (rig.muscle(entry.agonist), rig.muscle(entry.antagonist))
        values: dict[str, float] = neutral_values()
        values.update(_joint_values(rig, entry))
        tables = []
        for side, muscle in zip(lay.MUSCLES, muscles, strict=True):
            nominal, table = _muscle_values(rig, muscle)
            values.update({f"{side}.{key}": value for key, value in nominal.items()})
            tables.append(table)
        if with_effects:
            values.update(_effect_values(rig, entry, muscles))
        vector = np.array([values[name] for name in NAMES])
        return cls(vector, (tables[0], tables[1]))

    def __getitem__(self, name: str) -> float:
        return float(self.values[index(name)])

    def replaced(self, changes: Mapping[str, float]) -> PlantParameters:
        """A copy with some parameters, by name, at other values.

        An effect's parameter without a muscle ("leakage.conductance") is set on both muscles.

        Raises
        ------
        PamError
            For an unknown name or a value that is not finite.
        """
        values = self.values.copy()
        for name, value in changes.items():
            if not math.isfinite(value):
                raise PamError(f"plant parameter {name} = {value} must be finite")
            for full in expand_name(name):
                values[INDEX[full]] = value
        return replace(self, values=values)


def expand_name(name: str) -> tuple[str, ...]:
    """The entries of the vector a name means: itself, or both muscles' where it names no muscle.

    Raises
    ------
    PamError
        For a name the plant does not have.
    """
    if name in INDEX:
        return (name,)
    both = tuple(f"{muscle}.{name}" for muscle in lay.MUSCLES)
    if both[0] in INDEX:
        return both
    raise PamError(f"the plant has no parameter {name!r}; see pam_model.plant.parameters.NAMES")


def index(name: str) -> int:
    """Position of a parameter in the vector.

    Raises
    ------
    PamError
        For a name the plant does not have.
    """
    if name not in INDEX:
        raise PamError(f"the plant has no parameter {name!r}; see pam_model.plant.parameters.NAMES")
    return INDEX[name]


def _joint_values(rig: Rig, joint: Joint) -> dict[str, float]:
    lower, upper = joint.position_limits
    return {
        "gas.temperature": rig.gas.temperature,
        "gas.ambient_pressure": rig.gas.ambient_pressure,
        "gas.polytropic_exponent": rig.gas.polytropic_exponent,
        "supply_pressure": rig.supply_pressure,
        "joint.pulley_radius": joint.pulley_radius,
        "joint.inertia": joint.inertia,
        "joint.viscous_friction": joint.viscous_friction,
        "joint.gravity_torque": joint.gravity_torque,
        "joint.gravity_angle": joint.gravity_angle,
        "joint.lower_limit": lower,
        "joint.upper_limit": upper,
    }


def _muscle_values(rig: Rig, muscle: Muscle) -> tuple[dict[str, float], Vector]:
    form = closed_form(muscle)
    table, bounds, pressure_step = NO_TABLE, (0.0, 0.0), 1.0
    if form is None:
        table, bounds, pressure_step = make_table(muscle, rig.supply_pressure)
    wall, factor = form if form is not None else (0.0, 1.0)
    valve = muscle.valve
    return {
        "model_kind": float(form is None),
        "thread_length": muscle.thread_length,
        "turns": muscle.turns,
        "wall_thickness": wall,
        "rest_length": muscle.rest_length,
        "neutral_length": muscle.neutral_length,
        "dead_volume": muscle.dead_volume,
        "contraction_factor": factor,
        "shortest_length": bounds[0],
        "longest_length": bounds[1],
        "table_pressure_step": pressure_step,
        "valve.kind": float(valve.kind == "pressure_regulator"),
        "valve.sonic_conductance": valve.sonic_conductance,
        "valve.critical_ratio": valve.critical_ratio,
        "valve.time_constant": valve.time_constant,
    }, table


def _effect_values(rig: Rig, joint: Joint, muscles: tuple[Muscle, Muscle]) -> dict[str, float]:
    values = {}
    for effect in EFFECTS.values():
        holders: list[tuple[str, Any]]
        if effect.scope == "muscle":
            holders = [
                (f"{side}.", muscle.effects)
                for side, muscle in zip(lay.MUSCLES, muscles, strict=True)
            ]
        else:
            holders = [("", joint.effects if effect.scope == "joint" else rig.effects)]
        for owner, given in holders:
            for key in effect.parameters:
                values[f"{owner}{effect.name}.{key}"] = effect_value(given, effect.name, key)
    return values


RIGID_CONTACT = 1.0001e-4
"""Presliding angle [rad] up to which a contact is taken as rigid: encoders hardly show it, and the
steps that its stiffness would need are short."""


def derive_constants(values: Vector) -> Vector:
    """What the kernels use (plant_layout.C_*, M_*): effects merged into the nominal numbers.

    Parameters
    ----------
    values : (n_parameters,) array
        In the order of NAMES.
    """
    p = dict(zip(NAMES, values.tolist(), strict=True))
    c = np.zeros(lay.N_CONSTANTS)
    c[lay.C_TEMPERATURE] = p["gas.temperature"]
    c[lay.C_AMBIENT] = p["gas.ambient_pressure"]
    c[lay.C_EXPONENT] = p["gas.polytropic_exponent"]
    c[lay.C_SUPPLY] = p["supply_pressure"]
    c[lay.C_RT] = GAS_CONSTANT * p["gas.temperature"]
    c[lay.C_DENSITY] = REFERENCE_DENSITY * math.sqrt(REFERENCE_TEMPERATURE / p["gas.temperature"])
    radius = p["joint.pulley_radius"] * p["pulley_radius.scale"]
    c[lay.C_RADIUS] = radius
    mass, distance = p["payload.mass"], p["payload.distance"]
    c[lay.C_INERTIA] = p["joint.inertia"] + mass * distance * distance
    c[lay.C_VISCOUS] = p["joint.viscous_friction"] + p["viscous_friction.extra"]
    c[lay.C_GRAVITY] = p["joint.gravity_torque"] + mass * GRAVITY * distance
    c[lay.C_GRAVITY_ANGLE] = p["joint.gravity_angle"]
    c[lay.C_DROOP] = float(p["supply_droop.conductance"] > 0.0)
    c[lay.C_DROOP_CONDUCTANCE] = p["supply_droop.conductance"]
    c[lay.C_DROOP_VOLUME] = p["supply_droop.volume"]
    static, sliding = p["stribeck_friction.static_torque"], p["stribeck_friction.torque"]
    c[lay.C_COULOMB] = p["coulomb_friction.torque"] + sliding
    # Friction that rises with speed is no Stribeck curve.
    c[lay.C_STRIBECK] = max(static - sliding, 0.0)
    c[lay.C_STRIBECK_SPEED] = p["stribeck_friction.speed"]
    # One joint has one law of dry friction: where both effects are there, the softer contact.
    presliding = max(
        p["coulomb_friction.presliding_angle"], p["stribeck_friction.presliding_angle"]
    )
    c[lay.C_PRESLIDING] = presliding if presliding > RIGID_CONTACT else 0.0
    for side, m in zip(lay.MUSCLES, (lay.AGONIST, lay.ANTAGONIST), strict=True):
        own = {key[len(side) + 1 :]: value for key, value in p.items() if key.startswith(side)}
        c[m : m + lay.N_MUSCLE_CONSTANTS] = _muscle_constants(own)
    _limit_stiff_volumes(c)
    c[lay.C_LOWER], c[lay.C_UPPER] = _travel(c, p["joint.lower_limit"], p["joint.upper_limit"])
    c[lay.C_RATE] = _fastest_rate(c) / 2.0  # RK4 is stable to 2.78
    return c


def _muscle_constants(p: Mapping[str, float]) -> Vector:
    b, turns, wall = p["thread_length"], p["turns"], p["wall_thickness"]
    is_table = p["model_kind"] > 0.0
    d90 = b / (turns * math.pi)
    shortest, longest = p["shortest_length"], p["longest_length"]
    if not is_table:
        shortest = SHORTEST_SHARE * b
        # Kept off the end of the domain, where a braid is as thick as its wall.
        open_share = 1.0 - (2.1 * wall / d90) ** 2
        longest = b * math.sqrt(max(open_share, 0.01)) * (1.0 - 1e-6)
    m = np.zeros(lay.N_MUSCLE_CONSTANTS)
    m[lay.M_TABLE] = p["model_kind"]
    m[lay.M_B] = b
    m[lay.M_SCALE] = 1.0 / (4.0 * math.pi * turns * turns)
    m[lay.M_WALL] = wall
    m[lay.M_D90] = d90
    m[lay.M_REST] = p["rest_length"]
    m[lay.M_NEUTRAL] = p["neutral_length"]
    m[lay.M_DEAD] = max(p["dead_volume"] + p["dead_volume.extra_volume"], 1e-7)
    m[lay.M_FACTOR] = p["contraction_factor"] * p["end_caps.factor"]
    m[lay.M_SHORTEST], m[lay.M_LONGEST] = shortest, longest
    m[lay.M_TABLE_STEP] = p["table_pressure_step"]
    m[lay.M_REGULATOR] = p["valve.kind"]
    m[lay.M_CONDUCTANCE] = p["valve.sonic_conductance"]
    m[lay.M_CRITICAL] = p["valve.critical_ratio"]
    m[lay.M_LAG] = p["valve.time_constant"] + p["valve_lag.extra_time_constant"]
    m[lay.M_OVERLAP] = p["valve_dead_zone.overlap"]
    m[lay.M_NULL] = p["valve_null_offset.offset"]
    m[lay.M_EXHAUST] = p["exhaust_restriction.ratio"]
    m[lay.M_TUBE] = float(p["tube_restriction.conductance"] > 0.0)
    m[lay.M_TUBE_VOLUME] = p["tube_restriction.volume"]
    m[lay.M_TUBE_CONDUCTANCE] = p["tube_restriction.conductance"]
    m[lay.M_DELAY] = p["command_delay.delay"]
    m[lay.M_LEAK] = p["leakage.conductance"]
    m[lay.M_THERMAL] = p["thermal.conductance"]
    m[lay.M_HYSTERESIS] = p["hysteresis.amplitude"]
    m[lay.M_PRESLIDING] = p["hysteresis.presliding_length"]
    # The braid's own stiffness at CREEP_PRESSURE and its rest length makes the ratio a stiffness.
    own = 6.0 * CREEP_PRESSURE * p["rest_length"] * m[lay.M_SCALE]
    m[lay.M_CREEP] = p["creep.ratio"] * own
    m[lay.M_CREEP_TIME] = p["creep.time_constant"]
    m[lay.M_ELASTIC] = p["bladder_elasticity.linear"]
    m[lay.M_CUBIC] = p["bladder_elasticity.cubic"]
    m[lay.M_THREAD] = p["braid_extensibility.compliance"]
    m[lay.M_CABLE] = p["cable_compliance.compliance"]
    return m


def _travel(c: Vector, lower: float, upper: float) -> tuple[float, float]:
    """Position limits, narrowed where a muscle's path would leave its model's domain."""
    radius = c[lay.C_RADIUS]
    a, b = lay.AGONIST, lay.ANTAGONIST
    upper = min(
        upper,
        (c[b + lay.M_LONGEST] - c[b + lay.M_NEUTRAL]) / radius,
        (c[a + lay.M_NEUTRAL] - c[a + lay.M_SHORTEST]) / radius,
    )
    lower = max(
        lower,
        -(c[a + lay.M_LONGEST] - c[a + lay.M_NEUTRAL]) / radius,
        -(c[b + lay.M_NEUTRAL] - c[b + lay.M_SHORTEST]) / radius,
    )
    return lower, upper


def _slope_at_rest(critical: float) -> float:
    """-d psi/dr of the straight line near equal pressures."""
    s = (LINEAR_FROM - critical) / (1.0 - critical)
    return math.sqrt(1.0 - s * s) / (1.0 - LINEAR_FROM)


def _limit_stiff_volumes(c: Vector) -> None:
    """Keep a tube or reservoir no faster than the shortest step can follow.

    A path WIDEST times as wide as its valve loses 1/WIDEST^2 of the pressure: cutting there
    changes nothing that shows, and a small volume behind it is then rounded up.
    """
    gain = max(c[lay.C_EXPONENT], 1.0) * c[lay.C_RT] * c[lay.C_DENSITY] / FASTEST_VOLUME
    valves = 0.0
    for m in (lay.AGONIST, lay.ANTAGONIST):
        valve = c[m + lay.M_CONDUCTANCE] * max(1.0, c[m + lay.M_EXHAUST])
        valves += valve
        path = min(c[m + lay.M_TUBE_CONDUCTANCE], WIDEST * valve)
        least = gain * _slope_at_rest(c[m + lay.M_CRITICAL]) * (path + valve)
        c[m + lay.M_TUBE_CONDUCTANCE] = path
        c[m + lay.M_TUBE_VOLUME] = max(c[m + lay.M_TUBE_VOLUME], least)
    path = min(c[lay.C_DROOP_CONDUCTANCE], WIDEST * valves)
    least = gain * _slope_at_rest(c[lay.AGONIST + lay.M_CRITICAL]) * (path + valves)
    c[lay.C_DROOP_CONDUCTANCE] = path
    c[lay.C_DROOP_VOLUME] = max(c[lay.C_DROOP_VOLUME], least)


def _fastest_rate(c: Vector) -> float:
    """An upper estimate of the fastest rate in the plant [1/s], to choose a stable step."""
    fastest = 0.0
    if c[lay.C_PRESLIDING] > 0.0:
        grip = c[lay.C_COULOMB] + c[lay.C_STRIBECK]
        fastest = 3.0 * math.sqrt(grip / (c[lay.C_PRESLIDING] * c[lay.C_INERTIA]))
    gain = max(c[lay.C_EXPONENT], 1.0) * c[lay.C_RT] * c[lay.C_DENSITY]
    for m in (lay.AGONIST, lay.ANTAGONIST):
        slope = _slope_at_rest(c[m + lay.M_CRITICAL])
        longest = min(
            c[m + lay.M_NEUTRAL] + c[lay.C_RADIUS] * max(-c[lay.C_LOWER], c[lay.C_UPPER]),
            c[m + lay.M_LONGEST],
        )
        b = c[m + lay.M_B]
        braid = max(longest * (b * b - longest * longest) * c[m + lay.M_SCALE], 0.0)
        volume = c[m + lay.M_DEAD] + 0.8 * braid
        valve = gain * slope * c[m + lay.M_CONDUCTANCE] * max(1.0, c[m + lay.M_EXHAUST])
        if c[m + lay.M_TUBE] > 0.0:
            tube = gain * slope * c[m + lay.M_TUBE_CONDUCTANCE]
            inner = c[m + lay.M_TUBE_VOLUME]
            fastest = max(fastest, (valve + tube) / inner + tube / volume)
        else:
            fastest = max(fastest, valve / volume)
        if c[lay.C_DROOP] > 0.0:
            drawn = 2.0 * valve + gain * slope * c[lay.C_DROOP_CONDUCTANCE]
            fastest = max(fastest, drawn / c[lay.C_DROOP_VOLUME])
        if c[m + lay.M_THERMAL] > 0.0:
            mass = c[lay.C_AMBIENT] * volume / c[lay.C_RT]
            fastest = max(fastest, c[m + lay.M_THERMAL] / (mass * HEAT_CAPACITY))
        fastest = max(fastest, 1.0 / c[m + lay.M_LAG])
    return fastest
