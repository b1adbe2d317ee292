"""The numbers that a fit may change: a model's constants, and four numbers of the geometry."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pam_model.errors import DomainError
from pam_model.identify.measurements import Measurements
from pam_model.muscles.elementary import cosine, sine
from pam_model.muscles.force_model import ModelParameter, MuscleGeometry

GEOMETRY_UNITS: Mapping[str, str] = {
    "rest_length": "m",
    "braid_angle": "rad",
    "diameter": "m",
    "wall_thickness": "m",
}

HOW_TO_STATE: Mapping[str, str] = {
    "rest_length": "--rest-length, with a tape measure between the fittings",
    "braid_angle": "--angle, between thread and axis at rest",
    "diameter": "--diameter, with a calliper on the braid at rest",
    "wall_thickness": "--wall-thickness of the bladder",
}
"""The option that states a number of the geometry, and how it is measured."""


@dataclass(frozen=True, slots=True)
class FreeNumber:
    """A number to fit; the optimiser sees z = 1 + (value - start)/scale."""

    name: str
    start: float
    scale: float
    low: float
    high: float
    unit: str

    @property
    def zero(self) -> float:
        """The optimiser's z at which this number is 0."""
        return 1.0 - self.start / self.scale


def free_geometry_number(name: str, start: float, data: Measurements) -> FreeNumber:
    """One of `GEOMETRY_UNITS` with the range in which a fit searches for it."""
    longest = float(np.max(data.position)) if not data.is_shortening else 0.0
    low, high, unit = {
        "rest_length": (0.2 * start, 5.0 * start, "m"),
        "braid_angle": (math.radians(3.0), math.radians(87.0), "rad"),
        "diameter": (1e-3, 0.3, "m"),
        "wall_thickness": (0.0, 0.02, "m"),
    }[name]
    if name == "rest_length":
        low = max(low, 0.5 * longest)
    return FreeNumber(name, start, max(abs(start), 1e-3), low, high, unit)


def free_constant(name: str, parameter: ModelParameter, start: float) -> FreeNumber:
    """A constant of a model."""
    reach = max(abs(parameter.low), abs(parameter.high))
    scale = abs(start) or (0.01 * reach if math.isfinite(reach) else 1.0)
    return FreeNumber(name, start, scale, parameter.low, parameter.high, parameter.unit)


def start_of(parameter: ModelParameter, geometry: MuscleGeometry) -> float:
    """The start value of a constant for which no value was given."""
    if parameter.when_zero is not None and not parameter.default:
        return float(parameter.when_zero(geometry))
    if parameter.default is not None:
        return parameter.default
    if parameter.low > 0.0:
        return math.sqrt(parameter.low * parameter.high)
    return 0.5 * (parameter.low + parameter.high)


def guess_geometry(data: Measurements, stated: Mapping[str, float] | None = None) -> MuscleGeometry:
    """A contracting muscle of plausible size as a start: 20 deg at rest, a stroke of a quarter.

    Numbers of `GEOMETRY_UNITS` that are `stated` are kept.
    """
    if data.is_shortening:
        rest = max(float(np.max(data.position)), 1e-3) / 0.25
    else:
        rest = float(np.max(data.position))
    return geometry_of(
        {
            "rest_length": rest,
            "braid_angle": math.radians(20.0),
            "diameter": 0.02,
            "wall_thickness": 1e-3,
            **(stated or {}),
        }
    )


def geometry_of(values: Mapping[str, Any]) -> MuscleGeometry:
    """The geometry that the four numbers of `GEOMETRY_UNITS` describe; they may be dual numbers."""
    angle = values["braid_angle"]
    thread = values["rest_length"] / cosine(angle)
    turns = thread * sine(angle) / (math.pi * values["diameter"])
    return MuscleGeometry(thread, turns, values["rest_length"], values["wall_thickness"])


def geometry_numbers(geometry: MuscleGeometry) -> dict[str, float]:
    """The four numbers of `GEOMETRY_UNITS` that describe a geometry.

    Raises
    ------
    DomainError
        For a geometry that no braid can have.
    """
    b, rest = geometry.thread_length, geometry.rest_length
    if not (0.0 < rest < b and geometry.turns > 0.0):
        raise DomainError(
            f"rest_length = {rest:g} m must lie in (0, {b:g}) m, the thread length, "
            f"and turns = {geometry.turns:g} above 0"
        )
    return {
        "rest_length": rest,
        "braid_angle": math.acos(rest / b),
        "diameter": math.sqrt(b * b - rest * rest) / (math.pi * geometry.turns),
        "wall_thickness": geometry.wall_thickness,
    }
