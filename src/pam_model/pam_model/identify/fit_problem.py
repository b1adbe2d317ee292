"""The residuals that `fit` minimises: a force model on measured points, by its free numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Literal

import numpy as np

from pam_model.dual_numbers import Dual, root_with_slopes, value_of
from pam_model.errors import DomainError, PamError
from pam_model.identify.free_numbers import (
    GEOMETRY_UNITS,
    FreeNumber,
    free_constant,
    free_geometry_number,
    geometry_numbers,
    geometry_of,
    guess_geometry,
    start_of,
)
from pam_model.identify.measurements import Array, Measurements
from pam_model.muscles.equilibrium_length import (
    Equilibrium,
    length_range,
    slope_at,
    solve_equilibrium,
)
from pam_model.muscles.force_model import (
    ForceModel,
    ModelParameter,
    MuscleGeometry,
    create_force_model,
    registered_models,
    unknown_model,
)

Residual = Literal["force", "length"]
RESIDUAL_UNITS: Mapping[Residual, str] = {"force": "N", "length": "m"}


def predicted_force(model: ForceModel, geometry: MuscleGeometry, data: Measurements) -> Any:
    """A model's force [N] at the pressures, positions and velocities of measured points.

    Where no measured muscle pushes, a model that would push predicts 0: the muscle is slack, as in
    the simulation. A muscle held short shows this up to a threshold pressure.
    """
    length = geometry.rest_length - data.position if data.is_shortening else data.position
    force = model.force(data.pressure, length, data.velocity)
    return force * (value_of(force) > 0.0) if data.only_pulls else force


class FitProblem:
    """A model on data, as a function of the free numbers."""

    def __init__(
        self,
        name: str,
        data: Measurements,
        *,
        geometry: MuscleGeometry | None,
        constants: Mapping[str, float],
        fit_geometry: bool,
        free: Iterable[str] | None,
        residual: Residual,
        stated: Mapping[str, float] | None = None,
    ) -> None:
        models = registered_models()
        if name not in models:
            raise PamError(unknown_model(name))
        if residual not in RESIDUAL_UNITS:
            raise PamError(f"residual = {residual!r}, expected {' or '.join(RESIDUAL_UNITS)}")
        if geometry is None and not fit_geometry:
            raise PamError("no geometry of the muscle is given, so the geometry has to be fitted")
        self.name = name
        self.data = data
        self.residual: Residual = residual
        self.declared: Mapping[str, ModelParameter] = models[name].model.parameters
        unknown = [key for key in constants if key not in self.declared]
        if unknown:
            raise PamError(
                f"model {name}: unknown constant {', '.join(unknown)}; "
                f"it has {', '.join(self.declared) or 'none'}"
            )
        stated = stated or {}
        base = geometry or guess_geometry(data, stated)
        self.fixed = {**geometry_numbers(base), **constants}
        geometric = [key for key in GEOMETRY_UNITS if fit_geometry and key not in stated]
        known = [*GEOMETRY_UNITS, *self.declared]
        chosen = (
            [*geometric, *(key for key in self.declared if key not in constants)]
            if free is None
            else list(free)
        )
        for key in chosen:
            if key not in known:
                raise PamError(f"model {name}: cannot fit {key!r}; it has {', '.join(known)}")
        has_length = geometry is not None or "rest_length" in stated
        if data.is_shortening and "rest_length" not in chosen and not has_length:
            raise PamError(f"{data.name} has shortening, no length: rest_length has to be fitted")
        for key, parameter in self.declared.items():
            if key in chosen:
                self.fixed.setdefault(key, start_of(parameter, base))
            elif parameter.default is not None:
                self.fixed.setdefault(key, parameter.default)
            else:
                self.fixed.setdefault(key, start_of(parameter, base))
        self.free = [self._describe(key) for key in chosen]
        self.active = np.ones(len(self.free), dtype=bool)
        # Points that differ only in the measured position share one prediction.
        table = np.stack([data.pressure, data.force, data.velocity])
        unique, back = np.unique(table, axis=1, return_inverse=True)
        self._back = np.ravel(back)
        self._pressure, self._force, self._velocity = unique
        self._count = np.bincount(self._back)
        self._mean_position = np.bincount(self._back, data.position) / self._count

    def _describe(self, key: str) -> FreeNumber:
        start = self.fixed[key]
        if key in GEOMETRY_UNITS:
            return free_geometry_number(key, start, self.data)
        return free_constant(key, self.declared[key], start)

    def values(self, z: Array) -> dict[str, float]:
        """All numbers by name; z = 1 is the start, and one unit of z is the number's scale."""
        found = dict(self.fixed)
        for free, value in zip(self.free, z, strict=True):
            number = free.start + (float(value) - 1.0) * free.scale
            found[free.name] = min(max(number, free.low), free.high)
        return found

    def model(self, z: Array) -> tuple[ForceModel, MuscleGeometry, dict[str, float]]:
        """The model at z."""
        values = self.values(z)
        geometry = geometry_of(values)
        constants = {key: values[key] for key in self.declared}
        return create_force_model(self.name, geometry, constants), geometry, constants

    def residuals(self, z: Array) -> Array:
        """Model minus measurement, for every point.

        A point that lies outside the domain of a force model costs `outside_cost`.

        Raises
        ------
        DomainError
            Where the model covers no point, or, for lengths, not every point.
        """
        if self.residual == "force":
            model, geometry, _ = self.model(z)
            force = self._row_by_row(
                lambda rows: np.asarray(predicted_force(model, geometry, rows), dtype=float)
            )
            return np.where(np.isnan(force), self.outside_cost, force - self.data.force)
        found, geometry = self._equilibrium(z)
        return self._length_residuals(found.length, geometry.rest_length)

    @property
    def outside_cost(self) -> float:
        """Residual of a point outside the model's domain: the largest force, none left out [N]."""
        return float(np.max(np.abs(self.data.force)))

    def outside(self, z: Array) -> int:
        """Number of points outside the domain of the model at z."""
        if self.residual != "force":
            return 0
        model, geometry, _ = self.model(z)
        force = self._row_by_row(
            lambda rows: np.asarray(predicted_force(model, geometry, rows), dtype=float)
        )
        return int(np.isnan(force).sum())

    def _row_by_row(self, of: Callable[[Measurements], Array]) -> Array:
        """A function of all points at once; NaN in the rows of points outside the model's domain.

        Raises
        ------
        DomainError
            Where the model covers no point.
        """
        try:
            return of(self.data)
        except DomainError as error:
            refused = error
        found: list[tuple[Any, Array]] = []
        left: list[Any] = [*np.array_split(np.arange(len(self.data)), 2)]
        while left:
            rows = left.pop()
            chosen = np.zeros(len(self.data), dtype=bool)
            chosen[rows] = True
            try:
                found.append((rows, of(self.data.select(chosen))))
            except DomainError:
                if rows.size > 1:
                    left += np.array_split(rows, 2)
        if not found:
            raise refused
        values = np.full((len(self.data), *found[0][1].shape[1:]), math.nan)
        for places, value in found:
            values[places] = value
        return values

    def _equilibrium(self, z: Array) -> tuple[Equilibrium, MuscleGeometry]:
        model, geometry, _ = self.model(z)
        # No warm start: if several lengths are in equilibrium, the result must depend on z alone.
        stop = self._stop(geometry)
        found = solve_equilibrium(model, self._pressure, self._force, self._velocity, stop)
        return found, geometry

    def _stop(self, geometry: MuscleGeometry) -> Any:
        return geometry.rest_length if self.data.is_shortening else math.inf

    def _length_residuals(self, length: Array, rest_length: float) -> Array:
        predicted = rest_length - length if self.data.is_shortening else length
        return np.asarray(predicted[self._back] - self.data.position, dtype=float)

    def jacobian(self, z: Array) -> Array:
        """Exact derivative of every residual by every free number; 0 where it is not finite.

        Computed with dual numbers. The derivative of a length follows from the implicit function
        theorem at the length that was found, dL/dz = -(dF/dz)/(dF/dL); if the muscle rests at a
        bound, it is the derivative of the bound.

        Raises
        ------
        DomainError
            Where the model does not cover a point at z.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            if self.residual == "force":
                model, geometry = self._dual_model(z)
                slope = self._row_by_row(
                    lambda rows: self._slopes_of(predicted_force(model, geometry, rows), len(rows))
                )
            else:
                slope = self._length_slopes(z)
        return np.where(np.isfinite(slope), slope, 0.0)

    def _length_slopes(self, z: Array) -> Array:
        found, _ = self._equilibrium(z)
        model, geometry = self._dual_model(z)
        count = self._pressure.size
        length = found.length

        def excess(at: Any) -> Any:
            return model.force(self._pressure, at, self._velocity) - self._force

        by_number = self._slopes_of(root_with_slopes(length, excess), count)
        # The margin of `length_range` would make the slopes of equivalent numbers differ.
        shortest, longest = model.length_bounds
        longest = min(longest, self._stop(geometry))
        for bound, at_bound in ((longest, found.at_longest), (shortest, found.at_shortest)):
            by_number = np.where(at_bound[:, None], self._slopes_of(bound, count), by_number)
        if self.data.is_shortening:
            by_number = self._slopes_of(geometry.rest_length, count) - by_number
        return np.asarray(by_number[self._back])

    def _dual_model(self, z: Array) -> tuple[ForceModel, MuscleGeometry]:
        """The model at z built from dual numbers, one unknown for each free number."""
        values: dict[str, Any] = dict(self.values(z))
        for i, free in enumerate(self.free):
            seed = Dual.seed(values[free.name], i, len(self.free))
            values[free.name] = Dual(seed.value, seed.slope * free.scale)
        geometry = geometry_of(values)
        constants = {key: values[key] for key in self.declared}
        # The factory itself: the values were checked when the plain model was made.
        return registered_models()[self.name].factory(geometry, constants), geometry

    def _slopes_of(self, number: Any, points: int) -> Array:
        """Derivatives by the free numbers, one row per point; 0 for a plain number."""
        shape = (len(self.free), points)
        if not isinstance(number, Dual):
            return np.zeros(shape).T
        slope = number.slope[:-1]
        return np.broadcast_to(slope if slope.ndim > 1 else slope[:, None], shape).T

    def rough_residuals(self, z: Array) -> Array:
        """Approximate `residuals` in 1/100 of the time: one Newton step from the measured length.

        One value for each set of points that share a prediction, weighted by their number.
        """
        if self.residual == "force":
            return self.residuals(z)
        model, geometry, _ = self.model(z)
        shortest, longest = length_range(model, self._stop(geometry))
        sign = -1.0 if self.data.is_shortening else 1.0
        rest = geometry.rest_length if self.data.is_shortening else 0.0
        measured = rest + sign * self._mean_position
        length = np.clip(measured, shortest, longest)
        pull = np.asarray(model.force(self._pressure, length, self._velocity), dtype=float)
        slope = slope_at(model, self._pressure, length, self._velocity, (shortest, longest))
        span = max(float(np.ptp(self._mean_position)), 1e-6)
        excess = pull - self._force
        # Without a restoring stiffness the muscle would run to a bound.
        floor = np.maximum(slope, 1e-3 * np.abs(self._force) / span + 1e-12)
        reached = np.clip(length - excess / floor, shortest, longest)
        # A muscle that pulls too little even at its longest length stays there.
        hanging = np.asarray(
            model.force(self._pressure, np.full_like(length, longest), self._velocity)
        )
        reached = np.where(hanging < self._force, longest, reached)
        away = reached - measured
        return np.asarray(np.sqrt(self._count) * away / np.sqrt(1.0 + (away / span) ** 2 / 9.0))

    def inside(self, z: Array) -> Array:
        """The nearest z that lies within the bounds, with a small margin."""
        low, high = self.bounds()
        margin = 1e-9 * np.minimum(high - low, 1e6)
        return np.asarray(np.clip(z, low + margin, high - margin))

    def bounds(self) -> tuple[Any, Any]:
        """Lowest and highest z."""
        low = np.array([1.0 + (f.low - f.start) / f.scale for f in self.free])
        return low, np.array([1.0 + (f.high - f.start) / f.scale for f in self.free])

    def own_sizes(self, z: Array) -> Array:
        """Magnitude of every number at z, at least that of its start, in units of z."""
        zero = np.array([f.zero for f in self.free])
        return np.asarray(np.maximum(np.abs(z - zero), 1.0))
