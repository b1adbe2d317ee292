"""Which numbers of a model a set of measurements can tell apart.

From the exact slopes of all predictions by all free numbers (`FitProblem.jacobian`) and the
measurement noise. Each column is the change of the predictions, in units of the noise, for a
change of one number by its own size. Numbers are taken one after the other, each time the one
whose change is largest beyond what those taken before can imitate, as in a QR decomposition with
column pivoting (G. H. Golub, C. F. Van Loan, "Matrix Computations", 4th edition, section 5.4).
A number is left out for one of two reasons, which are orders of magnitude apart:

- Dependence. What is left of its column is at most `DEPENDENT` of the whole. Slopes are exact to
  rounding, 1e-16 and after the solution of an equation inside a model some 1e-13; a number that
  acts only through others leaves that, one that acts in its own right leaves parts in a hundred.
  The limit lies midway between rounding and 1 on a logarithmic scale.
- Noise. What is left is below 1: the standard error of the number would be larger than the
  number itself, so that the data cannot tell it from 0 or from twice its value.

Sums are made without BLAS and equal candidates are taken in their declared order, so that the
answer does not depend on the processor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pam_model.identify.measurements import Array, Measurements

DEPENDENT = 1e-8
"""Share of a column that is left after others where it depends on them."""
_SILENT = 1e-12
"""A column this small beside the largest is rounding: normalised, it would point anywhere and
seem to imitate others."""
_EQUAL = 1e-6
"""Two candidates this close, relative, count as equal."""
_POINTS_PER_TERM = 3


@dataclass(frozen=True, slots=True)
class Told:
    """What the data tell.

    Attributes
    ----------
    told : tuple of int
        Columns of numbers that the data tell, in the order in which they were taken.
    silent : tuple of int
        Columns that are zero to rounding.
    lost : tuple of int
        Columns that are not, but whose whole effect is below the noise. What remains is not told
        because told numbers can imitate it.
    """

    told: tuple[int, ...]
    silent: tuple[int, ...]
    lost: tuple[int, ...]


def told_numbers(slopes: Array, noise: float, preference: Array) -> Told:
    """Choose the numbers that the data tell.

    Parameters
    ----------
    slopes : array, shape (points, numbers)
        Change of each prediction for a change of each number by its own size.
    noise : float
        Standard deviation of one measurement, in the same unit.
    preference : array, shape (numbers,)
        Weights: among numbers that do much the same, the larger weight is taken.
    """
    left = slopes.copy()
    whole = _norms(slopes)
    largest = float(np.max(whole, initial=0.0))
    silent = tuple(np.flatnonzero(whole <= _SILENT * largest).tolist())
    below = np.flatnonzero(whole <= noise).tolist()
    lost = tuple(i for i in below if i not in silent)
    candidates = [i for i in range(whole.size) if i not in silent and i not in lost]
    told: list[int] = []
    while True:
        size = _norms(left)
        candidates = [
            i for i in candidates if i not in told and size[i] > max(noise, DEPENDENT * whole[i])
        ]
        if not candidates:
            return Told(tuple(told), silent, lost)
        weights = {i: float(preference[i] * size[i]) for i in candidates}
        best = max(weights.values())
        chosen = next(i for i in candidates if weights[i] >= best * (1.0 - _EQUAL))
        told.append(chosen)
        direction = left[:, chosen] / size[chosen]
        for _ in range(2):  # once more takes away what rounding left
            shares = np.sum(direction[:, None] * left, axis=0)
            left = left - direction[:, None] * shares


def imitated(slopes: Array) -> npt.NDArray[np.bool_]:
    """For each number, whether all others together can do what it does, to `DEPENDENT`."""
    whole = _norms(slopes)
    unit = slopes / np.where(whole > 0.0, whole, 1.0)
    result = whole <= _SILENT * float(np.max(whole, initial=0.0))
    heard = np.flatnonzero(~result)
    for i in heard:
        others = unit[:, heard[heard != i]]
        fit = others @ np.linalg.lstsq(others, unit[:, i], rcond=_SILENT)[0]
        result[i] = bool(np.sqrt(np.sum((unit[:, i] - fit) ** 2)) <= DEPENDENT)
    return result


def measurement_noise(measured: Array, given: list[Array]) -> float:
    """Standard deviation of one measurement about what the given quantities determine.

    From repeats: points at which all given quantities are equal, where at least half of the
    points repeat another. Otherwise from what a polynomial of up to third degree in the given
    quantities leaves, which includes what the polynomial cannot follow.

    Parameters
    ----------
    measured : array, shape (points,)
        The quantity that a model predicts.
    given : list of array, shape (points,)
        What it predicts it from.
    """
    _, back = np.unique(np.stack(given), axis=1, return_inverse=True)
    back = np.ravel(back)
    number = np.bincount(back)
    repeats = measured.size - number.size
    if repeats >= 0.5 * measured.size:
        mean = np.bincount(back, measured) / number
        return float(np.sqrt(np.sum((measured - mean[back]) ** 2) / repeats))
    terms = _polynomial(given, measured.size // _POINTS_PER_TERM)
    residual = measured - terms @ np.linalg.lstsq(terms, measured, rcond=None)[0]
    free = measured.size - terms.shape[1]
    return float(np.sqrt(np.sum(residual**2) / max(free, 1)))


def noise_of(data: Measurements, residual: str) -> float:
    """The measurement noise of what a fit minimises, in N ("force") or m ("length")."""
    if residual == "force":
        return measurement_noise(data.force, [data.pressure, data.position, data.velocity])
    return measurement_noise(data.position, [data.pressure, data.force, data.velocity])


def _polynomial(given: list[Array], most: int) -> Array:
    """Products of powers of what varies, of the highest degree up to 3 that `most` terms allow."""
    varying = [(x - np.mean(x)) / np.max(np.abs(x - np.mean(x))) for x in given if np.ptp(x) > 0.0]
    ones = np.ones_like(given[0])
    terms: list[Array] = [ones]
    newest: list[tuple[int, Array]] = [(0, ones)]
    for _ in range(3):
        newest = [
            (i, term * varying[i]) for first, term in newest for i in range(first, len(varying))
        ]
        if not newest or len(terms) + len(newest) > max(most, 1):
            break
        terms += [term for _, term in newest]
    return np.stack(terms, axis=1)


def _norms(columns: Array) -> Array:
    return np.asarray(np.sqrt(np.sum(columns * columns, axis=0)))
