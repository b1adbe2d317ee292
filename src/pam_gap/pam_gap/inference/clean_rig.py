"""Finds out whether two causes, without any ordinary background, explain a recording.

With an ordinary background, one cause often explains a recording in which two are hidden: fitted
amounts of the background imitate the second cause, and a search for one cause ends there. On a rig
that is exactly its rig file apart from two causes, however, both together explain everything down
to the noise of the sensors, which no pair does on a rig with a background.

All pairs are compared by the slopes of fits that exist already, in least squares without a
simulation. Only the few pairs that could leave as little as a clean rig are simulated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pam_gap.inference.hypothesis import FitTask, Hypothesis, HypothesisFitter
from pam_gap.prediction.fit import Array, Scaling, Slopes

ROUNDS = 3
"""Times that the channels are weighed by what the solution before left in them."""


@dataclass(frozen=True, slots=True)
class _Pair:
    """Two effects that together could explain a recording, and where their fit starts."""

    first: Hypothesis
    second: Hypothesis
    mean_square: Array


class _Columns:
    """Products of slopes and changes of the errors, in each channel, over the counted rows."""

    def __init__(self, fitter: HypothesisFitter, arrays: Sequence[Slopes]) -> None:
        together = np.concatenate(arrays, axis=-1)[fitter.problem.counted]
        known = np.isfinite(together).all(axis=-1)
        self.products: Array = np.stack(
            [
                together[own, channel].T.astype(np.float64) @ together[own, channel]
                for channel, own in enumerate(known.T)
            ]
        )
        self.counts = known.sum(axis=0)
        self.ends = np.cumsum([array.shape[-1] for array in arrays])

    def places(self, array: int) -> Array:
        """Places of the columns of one array."""
        first = 0 if array == 0 else self.ends[array - 1]
        return np.arange(first, self.ends[array])

    def left(self, error: int, used: Array, prior: tuple[Array, Array], floor: Array) -> Array:
        """Mean squares that least squares with the `used` columns leave of an error.

        `prior` is the weight and the centre of each used column.
        """
        own = self.products[:, used[:, None], used]
        slope = self.products[:, used, error]
        square = self.products[:, error, error]
        mean = square / np.maximum(self.counts, 1)
        weight, centre = prior
        for _ in range(ROUNDS):
            per = np.where(self.counts > 0, 1.0 / np.maximum(mean, np.maximum(floor, 1e-12)), 0.0)
            hessian = np.tensordot(per, own, axes=1)
            hessian[np.diag_indices(used.size)] += weight**2 + 1e-9 * np.diag(hessian) + 1e-12
            x = np.linalg.solve(hessian, weight**2 * centre - per @ slope)
            total = square + 2.0 * slope @ x + np.einsum("i,cij,j->c", x, own, x)
            mean = np.maximum(total, 0.0) / np.maximum(self.counts, 1)
        return np.asarray(mean)


def _pairs(
    fitter: HypothesisFitter,
    bases: Sequence[Hypothesis],
    singles: Sequence[Hypothesis],
) -> list[_Pair]:
    """Every pair of a base with a single effect, and what it would leave if all were linear."""
    nominal = fitter.nominal
    bare = fitter.bare
    assert nominal is not None and bare is not None
    at = len(fitter.nuisances)
    scaling = Scaling([nuisance.free for nuisance in fitter.nuisances])
    start = fitter.simulated_errors(nominal)
    arrays: list[Slopes] = [base.result.errors[..., None] for base in bases]
    arrays += [base.result.jacobian for base in bases]
    for single in singles:
        change = (fitter.simulated_errors(single) - start)[..., None]
        arrays.append(np.concatenate([single.result.jacobian[..., at:], change], axis=-1))
    columns = _Columns(fitter, arrays)
    found = []
    for k, base in enumerate(bases):
        own = columns.places(len(bases) + k)
        offset = scaling.centre - scaling.scaled(base.result.values[:at])
        for j, single in enumerate(singles):
            if set(single.effects) & set(base.effects):
                continue
            used = np.concatenate([own, columns.places(2 * len(bases) + j)])
            weight, centre = np.zeros((2, used.size))
            weight[:at], centre[:at] = scaling.weight, offset
            left = columns.left(k, used, (weight, centre), fitter.floor)
            found.append(_Pair(base, single, left))
    return found


def is_clean(
    fitter: HypothesisFitter,
    singles: Sequence[Hypothesis],
    share: Callable[[Array], float],
) -> bool:
    """Whether one cause or two explain the recordings down to the noise, without a background.

    Parameters
    ----------
    fitter : HypothesisFitter
        Fitter with an ordinary background.
    singles : sequence of Hypothesis
        The fits of single effects with this background, best first.
    share : callable
        Takes the mean squares that a hypothesis without a background leaves, shape (channels,), and
        returns the share of a whole ordinary background that they are.
    """
    rules = fitter.rules
    steps, limit = rules.search.settled_steps, rules.decision.clean_share

    bases = fitter.fit_all(
        [
            FitTask(h.members, h.result.values, steps, guess=h.result.jacobian, is_bare=True)
            for h in singles[: rules.search.clean_bases]
        ]
    )
    if any(share(base.mean_square) < limit for base in bases):
        return True
    pairs = sorted(_pairs(fitter, bases, singles), key=lambda pair: share(pair.mean_square))
    likely = [p for p in pairs if share(p.mean_square) < rules.search.clean_reach * limit]
    at = len(fitter.nuisances)
    fits = fitter.fit_all(
        [
            FitTask(
                (*pair.first.members, *pair.second.members),
                np.concatenate([pair.first.result.values, pair.second.result.values[at:]]),
                steps,
                guess=np.concatenate(
                    [pair.first.result.jacobian, pair.second.result.jacobian[..., at:]], axis=-1
                ),
                is_bare=True,
            )
            for pair in likely[: rules.search.clean_pairs]
        ]
    )
    return any(share(one.mean_square) < limit for one in fits)
