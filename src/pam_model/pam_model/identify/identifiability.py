"""Identifiability: which numbers of a model a set of measurements determines.

The decision uses the exact derivatives of all predictions by all free numbers
(`FitProblem.jacobian`) and the measurement noise. Each column is the change of the predictions for
a change of one number by its own magnitude. Numbers are selected one after the other: each time,
the number whose column has the largest component orthogonal to the columns selected before, as in
a QR decomposition with column pivoting (G. H. Golub, C. F. Van Loan, "Matrix Computations", 4th
edition, section 5.4). A number is not selected for one of two reasons, which are orders of
magnitude apart:

- Dependence. The orthogonal component is at most `DEPENDENT` of the column. Derivatives are exact
  to rounding: 1e-16, or about 1e-13 if the model solves an equation. A dependent number leaves a
  component of that size; an independent number leaves a few hundredths. The limit lies midway
  between rounding and 1 on a logarithmic scale.
- Noise. The orthogonal component is below the noise: the standard error of the number would be
  larger than the number itself, so that the data cannot distinguish it from 0 or from twice its
  value.

Sums are computed without BLAS, and equal candidates are taken in their declared order, so that the
result does not depend on the processor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pam_model.identify.measurements import Array, Measurements

DEPENDENT = 1e-8
"""A column counts as dependent if at most this share of it is orthogonal to the other columns."""
_SILENT = 1e-12
"""A column this small relative to the largest is rounding error: normalised, it would have an
arbitrary direction and could seem to imitate others."""
_EQUAL = 1e-6
"""Two candidates count as equal if their relative difference is at most this."""
_POINTS_PER_TERM = 3


@dataclass(frozen=True, slots=True)
class Told:
    """Which numbers the data determine."""

    # columns of the identifiable numbers, in the order in which they were selected
    told: tuple[int, ...]
    silent: tuple[int, ...]  # columns that are zero to rounding
    # Columns that are not zero, but whose whole effect is below the noise. All columns in none of
    # the three tuples can be imitated by the identifiable numbers.
    lost: tuple[int, ...]


def told_numbers(slopes: Array, noise: float, preference: Array) -> Told:
    """Select the numbers that are identifiable from the data.

    Parameters
    ----------
    slopes : array, shape (points, numbers)
        Change of each prediction for a change of each number by its own magnitude.
    noise : float
        Standard deviation of one measurement, in the same unit.
    preference : array, shape (numbers,)
        Weights: of numbers with similar effects, the one with the larger weight is selected.
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
        for _ in range(2):  # the second pass removes the rounding error of the first
            shares = np.sum(direction[:, None] * left, axis=0)
            left = left - direction[:, None] * shares


def imitated(slopes: Array) -> npt.NDArray[np.bool_]:
    """For each number, whether the others together can imitate its effect, to `DEPENDENT`."""
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
    """Standard deviation of one measurement at fixed values of the given quantities.

    If at least half of the points repeat another point (all given quantities are equal), the
    repeats determine it. Otherwise it is estimated from the residuals of a polynomial of up to
    third degree in the given quantities, which include the polynomial's own misfit.

    Parameters
    ----------
    measured : array, shape (points,)
        The quantity that a model predicts.
    given : list of array, shape (points,)
        The quantities from which the model predicts it.
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
    """The measurement noise of the fitted quantity, in N ("force") or m ("length")."""
    if residual == "force":
        return measurement_noise(data.force, [data.pressure, data.position, data.velocity])
    return measurement_noise(data.position, [data.pressure, data.force, data.velocity])


def _polynomial(given: list[Array], most: int) -> Array:
    """Products of powers of the varying quantities, up to degree 3, with at most `most` terms."""
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
