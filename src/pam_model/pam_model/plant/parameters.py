"""The plant's parameters: one flat vector with named entries.

Names are `gas.temperature`, `joint.inertia`, `agonist.thread_length` for numbers of the rig file,
and `coulomb_friction.torque` or `agonist.leakage.conductance` for effects (pam_model.effects holds
their units, bounds, neutral values and laws). The nominal numbers are in the vector as well, so
that a fit can vary them. constants.py derives the constants of the kernels from the vector.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from pam_model.bounds import within
from pam_model.effects import EFFECTS, effect_value
from pam_model.errors import UnknownNameError
from pam_model.names import unknown
from pam_model.plant import layout as lay
from pam_model.plant.force_table import NO_TABLE, closed_form, make_table
from pam_model.plant.muscle_arms import (
    PAIR,
    SIDES,
    MuscleArm,
    MuscleArms,
    checked_muscles,
    names_of,
)
from pam_model.rig import Joint, Muscle, Rig
from pam_model.rig.types import NUMBERS

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RigPlace:
    """Where a rig file states a plant parameter."""

    section: str  # "rig", "gas", "joint", "muscle", "valve" or "effect"
    side: str  # name of the muscle for a parameter of a muscle, else empty
    effect: str  # the effect to which it belongs, else empty
    key: str  # the key in that section


@dataclass(frozen=True, slots=True)
class ParameterTable:
    """The parameters of a joint with certain muscles, in the order of the vector."""

    muscles: tuple[str, ...]  # names of its muscles
    units: Mapping[str, str]  # unit of each parameter, by its name
    index: Mapping[str, int]  # position of each parameter in the vector
    places: Mapping[str, RigPlace]  # where a rig file states each parameter

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters."""
        return tuple(self.units)


@cache
def parameter_table(muscles: tuple[str, ...]) -> ParameterTable:
    """The table of the parameters of a joint with muscles of these names."""
    units: dict[str, str] = {}
    places: dict[str, RigPlace] = {}

    def add(name: str, unit: str, place: RigPlace) -> None:
        units[name], places[name] = unit, place

    for name, unit in lay.JOINT_NOMINAL:
        section, _, key = name.rpartition(".")
        add(name, unit, RigPlace(section or "rig", "", "", key))
    for muscle in muscles:
        for name, unit in lay.MUSCLE_NOMINAL:
            section, _, key = name.rpartition(".")
            add(f"{muscle}.{name}", unit, RigPlace(section or "muscle", muscle, "", key))
    for effect in EFFECTS.values():
        for owner in muscles if effect.scope == "muscle" else ("",):
            for key, entry in effect.parameters.items():
                name = f"{owner}.{effect.name}.{key}".lstrip(".")
                add(name, entry.unit, RigPlace("effect", owner, effect.name, key))
    return ParameterTable(muscles, units, {name: i for i, name in enumerate(units)}, places)


_OF_PAIR = parameter_table(SIDES)
UNITS: Mapping[str, str] = _OF_PAIR.units
"""Units of the parameters of a joint with the pair of a rig file; so are the names below."""
NAMES: tuple[str, ...] = _OF_PAIR.names
INDEX: Mapping[str, int] = _OF_PAIR.index
RIG_PLACES: Mapping[str, RigPlace] = _OF_PAIR.places


def neutral_values(muscles: tuple[str, ...] = SIDES) -> dict[str, float]:
    """The neutral values of all effects' parameters, by their names in the vector."""
    result = {}
    for effect in EFFECTS.values():
        owners = [f"{muscle}." for muscle in muscles] if effect.scope == "muscle" else [""]
        for owner in owners:
            for key, entry in effect.parameters.items():
                result[f"{owner}{effect.name}.{key}"] = entry.neutral
    return result


def parameter_names(
    effect: str, parameter: str, muscles: tuple[str, ...] = SIDES
) -> tuple[str, ...]:
    """Names of one effect's parameter in the vector: one, or one per muscle."""
    if EFFECTS[effect].scope == "muscle":
        return tuple(f"{muscle}.{effect}.{parameter}" for muscle in muscles)
    return (f"{effect}.{parameter}",)


