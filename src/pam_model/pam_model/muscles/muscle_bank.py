"""Force and stiffness of all muscles of a rig in one call, for loops at a kilohertz.

Many models are quadratic in length and affine in pressure: F = P A(L) + B(L). Their coefficients
are determined once by interpolation, and checked at other lengths. One tick is then only
arithmetic: a Python function generated for the rig, without loops and look-ups, or a compiled
function over arrays if numba is installed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from pam_model.domain import ROUNDING
from pam_model.errors import DomainError
from pam_model.muscles.force_model import AffineForceModel, ForceModel

Array = npt.NDArray[np.float64]
_CHECKED_LENGTHS = 7
_TOLERANCE = 1e-11


def quadratic_coefficients(model: ForceModel) -> tuple[float, ...]:
    """(a0, a1, a2, b0, b1, b2) of A(L) = a0 + a1 L + a2 L^2 and B(L) likewise.

    Raises
    ------
    DomainError
        If the model is not affine in pressure or not quadratic in length.
    """
    if not isinstance(model, AffineForceModel):
        raise DomainError(f"model {model.name} is not affine in pressure")
    shortest, longest = model.length_bounds
    margin = 1e-3 * (longest - shortest)
    lengths = np.linspace(shortest + margin, longest - margin, _CHECKED_LENGTHS)
    scale = float(longest)
    found: list[float] = []
    for values in np.array([model.coefficients(float(length)) for length in lengths]).T:
        # Divided differences are exact for a quadratic; a least-squares fit would hide deviations.
        x, y = lengths[[0, 3, 6]] / scale, values[[0, 3, 6]]
        first = (y[1] - y[0]) / (x[1] - x[0])
        square = ((y[2] - y[1]) / (x[2] - x[1]) - first) / (x[2] - x[0])
        slope = first - square * (x[0] + x[1])
        start = y[0] - x[0] * (slope + square * x[0])
        away = np.abs(start + lengths / scale * (slope + square * lengths / scale) - values)
        size = float(np.max(np.abs(values)))
        if float(np.max(away)) > _TOLERANCE * size:
            raise DomainError(f"model {model.name} is not quadratic in length")
        small = 1e-13 * size
        found += [
            0.0 if abs(c) <= small else float(c) / scale**power
            for power, c in enumerate((start, slope, square))
        ]
    return tuple(found)


class CompiledTick(NamedTuple):
    """Fill `inputs` in place, call `run()` and read `outputs`; nothing is allocated.

    Attributes
    ----------
    run : callable
        Takes no arguments.
    inputs : array, shape (2, muscles)
        First row: gauge pressures [Pa]; second row: lengths [m].
    outputs : array, shape (2, muscles)
        First row: forces [N]; second row: stiffnesses [N/m].
    """

    run: Callable[[], None]
    inputs: Array
    outputs: Array


class MuscleBank:
    """A rig's muscles, all affine in pressure and quadratic in length.

    Parameters
    ----------
    models : sequence of ForceModel
        One per muscle, in the order that all arrays use.

    Raises
    ------
    DomainError
        For no models, or one that is not affine and quadratic (then use the models themselves);
        by the methods for a length outside a model's bounds or a wrong number of values.

    Attributes
    ----------
    evaluate : callable
        `evaluate(pressures, lengths)` takes sequences of floats, gauge [Pa] and [m], and returns
        (forces [N], stiffnesses [N/m]) as lists.
    """

    def __init__(self, models: Sequence[ForceModel]) -> None:
        if not models:
            raise DomainError("a bank needs at least one muscle")
        self.models = tuple(models)
        self.coefficients: Array = np.array([quadratic_coefficients(m) for m in models])
        self.bounds: Array = np.array([m.length_bounds for m in models])
        # A length may exceed the longest by rounding; the quadratic remains valid there.
        self.bounds[:, 1] *= 1.0 + ROUNDING
        self.evaluate: Callable[
            [Sequence[float], Sequence[float]], tuple[list[float], list[float]]
        ] = _written_out(self.coefficients, self.bounds)

    def __len__(self) -> int:
        return len(self.models)

    def compile(self) -> CompiledTick:
        """A compiled tick on one packed array, so that a call converts only one argument.

        A length outside a model's bounds gives NaN for that muscle: compiled code does not raise.

        Raises
        ------
        ImportError
            If numba is not installed.
        """
        from numba import njit  # noqa: PLC0415  (numba is optional)

        from pam_model.machine_code_cache import keep_machine_code  # noqa: PLC0415

        frame = np.zeros((12, len(self.models)))
        frame[:6], frame[6:8] = self.coefficients.T, self.bounds.T
        frame[8:] = math.nan
        tick = CompiledTick(
            partial(keep_machine_code(njit(_tick)), frame), frame[8:10], frame[10:12]
        )
        tick.run()
        return tick


def _written_out(coefficients: Array, bounds: Array) -> Callable[..., Any]:
    """Python source that contains a rig's numbers; it takes a third of the time of a loop."""
    count = len(coefficients)
    forces, slopes, checks = [], [], []
    for i, ((a0, a1, a2, b0, b1, b2), (low, high)) in enumerate(
        zip(coefficients.tolist(), bounds.tolist(), strict=True)
    ):
        passive, stiff = _polynomial(b0, b1, b2, i), _polynomial(b1, 2.0 * b2, 0.0, i)
        forces.append(f"p{i} * ({_polynomial(a0, a1, a2, i) or '0.0'})" + _added(passive))
        slopes.append(f"p{i} * ({_polynomial(a1, 2.0 * a2, 0.0, i) or '0.0'})" + _added(stiff))
        checks.append(f"{low!r} < l{i} <= {high!r}")
    source = (
        "def evaluate(pressures, lengths):\n"
        f"    try:\n        [{', '.join(f'p{i}' for i in range(count))}] = pressures\n"
        f"        [{', '.join(f'l{i}' for i in range(count))}] = lengths\n"
        "    except ValueError:\n"
        "        refuse(pressures, lengths)\n"
        f"    if not ({' and '.join(checks)}):\n"
        "        refuse(pressures, lengths)\n"
        f"    return [{', '.join(forces)}], [{', '.join(slopes)}]\n"
    )
    namespace: dict[str, Any] = {"inf": math.inf, "refuse": _refuser(bounds)}
    exec(compile(source, "<muscle bank>", "exec"), namespace)
    evaluate: Callable[..., Any] = namespace["evaluate"]
    return evaluate


