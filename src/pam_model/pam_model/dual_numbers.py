"""Dual numbers: a value together with its exact partial derivatives by several unknowns.

Forward-mode automatic differentiation: every operation applies the chain rule, so slopes are
exact to rounding and need no step width. A force model built from dual numbers as constants and
geometry gives a dual force; the model's code is the same as for plain floats, as long as it uses
`pam_model.muscles.elementary` (or numpy) instead of `math`. Where a model solves an equation, the
root is found in plain numbers and `root_with_slopes` adds its slopes by the implicit function
theorem. Operations that would silently lose the slopes (`float(x)`, `math.sqrt(x)`,
`np.asarray(x, float)`) raise TypeError.

Source: A. Griewank, A. Walther, "Evaluating Derivatives", 2nd edition, SIAM 2008, chapters 3 and
15 (implicit functions).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class Dual:
    """A value and its slopes (partial derivatives) by several unknowns.

    Parameters
    ----------
    value : float or array, shape S
        The value.
    slope : array, shape (unknowns, *S) or broadcastable to it
        Its partial derivatives. The last unknown is reserved for `root_with_slopes`.
    """

    __slots__ = ("slope", "value")

    def __init__(self, value: Any, slope: Array) -> None:
        self.value: Any = np.asarray(value, dtype=float)[()]
        self.slope = slope

    @classmethod
    def seed(cls, value: Any, unknown: int, unknowns: int) -> Dual:
        """The unknown number `unknown` of `unknowns`, without the one reserved for roots."""
        return cls(value, _unit(np.shape(value), unknown, unknowns + 1))

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        if method != "__call__" or options:
            return NotImplemented
        return self._apply(ufunc, *inputs)

    @staticmethod
    def _apply(ufunc: Any, *inputs: Any) -> Any:
        values = [value_of(one) for one in inputs]
        result = ufunc(*values)
        if ufunc in _WITHOUT_SLOPE:
            return result
        if ufunc not in _PARTIALS:
            return NotImplemented
        partials = _PARTIALS[ufunc](result, *values)
        slope: Any = 0.0
        for one, partial in zip(inputs, partials, strict=True):
            if isinstance(one, Dual):
                slope = slope + one._spread(np.ndim(result)) * partial
        return Dual(result, slope)

    def _spread(self, dimensions: int) -> Array:
        """The slope, reshaped to as many dimensions after the first as the result has."""
        missing = dimensions - (self.slope.ndim - 1)
        shape = self.slope.shape
        return self.slope.reshape(shape[0], *(1,) * missing, *shape[1:])

    def __add__(self, other: Any) -> Any:
        return self._apply(np.add, self, other)

    def __radd__(self, other: Any) -> Any:
        return self._apply(np.add, other, self)

    def __sub__(self, other: Any) -> Any:
        return self._apply(np.subtract, self, other)

    def __rsub__(self, other: Any) -> Any:
        return self._apply(np.subtract, other, self)

    def __mul__(self, other: Any) -> Any:
        return self._apply(np.multiply, self, other)

    def __rmul__(self, other: Any) -> Any:
        return self._apply(np.multiply, other, self)

    def __truediv__(self, other: Any) -> Any:
        return self._apply(np.true_divide, self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return self._apply(np.true_divide, other, self)

    def __pow__(self, exponent: float) -> Any:
        if isinstance(exponent, Dual):
            return NotImplemented
        return Dual(
            self.value**exponent,
            self._spread(np.ndim(self.value)) * (exponent * self.value ** (exponent - 1)),
        )

    def __neg__(self) -> Any:
        return self._apply(np.negative, self)

    def __abs__(self) -> Any:
        return self._apply(np.absolute, self)

    def __lt__(self, other: Any) -> Any:
        return self.value < value_of(other)

    def __le__(self, other: Any) -> Any:
        return self.value <= value_of(other)

    def __gt__(self, other: Any) -> Any:
        return self.value > value_of(other)

    def __ge__(self, other: Any) -> Any:
        return self.value >= value_of(other)

    def __eq__(self, other: object) -> Any:
        return self.value == value_of(other)

    def __ne__(self, other: object) -> Any:
        return self.value != value_of(other)

    __hash__ = None  # type: ignore[assignment]

    def __bool__(self) -> bool:
        return bool(self.value)

    def __float__(self) -> float:
        raise TypeError("a dual number cannot become a float: its slopes would be lost")

    def __format__(self, spec: str) -> str:
        return format(self.value, spec)

    def __repr__(self) -> str:
        return f"Dual({self.value!r}, {self.slope!r})"


def value_of(number: Any) -> Any:
    """The value of a dual number; any other argument unchanged."""
    return number.value if isinstance(number, Dual) else number


def is_dual(*numbers: Any) -> bool:
    """Whether any of these is a dual number."""
    return any(isinstance(number, Dual) for number in numbers)


def bracketed_root(function: Callable[[Any], Any], low: Any, high: Any) -> Any:
    """A root between two bounds at which the signs differ, with its slopes (Brent's method)."""
    from scipy.optimize import brentq  # noqa: PLC0415  (costs every node half a second)

    at = brentq(lambda x: value_of(function(x)), value_of(low), value_of(high), xtol=1e-15)
    return root_with_slopes(float(at), function)


def root_with_slopes(root: Any, equation: Callable[[Any], Any]) -> Any:
    """Add slopes to a root found in plain numbers, by the dual numbers in the equation.

    Implicit function theorem: where f(x, p) = 0, dx/dp = -(df/dp)/(df/dx).

    Parameters
    ----------
    root : float or array
        Solution of f(x) = 0.
    equation : callable
        f(x), written so that it takes dual numbers.
    """
    at_root = equation(root)
    if not isinstance(at_root, Dual):
        return root
    unknowns = at_root.slope.shape[0]
    moved = equation(Dual(root, _unit(np.shape(root), unknowns - 1, unknowns)))
    # A slope by the last unknown that is present before belongs to an enclosing root search.
    with np.errstate(divide="ignore", invalid="ignore"):
        by_root = moved.slope[-1] - at_root.slope[-1]
        return Dual(root, -at_root.slope / by_root)


def _unit(shape: tuple[int, ...], index: int, unknowns: int) -> Array:
    slope = np.zeros((unknowns, *shape))
    slope[index] = 1.0
    return slope


# For each function: its partial derivatives by the arguments, from its result and arguments.
_PARTIALS: dict[Any, Callable[..., tuple[Any, ...]]] = {
    np.add: lambda _, a, b: (1.0, 1.0),
    np.subtract: lambda _, a, b: (1.0, -1.0),
    np.multiply: lambda _, a, b: (b, a),
    np.true_divide: lambda y, a, b: (1.0 / b, -y / b),
    np.negative: lambda _, a: (-1.0,),
    np.absolute: lambda _, a: (np.sign(a),),
    np.square: lambda _, a: (2.0 * a,),
    np.sqrt: lambda y, a: (0.5 / y,),
    np.exp: lambda y, a: (y,),
    np.sin: lambda _, a: (np.cos(a),),
    np.cos: lambda _, a: (-np.sin(a),),
    np.tan: lambda y, a: (1.0 + y * y,),
    np.arcsin: lambda _, a: (1.0 / np.sqrt(1.0 - a * a),),
    np.arccos: lambda _, a: (-1.0 / np.sqrt(1.0 - a * a),),
    np.maximum: lambda _, a, b: (np.where(a >= b, 1.0, 0.0), np.where(a >= b, 0.0, 1.0)),
    np.minimum: lambda _, a, b: (np.where(a <= b, 1.0, 0.0), np.where(a <= b, 0.0, 1.0)),
}
_WITHOUT_SLOPE = frozenset(
    {np.sign, np.isfinite, np.greater, np.greater_equal, np.less, np.less_equal, np.equal}
)
