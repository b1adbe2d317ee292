"""The static force of a muscle, with the effects that its rig file names.

Effects on the contraction ratio, passive pulls, stretching threads and a compliant cable are
functions of pressure and length, so that estimator and controller can take them into account. The
dynamic effects hysteresis and creep are not included. The laws are in the files of the effects
(`pam_model.effects`). These models take scalars only: joints use them, fits do not.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar

from pam_model.effects.end_caps import length_inside_caps
from pam_model.effects.slots import Law2, Law3, PassivePull, Thread
from pam_model.muscles.closed_chamber import ClosedChamber
from pam_model.muscles.force_model import (
    AffineForceModel,
    ForceModel,
    ModelParameter,
    MuscleGeometry,
)
from pam_model.robot.robot import AppliedLaw

_ROUNDS = 50
_LENGTH_TOLERANCE = 1e-11
_PRESSURE_STEP = 1.0


def static_force_model(
    nominal: ForceModel,
    geometry: MuscleGeometry,
    factor: float,
    threshold: float,
    compliance: float,
    laws: Sequence[AppliedLaw],
) -> ForceModel:
    """The force model of a muscle with the static effects that its rig file names.

    Parameters
    ----------
    nominal : ForceModel
        Of the ideal muscle.
    geometry : MuscleGeometry
        Of the ideal muscle.
    factor : float
        On the contraction ratio [-].
    threshold : float
        Pressure that does not pull [Pa].
    compliance : float
        Of the cable between muscle and joint [m/N].
    laws : sequence of AppliedLaw
        The laws of the muscle; those that fill no static slot have no influence here.

    Returns
    -------
    ForceModel
        Affine in pressure if the nominal model is affine and neither threads nor cable stretch; the
        nominal model itself if no effect changes it.
    """
    model = nominal
    pulls = tuple((slot.law, values) for _, slot, values in laws if isinstance(slot, PassivePull))
    if factor != 1.0 or threshold != 0.0 or pulls:
        kind = _AffineEnds if isinstance(model, AffineForceModel) else _Ends
        model = kind(model, geometry.rest_length, factor, threshold, pulls)
    for _, slot, values in laws:
        if isinstance(slot, Thread):
            model = _ExtensibleBraid(model, geometry, slot.law, values)
    if compliance != 0.0:
        model = _SeriesCable(model, compliance)
    return model


def gas_volume(model: ForceModel, pressure: float, length: float) -> tuple[float, float, float]:
    """Gas volume of a muscle whose threads or cable may stretch, without the rig's dead volume.

    Parameters
    ----------
    model : ForceModel
        From `static_force_model`.
    pressure : float
        Gauge [Pa].
    length : float
        Of the muscle with its cable [m].

    Returns
    -------
    volume : float
        [m^3].
    by_length : float
        dV/dL at constant pressure [m^2].
    by_pressure : float
        dV/dp at constant length [m^3/Pa]; 0 if nothing stretches.
    """
    if isinstance(model, _Wrapper):
        return model.gas_volume(pressure, length)
    return float(model.volume(length)), float(model.volume_slope(length)), 0.0


def _force_per_pressure(model: ForceModel, pressure: float, length: float) -> float:
    """dF/dP by finite differences [m^2]."""
    step = max(_PRESSURE_STEP, 1e-6 * abs(pressure))
    rise = model.force(pressure + step, length) - model.force(pressure - step, length)
    return float(rise) / (2.0 * step)


class _Wrapper(ClosedChamber):
    """A model based on another one; by default, finite differences give the pressure slope."""

    name: ClassVar[str] = "effective"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {}

    def __init__(self, inner: ForceModel) -> None:
        self.inner = inner

    @property
    def length_bounds(self) -> tuple[float, float]:
        return self.inner.length_bounds

    @abstractmethod
    def force(self, pressure: float, length: float, velocity: float = 0.0) -> float: ...

    @abstractmethod
    def stiffness(self, pressure: float, length: float) -> float: ...

    def pressure_slope(self, pressure: float, length: float) -> float:
        """dF/dP [m^2]."""
        return _force_per_pressure(self, pressure, length)

    def volume(self, length: float) -> float:
        return float(self.inner.volume(length))

    def volume_slope(self, length: float) -> float:
        return float(self.inner.volume_slope(length))

    def gas_volume(self, pressure: float, length: float) -> tuple[float, float, float]:
        """As `gas_volume` of this module."""
        return gas_volume(self.inner, pressure, length)


class _Ends(_Wrapper):
    """The nominal force at a multiple of the contraction and less pressure, plus passive pulls."""

    def __init__(
        self,
        inner: ForceModel,
        rest_length: float,
        factor: float,
        threshold: float,
        pulls: tuple[tuple[Law2, tuple[float, ...]], ...],
    ) -> None:
        super().__init__(inner)
        self._rest = rest_length
        self._factor, self._threshold, self._pulls = factor, threshold, pulls

    @property
    def length_bounds(self) -> tuple[float, float]:
        low, high = self.inner.length_bounds
        return (
            max(low, self._rest + (low - self._rest) / self._factor),
            min(high, self._rest + (high - self._rest) / self._factor),
        )

    def _inside(self, length: float) -> float:
        return length_inside_caps(length, self._rest, self._factor)

    def _pulling(self, pressure: float) -> float:
        """The part of the pressure that pulls [Pa]; models that are not affine end at 0."""
        return max(pressure - self._threshold, 0.0) if self._threshold > 0.0 else pressure

    def _passive(self, length: float) -> tuple[float, float]:
        """Passive pull [N] and its slope [N/m]."""
        pull = slope = 0.0
        for law, values in self._pulls:
            own = law(length, self._rest, *values)
            pull, slope = pull + own[0], slope + own[1]
        return pull, slope

    def force(self, pressure: float, length: float, velocity: float = 0.0) -> float:
        pulling = self._pulling(pressure)
        braid = self.inner.force(pulling, self._inside(length), self._factor * velocity)
        return float(braid) + self._passive(length)[0]

    def stiffness(self, pressure: float, length: float) -> float:
        pulling = self._pulling(pressure)
        braid = self._factor * float(self.inner.stiffness(pulling, self._inside(length)))
        return braid + self._passive(length)[1]


class _AffineEnds(_Ends):
    """The same for a model that is affine in pressure; the result is affine as well."""

    inner: AffineForceModel

    def _pulling(self, pressure: float) -> float:
        return pressure - self._threshold

    def coefficients(self, length: float) -> tuple[float, float]:
        scale, passive = self.inner.coefficients(self._inside(length))
        pull = float(passive) - self._threshold * float(scale)
        return float(scale), pull + self._passive(length)[0]

    def coefficient_slopes(self, length: float) -> tuple[float, float]:
        scale, passive = self.inner.coefficient_slopes(self._inside(length))
        rate = self._factor * (float(passive) - self._threshold * float(scale))
        return self._factor * float(scale), rate + self._passive(length)[1]

    def pressure_slope(self, pressure: float, length: float) -> float:
        return self.coefficients(length)[0]


class _ExtensibleBraid(_Wrapper):
    """Threads that stretch to a length b: adds the cylinder's force at b minus that at b_0."""

    def __init__(
        self, inner: ForceModel, geometry: MuscleGeometry, law: Law3, values: tuple[float, ...]
    ) -> None:
        super().__init__(inner)
        self._thread = geometry.thread_length
        self._scale = 1.0 / (4.0 * math.pi * geometry.turns**2)
        self._law, self._values = law, values

    def force(self, pressure: float, length: float, velocity: float = 0.0) -> float:
        stretched = self._law(pressure, length, self._thread, *self._values)[0]
        longer = stretched * stretched - self._thread * self._thread
        return float(self.inner.force(pressure, length, velocity)) - pressure * longer * self._scale

    def stiffness(self, pressure: float, length: float) -> float:
        stretched, _, by_length = self._law(pressure, length, self._thread, *self._values)
        rate = 2.0 * stretched * by_length
        return float(self.inner.stiffness(pressure, length)) - pressure * rate * self._scale

    def gas_volume(self, pressure: float, length: float) -> tuple[float, float, float]:
        volume, by_length, _ = super().gas_volume(pressure, length)
        stretched, by_pressure, rate = self._law(pressure, length, self._thread, *self._values)
        longer = stretched * stretched - self._thread * self._thread
        return (
            volume + length * longer * self._scale,
            by_length + (longer + 2.0 * length * stretched * rate) * self._scale,
            2.0 * length * stretched * by_pressure * self._scale,
        )


