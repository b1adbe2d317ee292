"""Normal equations of one fit, brought up to date column by column.

A Gauss-Newton step changes few columns of the Jacobian: most are reused from an earlier point. The
products of the columns with each other are therefore kept for each channel, and only those of the
new columns are computed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class RunningEquations:
    """J'WJ and J'We with one weight per channel, over rows that do not change.

    Parameters
    ----------
    n : int
        Number of parameters.
    errors : ndarray, shape (blocks, channels)
        Errors at the starting point; an entry that is not finite there is left out throughout.
    rows : ndarray of bool, shape (blocks,)
        Blocks that are fitted.

    Attributes
    ----------
    jacobian : ndarray, shape (blocks, channels, n)
        The present columns. Entries that are not finite have been replaced by 0.
    """

    def __init__(self, n: int, errors: Array, rows: npt.NDArray[np.bool_]) -> None:
        self.jacobian: Array = np.zeros((*errors.shape, n))
        self._used = (rows[:, None] & np.isfinite(errors)).astype(np.float64)
        self._products: Array = np.zeros((errors.shape[1], n, n))

    def put(self, columns: npt.NDArray[np.intp], values: npt.NDArray[np.floating[Any]]) -> None:
        """Replace columns of the Jacobian by `values`, shape (blocks, channels, len(columns))."""
        if not columns.size:
            return
        if not np.isfinite(values.sum()):
            values = np.where(np.isfinite(values), values, 0.0)
        self.jacobian[..., columns] = values
        for channel, products in enumerate(self._products):
            used = values[:, channel] * self._used[:, channel, None]
            beside = self.jacobian[:, channel].T @ used
            products[:, columns] = beside
            products[columns] = beside.T

    def equations(self, errors: Array, weights: Array) -> tuple[Array, Array]:
        """J'WJ and J'We at the present point.

        Parameters
        ----------
        errors : ndarray, shape (blocks, channels)
            Errors at the present point.
        weights : ndarray, shape (channels,)
            One weight for each channel.
        """
        hessian: Array = np.tensordot(weights, self._products, axes=1)
        known = np.where(np.isfinite(errors), errors, 0.0)
        weighted = (known * self._used * weights).ravel()
        slope: Array = weighted @ self.jacobian.reshape(weighted.size, -1)
        return hessian, slope
