"""A force model on measured points as a function of its free numbers: what `fit` minimises."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy.linalg import qr
from scipy.optimize import least_squares

from pam_model.errors import DomainError, PamError
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
)

Residual = Literal["force", "length"]
RESIDUAL_UNITS: Mapping[Residual, str] = {"force": "N", "length": "m"}
GEOMETRY_UNITS: Mapping[str, str] = {
    "rest_length": "m",
    "braid_angle": "rad",
    "diameter": "m",
    "wall_thickness": "m",
}
_SCREENED = 256
_POLISHED = 6
_STEP = 1e-7
_NO_EFFECT = 1e-9
_DEPENDENT = 1e-5


@dataclass(frozen=True, slots=True)
class FreeNumber:
    """A number to fit: its start and scale make it 1 and of size 1 for the optimiser."""

    name: str
    start: float
    scale: float
    low: float
    high: float
    unit: str


def predicted_force(model: ForceModel, geometry: MuscleGeometry, data: Measurements) -> Array:
    """A model's force [N] at the pressures, positions and velocities of measured points."""
    length = geometry.rest_length - data.position if data.is_shortening else data.position
    return np.asarray(model.force(data.pressure, length, data.velocity), dtype=float)


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
    ) -> None:
        models = registered_models()
        if name not in models:
            raise PamError(f"unknown force model {name!r}; known: {', '.join(models)}")
        if residual not in RESIDUAL_UNITS:
            raise PamError(f"residual = {residual!r}, expected {' or '.join(RESIDUAL_UNITS)}")
        if geometry is None and not fit_geometry:
            raise PamError("without a geometry of the muscle the geometry has to be fitted")
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
        base = geometry or guess_geometry(data)
        self.fixed = {**_geometry_numbers(base), **constants}
        geometric = list(GEOMETRY_UNITS) if fit_geometry else []
        known = [*GEOMETRY_UNITS, *self.declared]
        chosen = (
            [*geometric, *(key for key in self.declared if key not in constants)]
            if free is None
            else list(free)
        )
        for key in chosen:
            if key not in known:
                raise PamError(f"model {name}: cannot fit {key!r}; it has {', '.join(known)}")
        if data.is_shortening and "rest_length" not in chosen and geometry is None:
            raise PamError(f"{data.name} has shortening only: rest_length has to be fitted")
        self.free = [self._describe(key) for key in chosen]
        for key, parameter in self.declared.items():
            self.fixed.setdefault(key, _start_of(parameter))
        self.active = np.ones(len(self.free), dtype=bool)
        # Points that differ only in the measured position share one prediction.
        table = np.stack([data.pressure, data.force, data.velocity])
        unique, back = np.unique(table, axis=1, return_inverse=True)
        self._back = np.ravel(back)
        self._pressure, self._force, self._velocity = unique
        self._count = np.bincount(self._back)
        self._mean_position = np.bincount(self._back, data.position) / self._count

    def _describe(self, key: str) -> FreeNumber:
        start = self.fixed.get(key)
        if key in GEOMETRY_UNITS:
            assert start is not None
            longest = float(np.max(self.data.position)) if not self.data.is_shortening else 0.0
            low, high, unit = {
                "rest_length": (0.2 * start, 5.0 * start, "m"),
                "braid_angle": (math.radians(3.0), math.radians(87.0), "rad"),
                "diameter": (1e-3, 0.3, "m"),
                "wall_thickness": (0.0, 0.02, "m"),
            }[key]
            if key == "rest_length":
                low = max(low, 0.5 * longest)
            return FreeNumber(key, start, max(abs(start), 1e-3), low, high, unit)
        parameter = self.declared[key]
        value = _start_of(parameter) if start is None else start
        reach = max(abs(parameter.low), abs(parameter.high))
        scale = abs(value) or (0.01 * reach if math.isfinite(reach) else 1.0)
        return FreeNumber(key, value, scale, parameter.low, parameter.high, parameter.unit)

    def values(self, z: Array) -> dict[str, float]:
        """All numbers by name; z = 1 is the start, one unit is one scale."""
        found = dict(self.fixed)
        for free, value in zip(self.free, z, strict=True):
            number = free.start + (float(value) - 1.0) * free.scale
            found[free.name] = min(max(number, free.low), free.high)
        return found

    def model(self, z: Array) -> tuple[ForceModel, MuscleGeometry, dict[str, float]]:
        """The model at z."""
        values = self.values(z)
        geometry = _geometry(values)
        constants = {key: values[key] for key in self.declared}
        return create_force_model(self.name, geometry, constants), geometry, constants

    def residuals(self, z: Array) -> Array:
        """Model less measured, of every point.

        Raises
        ------
        DomainError
            Where the model does not cover a point.
        """
        if self.residual == "force":
            model, geometry, _ = self.model(z)
            return predicted_force(model, geometry, self.data) - self.data.force
        found, geometry = self._equilibrium(z)
        return self._length_residuals(found.length, geometry.rest_length)

    def _equilibrium(self, z: Array) -> tuple[Equilibrium, MuscleGeometry]:
        model, geometry, _ = self.model(z)
        # No warm start: where several lengths balance, the answer must depend on z alone.
        stop = self._stop(geometry)
        found = solve_equilibrium(model, self._pressure, self._force, self._velocity, stop)
        return found, geometry

    def _stop(self, geometry: MuscleGeometry) -> float:
        return geometry.rest_length if self.data.is_shortening else math.inf

    def _length_residuals(self, length: Array, rest_length: float) -> Array:
        predicted = rest_length - length if self.data.is_shortening else length
        return np.asarray(predicted[self._back] - self.data.position, dtype=float)

    def jacobian(self, z: Array) -> Array:
        """Slope of every residual by every free number; 0 where it cannot be had.

        Raises
        ------
        DomainError
            Where the model does not cover a point at z.
        """
        predict = self.residuals if self.residual == "force" else self._length_nearby(z)
        here = predict(z)
        _, high = self._bounds()
        result = np.zeros((len(self.data), len(self.free)))
        for i in range(len(self.free)):
            step = _STEP * max(1.0, abs(float(z[i])))
            for signed in (step, -step) if z[i] + step < high[i] else (-step, step):
                moved = z.copy()
                moved[i] += signed
                try:
                    result[:, i] = (predict(moved) - here) / signed
                    break
                except DomainError:
                    continue
        return np.where(np.isfinite(result), result, 0.0)

    def _length_nearby(self, z: Array) -> Callable[[Array], Array]:
        """Residuals near z to first order: dL/dz = -(dF/dz)/(dF/dL), without solving again."""
        found, _ = self._equilibrium(z)
        here, geometry, _ = self.model(z)
        length = found.length
        force = np.asarray(here.force(self._pressure, length, self._velocity), dtype=float)
        shortest, longest = length_range(here, self._stop(geometry))
        slope = slope_at(here, self._pressure, length, self._velocity, (shortest, longest))

        def residuals(nearby: Array) -> Array:
            model, geometry, _ = self.model(nearby)
            pull = np.asarray(model.force(self._pressure, length, self._velocity), dtype=float)
            low, high = length_range(model, self._stop(geometry))
            with np.errstate(divide="ignore", invalid="ignore"):
                shifted = length - (pull - force) / slope
            shifted = np.where(found.at_longest, length + (high - longest), shifted)
            shifted = np.where(found.at_shortest, length + (low - shortest), shifted)
            return self._length_residuals(shifted, geometry.rest_length)

        return residuals

    def _rough_residuals(self, z: Array) -> Array:
        """What `residuals` is about, at a hundredth of its time: one Newton step from the measured.

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
        away = reached - measured
        return np.asarray(np.sqrt(self._count) * away / np.sqrt(1.0 + (away / span) ** 2 / 9.0))

    def hold_what_the_data_do_not_tell(self, seed: int) -> dict[str, str]:
        """Hold free numbers that change no prediction, or only as others can; name and reason.

        A model need not use all of the geometry; friction at one speed is one number, whatever
        its law. Told by the rank of the slopes at several starts.
        """
        if not self.free:
            return {}
        steepest: Array = np.zeros(len(self.free))
        best_rank, dependent = 0, list[int]()
        prefer = np.array([1.0 if f.low < 0.0 < f.high else 0.01 for f in self.free])
        for start in self.screened_starts(5, seed):
            try:
                slopes = self.jacobian(self.inside(start))
            except DomainError:
                continue
            sizes = np.sqrt(np.sum(slopes * slopes, axis=0))
            steepest = np.maximum(steepest, sizes)
            used = np.flatnonzero(sizes > _NO_EFFECT * max(float(np.max(sizes)), 1e-300))
            if not used.size:
                continue
            slopes = slopes[:, used] / sizes[used]
            diagonal = np.abs(np.diag(qr(slopes, mode="r", pivoting=True)[0]))
            rank = int(np.sum(diagonal > _DEPENDENT * diagonal[0]))
            # Among numbers that do the same, one of either sign is kept: it is not stopped at 0.
            _, order = qr(slopes * prefer[used], mode="r", pivoting=True)
            if rank > best_rank:
                best_rank, dependent = rank, [int(used[i]) for i in order[rank:]]
        if not best_rank:
            return {}
        silent = steepest <= _NO_EFFECT * float(np.max(steepest))
        reasons = {self.free[i].name: "held: no effect here" for i in np.flatnonzero(silent)}
        for i in dependent:
            reasons.setdefault(self.free[i].name, "held: the data tell it only with others")
        self.active = np.array([free.name not in reasons for free in self.free], dtype=bool)
        return reasons

    def inside(self, z: Array) -> Array:
        """The nearest z that lies within the bounds by a little."""
        low, high = self._bounds()
        margin = 1e-9 * np.minimum(high - low, 1e6)
        return np.asarray(np.clip(z, low + margin, high - margin))

    def _bounds(self) -> tuple[Any, Any]:
        low = np.array([1.0 + (f.low - f.start) / f.scale for f in self.free])
        return low, np.array([1.0 + (f.high - f.start) / f.scale for f in self.free])

    def screened_starts(self, number: int, seed: int) -> list[Array]:
        """The given start, and the best of many random ones around it, roughly polished."""
        size = len(self.free)
        if number < 2 or not np.any(self.active):
            return [np.ones(size)]
        random = np.random.default_rng(seed)
        low, _ = self._bounds()
        # Where a number may be negative or 0, 0 is at z = 1 - start/scale.
        zero = np.array([1.0 - f.start / f.scale for f in self.free])
        tried: list[tuple[float, Array]] = []
        for i in range(_SCREENED):
            # Half of them far away: a default may be of the wrong order for this muscle.
            spread = 0.7 if i % 2 else 2.0
            sign = np.where((low < zero) & (random.random(size) < 0.3), -1.0, 1.0)
            z = zero + (1.0 - zero) * sign * np.exp(random.normal(0.0, spread, size))
            z = np.where(self.active, z, 1.0)
            z = self.inside(z)
            cost = self._rough_cost(z)
            if math.isfinite(cost):
                tried.append((cost, z))
        tried.sort(key=lambda pair: pair[0])
        polished = [self._polished(z) for _, z in tried[: max(_POLISHED, number)]]
        polished.sort(key=lambda pair: pair[0])
        return [np.ones(size), *(z for _, z in polished[: number - 1])]

    def _rough_cost(self, z: Array) -> float:
        try:
            residuals = self._rough_residuals(z)
        except DomainError:
            return math.inf
        return float(residuals @ residuals)

    def _polished(self, start: Array) -> tuple[float, Array]:
        if self.residual == "force":
            return self._rough_cost(start), start
        at = self._minimum(start, self._rough_residuals, None, 1e-3, 30)
        return self._rough_cost(at), at

    def solve(self, mask: Any, starts: list[Array], most: int = 100) -> Array:
        """The best z on the points of a mask, in at most so many steps from each start.

        Raises
        ------
        DomainError
            If the model covers no start.
        """
        if not np.any(self.active):
            return np.ones(len(self.free))

        def residuals(z: Array) -> Array:
            return np.asarray(self.residuals(z)[mask])

        def jacobian(z: Array) -> Array:
            return np.asarray(self.jacobian(z)[mask])

        best: tuple[float, Array] | None = None
        refused: DomainError | None = None
        for start in starts:
            inside = self.inside(start)
            try:
                first = residuals(inside)
            except DomainError as error:
                refused = error
                continue
            if not np.any(np.isfinite(first)):
                continue
            at = self._minimum(inside, residuals, jacobian, 1e-6, most)
            reached = residuals(at)
            cost = float(reached @ reached)
            if best is None or cost < best[0]:
                best = cost, at
        if best is None:
            raise refused or DomainError(f"model {self.name} fits no point")
        return best[1]

    def _minimum(
        self,
        start: Array,
        residuals: Callable[[Array], Array],
        jacobian: Callable[[Array], Array] | None,
        tolerance: float,
        most: int,
    ) -> Array:
        """Least squares over the active numbers; a point the model does not cover costs a lot."""
        measured = self.data.force if self.residual == "force" else self.data.position
        penalty = 10.0 * (float(np.ptp(measured)) + float(np.max(np.abs(measured))))
        size = residuals(self.inside(start)).size
        active = self.active

        def whole(part: Any) -> Array:
            z = start.copy()
            z[active] = part
            return z

        def cost(part: Any) -> Any:
            try:
                values = residuals(whole(part))
            except DomainError:
                return np.full(size, penalty)
            return np.where(np.isfinite(values), values, penalty)

        def slopes(part: Any) -> Any:
            assert jacobian is not None
            return jacobian(whole(part))[:, active]

        low, high = self._bounds()
        bounds: Any = low[active], high[active]
        how: Any = "2-point" if jacobian is None else slopes
        found = least_squares(
            cost,
            self.inside(start)[active],
            jac=how,
            bounds=bounds,
            diff_step=np.full(int(np.sum(active)), _STEP),
            x_scale="jac",
            ftol=tolerance,
            xtol=tolerance,
            max_nfev=most,
        )
        return whole(found.x)


def guess_geometry(data: Measurements) -> MuscleGeometry:
    """A contractor of plausible size to start from: 20 deg at rest, its stroke a quarter."""
    if data.is_shortening:
        rest = max(float(np.max(data.position)), 1e-3) / 0.25
    else:
        rest = float(np.max(data.position))
    return _geometry(
        {
            "rest_length": rest,
            "braid_angle": math.radians(20.0),
            "diameter": 0.02,
            "wall_thickness": 1e-3,
        }
    )


def _geometry(values: Mapping[str, float]) -> MuscleGeometry:
    thread = values["rest_length"] / math.cos(values["braid_angle"])
    turns = thread * math.sin(values["braid_angle"]) / (math.pi * values["diameter"])
    return MuscleGeometry(thread, turns, values["rest_length"], values["wall_thickness"])


def _geometry_numbers(geometry: MuscleGeometry) -> dict[str, float]:
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


def _start_of(parameter: ModelParameter) -> float:
    if parameter.default is not None:
        return parameter.default
    if parameter.low > 0.0:
        return math.sqrt(parameter.low * parameter.high)
    return 0.5 * (parameter.low + parameter.high)
