"""Normal equations of one fit, brought up to date column by column.

A Gauss-Newton step changes few columns of the Jacobian: most are reused from an earlier point. The
products of the columns with each other are therefore kept for each channel, and only those of the
new columns are computed. Columns that never change are shared by all fits that have them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def _compact(columns: npt.NDArray[np.floating[Any]]) -> Array:
    """The columns of one channel in double precision; zeros alone take no memory."""
    if not columns.any():
        return np.broadcast_to(0.0, columns.shape)
    return np.ascontiguousarray(columns, dtype=np.float64)


class KnownColumns:
    """Columns of a Jacobian that do not change, and their products, for any number of fits.

    Parameters
    ----------
    columns : ndarray, shape (blocks, channels, m)
        The columns; entries that are not finite count as 0.
    source : ndarray, optional
        An array that they were made from, which is kept as long as they are.
    """

    def __init__(
        self,
        columns: npt.NDArray[np.floating[Any]],
        source: npt.NDArray[np.floating[Any]] | None = None,
    ) -> None:
        self.source = source
        if not np.isfinite(columns.sum()):
            columns = np.where(np.isfinite(columns), columns, 0.0)
        self.columns = [_compact(columns[:, channel]) for channel in range(columns.shape[1])]
        self.count = columns.shape[-1]
        self._products: dict[bytes, Array] = {}

    def products(self, used: npt.NDArray[np.bool_]) -> Array:
        """Products of the columns for each channel, shape (channels, m, m).

        Parameters
        ----------
        used : ndarray of bool, shape (blocks, channels)
            Entries that are not left out.
        """
        key = used.tobytes()
        if key not in self._products:
            found = []
            for columns, own in zip(self.columns, used.T, strict=True):
                chosen = columns if own.all() else columns[own]
                found.append(chosen.T @ chosen)
            self._products[key] = np.stack(found)
        return self._products[key]


class RunningEquations:
    """J'WJ and J'We with one weight per channel, over rows that do not change.

    Parameters
    ----------
    n : int
        Number of parameters.
    errors : ndarray, shape (blocks, channels)
        Errors at the starting point; an entry that is not finite there is left out throughout, and
        a channel without a finite one takes neither memory nor time.
    rows : ndarray of bool, shape (blocks,)
        Blocks that are fitted.
    known : KnownColumns
        The first columns of the Jacobian.
    """

    def __init__(
        self, n: int, errors: Array, rows: npt.NDArray[np.bool_], known: KnownColumns
    ) -> None:
        blocks, channels = errors.shape
        measured = np.isfinite(errors)
        chosen = rows[:, None] & measured
        first = known.count
        self._known = known
        self._channels = np.flatnonzero(measured.any(axis=0))
        self._own: Array = np.zeros((self._channels.size, blocks, n - first))
        self._used: Array = chosen.astype(np.float64)
        self._products: Array = np.zeros((channels, n, n))
        self._products[:, :first, :first] = known.products(chosen)

    @property
    def own_columns(self) -> npt.NDArray[np.float32]:
        """The columns after the known ones, shape (blocks, channels, n - m); 0 if not finite."""
        result = np.zeros((*self._used.shape, self._own.shape[-1]), dtype=np.float32)
        result[:, self._channels] = np.moveaxis(self._own, 0, 1)
        return result

    def put(self, columns: npt.NDArray[np.intp], values: npt.NDArray[np.floating[Any]]) -> None:
        """Replace columns of the Jacobian after the known ones, in rising order.

        Parameters
        ----------
        columns : ndarray of int, shape (k,)
            Their places in the Jacobian.
        values : ndarray, shape (blocks, channels, k)
            What they are replaced by.
        """
        if not columns.size:
            return
        if not np.isfinite(values.sum()):
            values = np.where(np.isfinite(values), values, 0.0)
        # neighbours are taken as a view, which numpy copies much faster than single columns
        first, last = int(columns[0]), int(columns[-1])
        is_slice = last - first + 1 == columns.size
        at = slice(first, last + 1) if is_slice else columns
        m = self._known.count
        inside = slice(first - m, last + 1 - m) if is_slice else columns - m
        for channel, own in zip(self._channels, self._own, strict=True):
            products = self._products[channel]
            own[:, inside] = values[:, channel]
            used = own[:, inside] * self._used[:, channel, None]
            products[:m, at] = self._known.columns[channel].T @ used
            products[m:, at] = own.T @ used
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
        slope, m = np.zeros(len(hessian)), self._known.count
        for channel, own in zip(self._channels, self._own, strict=True):
            present = np.where(np.isfinite(errors[:, channel]), errors[:, channel], 0.0)
            weighted = present * self._used[:, channel] * weights[channel]
            slope[:m] += weighted @ self._known.columns[channel]
            slope[m:] += weighted @ own
        return hessian, slope
