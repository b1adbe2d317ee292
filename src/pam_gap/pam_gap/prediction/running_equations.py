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
    """

    def __init__(self, n: int, errors: Array, rows: npt.NDArray[np.bool_]) -> None:
        blocks, channels = errors.shape
        self._columns: Array = np.zeros((channels, blocks, n))
        self._used: Array = (rows[:, None] & np.isfinite(errors)).astype(np.float64)
        self._products: Array = np.zeros((channels, n, n))

    @property
    def jacobian(self) -> Array:
        """The present columns, shape (blocks, channels, n); 0 where they are not finite."""
        return np.moveaxis(self._columns, 0, 1)

    def put(self, columns: npt.NDArray[np.intp], values: npt.NDArray[np.floating[Any]]) -> None:
        """Replace columns of the Jacobian by `values`, shape (blocks, channels, len(columns))."""
        if not columns.size:
            return
        if not np.isfinite(values.sum()):
            values = np.where(np.isfinite(values), values, 0.0)
        # neighbours are taken as a view, which numpy copies much faster than single columns
        first, last = int(columns[0]), int(columns[-1])
        is_slice = last - first + 1 == columns.size and (np.diff(columns) == 1).all()
        at = slice(first, last + 1) if is_slice else columns
        for channel, (own, products) in enumerate(zip(self._columns, self._products, strict=True)):
            own[:, at] = values[:, channel]
            used = own[:, at] * self._used[:, channel, None]
            products[:, at] = own.T @ used
            products[at] = products[:, at].T

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
        weighted = np.ascontiguousarray((known * self._used * weights).T).ravel()
        slope: Array = weighted @ self._columns.reshape(weighted.size, -1)
        return hessian, slope