@dataclass(frozen=True, eq=False)
class PlantParameters:
    """One joint's parameters, as `values[index[name]]`.

    Attributes
    ----------
    values : (n_parameters,) array
        In the order of the names in `table`, with its units.
    tables : tuple of n_muscles arrays
        Force tables of muscles whose model has no closed form in the plant, else placeholders.
    muscles : tuple of n_muscles MuscleArm, optional
        The muscles of the joint; by default the pair of a rig file.
    """

    values: Vector
    tables: tuple[Vector, ...] = (NO_TABLE, NO_TABLE)
    muscles: MuscleArms = PAIR

    @classmethod
    def from_rig(cls, rig: Rig, joint: str | int = 0) -> PlantParameters:
        """The parameters of a joint, by its name or number, with the rig's effects.

        Raises
        ------
        UnknownNameError
            If the rig has no such joint.
        """
        entry = rig.joint(joint)
        pair = (rig.muscle(entry.agonist), rig.muscle(entry.antagonist))
        return cls.with_muscles(rig, joint, dict(zip(PAIR, pair, strict=True)))

    @classmethod
    def with_muscles(
        cls, rig: Rig, joint: str | int, muscles: Mapping[MuscleArm, Muscle]
    ) -> PlantParameters:
        """The parameters of a joint that any number of muscles turn.

        Parameters
        ----------
        rig : Rig
            Gives the gas, the supply and the effects of the rig.
        joint : str or int
            The joint by its name or number; which muscles the rig gives it does not matter.
        muscles : mapping of MuscleArm to Muscle
            What is known of each muscle. A muscle of the rig may occur several times, by several
            names.

        Raises
        ------
        UnknownNameError
            If the rig has no such joint.
        PamError
            For muscles that a joint cannot have, see `checked_muscles`.
        """
        entry = rig.joint(joint)
        turning = checked_muscles(tuple(muscles))
        names = names_of(turning)
        values: dict[str, float] = neutral_values(names)
        values.update(_joint_values(rig, entry))
        tables = []
        for name, muscle in zip(names, muscles.values(), strict=True):
            nominal, table = _muscle_values(rig, muscle)
            values.update({f"{name}.{key}": value for key, value in nominal.items()})
            tables.append(table)
        of_muscles = dict(zip(names, muscles.values(), strict=True))
        values.update(_effect_values(rig, entry, of_muscles))
        vector = np.array([values[name] for name in parameter_table(names).names])
        return cls(vector, tuple(tables), turning)

    @cached_property
    def table(self) -> ParameterTable:
        """Names, units and places of the parameters."""
        return parameter_table(names_of(self.muscles))

    def __getitem__(self, name: str) -> float:
        return float(self.values[index(name, self.table)])

    def replaced(self, changes: Mapping[str, float]) -> PlantParameters:
        """A copy with changed values of some parameters, by name.

        An effect's parameter without a muscle ("leakage.conductance") is set on all muscles.

        Raises
        ------
        UnknownNameError
            For an unknown name.
        PamError
            For a value that a rig file could not have.
        """
        for name, value in changes.items():
            full = expand_name(name, self.table)[0]
            low, high = bounds_of(full, self.table)
            within(f"plant parameter {name}", value, low, high, self.table.units[full])
        return self.forced(changes)

    def forced(self, changes: Mapping[str, float]) -> PlantParameters:
        """As `replaced`, for faults that no rig file describes: any finite value is taken."""
        values = self.values.copy()
        for name, value in changes.items():
            within(f"plant parameter {name}", value)
            for full in expand_name(name, self.table):
                values[self.table.index[full]] = value
        return replace(self, values=values)


def expand_name(name: str, table: ParameterTable = _OF_PAIR) -> tuple[str, ...]:
    """The entries of the vector that a name denotes; all muscles' if it names no muscle.

    Raises
    ------
    UnknownNameError
        For a name the plant does not have.
    """
    if name in table.index:
        return (name,)
    all_of_them = tuple(f"{muscle}.{name}" for muscle in table.muscles)
    if all_of_them[0] in table.index:
        return all_of_them
    raise UnknownNameError(_unknown(name, table))


def _unknown(name: str, table: ParameterTable) -> str:
    first = f"{table.muscles[0]}."
    of_all = [one.removeprefix(first) for one in table.names if one.startswith(first)]
    near = unknown("plant parameter", name, [*table.names, *of_all])
    return f"{near} All names: pam_model.plant.parameters.NAMES"


def bounds_of(name: str, table: ParameterTable = _OF_PAIR) -> tuple[float, float]:
    """Lowest and highest value of a plant parameter that a rig file may have, in its unit."""
    place = table.places[name]
    if place.section == "effect":
        entry = EFFECTS[place.effect].parameters[place.key]
        return entry.low, entry.high
    key = NUMBERS["" if place.section == "rig" else place.section].get(place.key)
    return (key.low, key.high) if key else (-math.inf, math.inf)


def index(name: str, table: ParameterTable = _OF_PAIR) -> int:
    """Position of a parameter in the vector.

    Raises
    ------
    UnknownNameError
        For a name the plant does not have.
    """
    if name not in table.index:
        raise UnknownNameError(_unknown(name, table))
    return table.index[name]


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


def _effect_values(rig: Rig, joint: Joint, muscles: Mapping[str, Muscle]) -> dict[str, float]:
    values = {}
    for effect in EFFECTS.values():
        holders: list[tuple[str, Any]]
        if effect.scope == "muscle":
            holders = [(f"{name}.", muscle.effects) for name, muscle in muscles.items()]
        else:
            holders = [("", joint.effects if effect.scope == "joint" else rig.effects)]
        for owner, given in holders:
            for key in effect.parameters:
                values[f"{owner}{effect.name}.{key}"] = effect_value(given, effect.name, key)
    return values
