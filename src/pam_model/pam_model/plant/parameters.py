"""The plant's parameters: one flat vector with named entries.

Names are `gas.temperature`, `joint.inertia`, `agonist.thread_length` for numbers of the rig file,
and `coulomb_friction.torque` or `agonist.leakage.conductance` for effects (pam_model.effects holds
their units, bounds, neutral values and laws). The nominal numbers are in the vector as well, so
that a fit can vary them. constants.py derives the constants of the kernels from the vector.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pam_model.bounds import within
from pam_model.effects import EFFECTS, effect_value
from pam_model.errors import UnknownNameError
from pam_model.names import unknown
from pam_model.plant import layout as lay
from pam_model.plant.force_table import NO_TABLE, closed_form, make_table
from pam_model.rig import Joint, Muscle, Rig
from pam_model.rig.keys import NUMBERS

Vector = npt.NDArray[np.float64]


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


@dataclass(frozen=True, slots=True)
class RigPlace:
    """Where a rig file states a plant parameter.

    Attributes
    ----------
    section : str
        "rig", "gas", "joint", "muscle", "valve" or "effect".
    side : str
        "agonist" or "antagonist" for a parameter of a muscle, else empty.
    effect : str
        The effect to which it belongs, else empty.
    key : str
        The key in that section.
    """

    section: str
    side: str
    effect: str
    key: str


def _rig_places() -> dict[str, RigPlace]:
    places = {}
    for name, _ in lay.JOINT_NOMINAL:
        section, _, key = name.rpartition(".")
        places[name] = RigPlace(section or "rig", "", "", key)
    for side in lay.MUSCLES:
        for name, _ in lay.MUSCLE_NOMINAL:
            section, _, key = name.rpartition(".")
            places[f"{side}.{name}"] = RigPlace(section or "muscle", side, "", key)
    for effect in EFFECTS.values():
        for side in lay.MUSCLES if effect.scope == "muscle" else ("",):
            for key in effect.parameters:
                name = f"{side}.{effect.name}.{key}".lstrip(".")
                places[name] = RigPlace("effect", side, effect.name, key)
    return places


RIG_PLACES: Mapping[str, RigPlace] = _rig_places()
"""The place of every plant parameter in a rig file, by its name."""


def neutral_values() -> dict[str, float]:
    """The neutral values of all effects' parameters, by their names in the vector."""
    result = {}
    for effect in EFFECTS.values():
        owners = [f"{muscle}." for muscle in lay.MUSCLES] if effect.scope == "muscle" else [""]
        for owner in owners:
            for key, entry in effect.parameters.items():
                result[f"{owner}{effect.name}.{key}"] = entry.neutral
    return result


def parameter_names(effect: str, parameter: str) -> tuple[str, ...]:
    """Names of one effect's parameter in the vector: one, or one per muscle."""
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
        Force tables of muscles whose model has no closed form in the plant, else placeholders.
    """

    values: Vector
    tables: tuple[Vector, Vector] = field(default=(NO_TABLE, NO_TABLE))

    @classmethod
    def from_rig(cls, rig: Rig, joint: str | int = 0) -> PlantParameters:
        """The parameters of a joint, by its name or number, with the rig's effects.

        Raises
        ------
        UnknownNameError
            If the rig has no such joint.
        """
        entry = rig.joint(joint)
        muscles = (rig.muscle(entry.agonist), rig.muscle(entry.antagonist))
        values: dict[str, float] = neutral_values()
        values.update(_joint_values(rig, entry))
        tables = []
        for side, muscle in zip(lay.MUSCLES, muscles, strict=True):
            nominal, table = _muscle_values(rig, muscle)
            values.update({f"{side}.{key}": value for key, value in nominal.items()})
            tables.append(table)
        values.update(_effect_values(rig, entry, muscles))
        vector = np.array([values[name] for name in NAMES])
        return cls(vector, (tables[0], tables[1]))

    def __getitem__(self, name: str) -> float:
        return float(self.values[index(name)])

    def replaced(self, changes: Mapping[str, float]) -> PlantParameters:
        """A copy with changed values of some parameters, by name.

        An effect's parameter without a muscle ("leakage.conductance") is set on both muscles.

        Raises
        ------
        UnknownNameError
            For an unknown name.
        PamError
            For a value that a rig file could not have.
        """
        for name, value in changes.items():
            low, high = bounds_of(expand_name(name)[0])
            within(f"plant parameter {name}", value, low, high, UNITS[expand_name(name)[0]])
        return self.forced(changes)

    def forced(self, changes: Mapping[str, float]) -> PlantParameters:
        """As `replaced`, for faults that no rig file describes: any finite value is taken."""
        values = self.values.copy()
        for name, value in changes.items():
            within(f"plant parameter {name}", value)
            for full in expand_name(name):
                values[INDEX[full]] = value
        return replace(self, values=values)


def expand_name(name: str) -> tuple[str, ...]:
    """The entries of the vector that a name denotes; both muscles' if it names no muscle.

    Raises
    ------
    UnknownNameError
        For a name the plant does not have.
    """
    if name in INDEX:
        return (name,)
    both = tuple(f"{muscle}.{name}" for muscle in lay.MUSCLES)
    if both[0] in INDEX:
        return both
    raise UnknownNameError(_unknown(name))


def _unknown(name: str) -> str:
    prefixes = tuple(f"{muscle}." for muscle in lay.MUSCLES)
    of_both = [one.removeprefix(prefixes[0]) for one in NAMES if one.startswith(prefixes[0])]
    near = unknown("plant parameter", name, [*NAMES, *of_both])
    return f"{near} All names: pam_model.plant.parameters.NAMES"


def bounds_of(name: str) -> tuple[float, float]:
    """Lowest and highest value of a plant parameter that a rig file may have, in its unit."""
    place = RIG_PLACES[name]
    if place.section == "effect":
        entry = EFFECTS[place.effect].parameters[place.key]
        return entry.low, entry.high
    key = NUMBERS["" if place.section == "rig" else place.section].get(place.key)
    return (key.low, key.high) if key else (-math.inf, math.inf)


def index(name: str) -> int:
    """Position of a parameter in the vector.

    Raises
    ------
    UnknownNameError
        For a name the plant does not have.
    """
    if name not in INDEX:
        raise UnknownNameError(_unknown(name))
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
    form = closed_form(muscle.model, muscle.geometry, muscle.model_parameters)
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
        "valve.damping": 1.0 if valve.damping is None else valve.damping,
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
