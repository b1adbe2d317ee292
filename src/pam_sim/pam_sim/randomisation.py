"""Draws the numbers of simulated robots from intervals, such as those that a diagnosis states.

A policy that is trained on one robot may fail on one that differs a little. Training on many robots
whose numbers are drawn (domain randomisation, Tobin et al., IROS 2017) needs widths: a diagnosis
knows them, because it states each number of a named effect with a 90 % interval.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pam_model.errors import PamError
from pam_model.plant.parameters import INDEX, PlantParameters, bounds_of, expand_name
from pam_model.reading import read_text, reading
from pam_ros.foreign_text import shown

Array = npt.NDArray[np.float64]

QUANTILE = 1.6448536269514722
"""Half of a 90 % interval over the standard deviation of a normal distribution."""


@dataclass(frozen=True, slots=True)
class Spread:
    """A number that is not known exactly."""

    value: float  # its estimate, in SI units
    # low, high: its 90 % interval
    low: float
    high: float

    def draw(self, count: int, generator: np.random.Generator) -> Array:
        """Numbers (count,) from two half normal distributions, one on either side of the value."""
        normal = generator.standard_normal(count)
        half = np.where(normal < 0.0, self.value - self.low, self.high - self.value)
        return self.value + normal * half / QUANTILE


@dataclass(frozen=True, slots=True)
class Randomisation:
    """Which numbers of a joint are drawn, and how.

    Attributes
    ----------
    spreads : mapping of str to Spread
        By name of the plant's parameter, such as `coulomb_friction.torque` or
        `agonist.leakage.conductance`; one without a muscle holds for both, which get equal numbers.

    Raises
    ------
    UnknownNameError
        For a name that the plant does not have.
    PamError
        For an interval that does not contain its value.
    """

    spreads: Mapping[str, Spread] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, one in self.spreads.items():
            expand_name(name)
            if not (np.isfinite([one.low, one.high]).all() and one.low <= one.value <= one.high):
                raise PamError(
                    f"{shown(name)}: {one.low:g} to {one.high:g} is no interval around "
                    f"{one.value:g}"
                )

    @classmethod
    def from_diagnosis(cls, path: str | Path) -> Randomisation:
        """The numbers of the effects that a `diagnosis.json` names, with their intervals.

        Parameters
        ----------
        path : str or Path
            The file.

        Raises
        ------
        PamError
            For a file that cannot be read, or is no diagnosis.
        """
        path = Path(path)
        with reading(path, "a diagnosis"):
            effects = json.loads(read_text(path))["parameters"]
            return cls(
                {
                    _plant_name(effect, name): Spread(
                        *(float(interval[key]) for key in ("value", "low", "high"))
                    )
                    for effect, numbers in effects.items()
                    for name, interval in numbers.items()
                }
            )

    def draw(
        self, parameters: PlantParameters, count: int, generator: np.random.Generator
    ) -> Array:
        """The numbers of `count` joints (count, n_parameters), within the bounds of a rig file."""
        values = np.repeat(parameters.values[None], count, axis=0)
        for name, spread in self.spreads.items():
            drawn = spread.draw(count, generator)
            for full in expand_name(name):
                values[:, INDEX[full]] = np.clip(drawn, *bounds_of(full))
        return values


def _plant_name(effect: str, name: str) -> str:
    """`leakage`, `conductance.agonist` -> `agonist.leakage.conductance`."""
    key, _, side = name.partition(".")
    return f"{side}.{effect}.{key}".lstrip(".")