class _SeriesCable(_Wrapper):
    """A muscle in series with a spring: its length is the path minus compliance times force."""

    def __init__(self, inner: ForceModel, compliance: float) -> None:
        super().__init__(inner)
        self._compliance = compliance
        self._solved = (math.nan, math.nan, math.nan)

    def _stretched(self, pressure: float, length: float) -> float:
        """Length of the muscle [m] by Newton steps within [shortest, path]."""
        # force and stiffness are called one after the other for the same state
        solved = self._solved
        if solved[0] == pressure and solved[1] == length:
            return solved[2]
        low, high = self.inner.length_bounds[0], length
        muscle = length
        for _ in range(_ROUNDS):
            force = float(self.inner.force(pressure, muscle))
            miss = muscle + self._compliance * max(0.0, force) - length
            if abs(miss) < _LENGTH_TOLERANCE:
                break
            if miss > 0.0:
                high = muscle
            else:
                low = muscle
            rate = float(self.inner.stiffness(pressure, muscle)) if force > 0.0 else 0.0
            step = muscle - miss / max(1e-3, 1.0 + self._compliance * rate)
            muscle = step if low < step < high else 0.5 * (low + high)
        self._solved = pressure, length, muscle
        return muscle

    def force(self, pressure: float, length: float, velocity: float = 0.0) -> float:
        return float(self.inner.force(pressure, self._stretched(pressure, length), velocity))

    def stiffness(self, pressure: float, length: float) -> float:
        muscle = self._stretched(pressure, length)
        rate = float(self.inner.stiffness(pressure, muscle))
        if muscle >= length:
            # slack: the cable has no influence
            return rate
        return rate / max(1e-3, 1.0 + self._compliance * rate)

    def gas_volume(self, pressure: float, length: float) -> tuple[float, float, float]:
        muscle = self._stretched(pressure, length)
        volume, by_length, by_pressure = super().gas_volume(pressure, muscle)
        if muscle >= length:
            return volume, by_length, by_pressure
        # the muscle shortens by what the cable stretches
        softer = max(1e-3, 1.0 + self._compliance * float(self.inner.stiffness(pressure, muscle)))
        shortened = self._compliance * _force_per_pressure(self.inner, pressure, muscle) / softer
        return volume, by_length / softer, by_pressure - by_length * shortened
