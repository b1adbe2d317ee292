"""Smoothing and derivatives of samples by local polynomials.

In a window about each sample, a polynomial is fitted by least squares; its value or derivative at
the sample is the result. Near the ends, the window stays where it is and the polynomial is
evaluated beside its middle. scipy.signal has the same filter, but its import takes half a second.

Source: A. Savitzky, M. J. E. Golay, "Smoothing and differentiation of data by simplified least
squares procedures", Analytical Chemistry 36 (1964) 1627-1639.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def local_polynomial(
    values: Array, width: int, order: int, *, derivative: int = 0, step: float = 1.0
) -> Array:
    """Values or derivatives of local polynomials at every sample, shape (n, k).

    Parameters
    ----------
    values : (n, k) array
        k signals with equally spaced samples.
    width : int
        Samples in a window, odd and at most n.
    order : int
        Of the polynomials, below `width`.
    derivative : int
        0 for the value.
    step : float
        Distance of two samples, in the unit of the derivative.

    Raises
    ------
    ValueError
        If there are fewer samples than a window has.
    """
    if len(values) < width:
        raise ValueError(f"{len(values)} samples are fewer than the window of {width}")
    half = width // 2
    places = np.arange(width) - half
    fit = np.linalg.pinv(np.vander(places, order + 1, increasing=True).astype(float))
    # the derivative of each power at each place of the window
    powers = np.arange(order + 1)
    lower = np.maximum(powers - derivative, 0)
    factors = np.array([math.perm(power, derivative) for power in powers.tolist()], dtype=float)
    weights = (factors * places[:, None].astype(float) ** lower) @ fit / step**derivative
    result: Array = np.empty(values.shape)
    for column in range(values.shape[1]):
        signal = values[:, column]
        result[half : len(signal) - half, column] = np.convolve(
            signal, weights[half, ::-1], "valid"
        )
    result[:half] = weights[:half] @ values[:width]
    result[len(values) - half :] = weights[half + 1 :] @ values[-width:]
    return result