def _polynomial(c0: float, c1: float, c2: float, muscle: int) -> str:
    terms = [repr(c0)] if c0 else []
    terms += [f"l{muscle} * {c1!r}"] if c1 else []
    terms += [f"l{muscle} * l{muscle} * {c2!r}"] if c2 else []
    return " + ".join(terms)


def _added(terms: str) -> str:
    return f" + {terms}" if terms else ""


def _refuser(bounds: Array) -> Callable[[Sequence[float], Sequence[float]], None]:
    def refuse(pressures: Sequence[float], lengths: Sequence[float]) -> None:
        for name, values in (("pressures", pressures), ("lengths", lengths)):
            if len(values) != len(bounds):
                raise DomainError(f"{len(values)} {name} given for {len(bounds)} muscles")
        for i, (length, (low, high)) in enumerate(zip(lengths, bounds, strict=True)):
            if not low < length <= high:
                raise DomainError(
                    f"muscle {i}: length {length:g} m is outside ({low:g}, {high:g}] m"
                )

    return refuse


def _tick(frame: Array) -> None:
    for i in range(frame.shape[1]):
        a0, a1, a2 = frame[0, i], frame[1, i], frame[2, i]
        b0, b1, b2 = frame[3, i], frame[4, i], frame[5, i]
        pressure, length = frame[8, i], frame[9, i]
        if not frame[6, i] < length <= frame[7, i]:
            length = math.nan
        passive = b0 + length * (b1 + length * b2)
        frame[10, i] = pressure * (a0 + length * (a1 + length * a2)) + passive
        frame[11, i] = pressure * (a1 + 2.0 * length * a2) + b1 + 2.0 * length * b2
