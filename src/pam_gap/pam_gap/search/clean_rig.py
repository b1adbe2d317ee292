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
class _Guess:
    """One effect or two that could explain a recording, and what they would leave."""

    members: tuple[Hypothesis, ...]
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


def _guesses(
    fitter: HypothesisFitter, nominal: Hypothesis, singles: Sequence[Hypothesis]
) -> list[_Guess]:
    """The best single effects, alone and with every other one, as if all laws were linear."""
    at = len(fitter.nuisances)
    scaling = Scaling([nuisance.free for nuisance in fitter.nuisances])
    bases = singles[: fitter.rules.search.clean_bases]
    start = nominal.simulated
    errors = [single.simulated for single in singles]
    arrays: list[Slopes] = [error[..., None] for error in errors[: len(bases)]]
    arrays += [base.result.jacobian for base in bases]
    for single, error in zip(singles, errors, strict=True):
        change = (error - start)[..., None]
        arrays.append(np.concatenate([single.result.jacobian[..., at:], change], axis=-1))
    columns = _Columns(fitter, arrays)
    found = []
    for k, base in enumerate(bases):
        own = columns.places(len(bases) + k)
        offset = scaling.centre - scaling.scaled(base.result.values[:at])
        partners: list[tuple[tuple[Hypothesis, ...], Array]] = [((), own)]
        partners += [
            ((single,), np.concatenate([own, columns.places(2 * len(bases) + j)]))
            for j, single in enumerate(singles)
            if single.effects != base.effects
        ]
        for others, used in partners:
            weight, centre = np.zeros((2, used.size))
            weight[:at], centre[:at] = scaling.weight, offset
            left = columns.left(k, used, (weight, centre), fitter.floor)
            found.append(_Guess((base, *others), left))
    return found


def _task(guess: _Guess, at: int, steps: int) -> FitTask:
    """The fit of a guess without a background; the first `at` numbers are those of the rig."""
    first, *others = [one.result for one in guess.members]
    return FitTask(
        tuple(member for one in guess.members for member in one.members),
        np.concatenate([first.values, *(one.values[at:] for one in others)]),
        steps,
        guess=np.concatenate(
            [first.jacobian, *(one.jacobian[..., at:] for one in others)], axis=-1
        ),
        is_bare=True,
    )


def clean_explanation(
    fitter: HypothesisFitter,
    nominal: Hypothesis,
    singles: Sequence[Hypothesis],
    share: Callable[[Array], float],
    confirmed: Callable[[Hypothesis], bool] = lambda _: True,
) -> Hypothesis | None:
    """One cause or two that explain the recordings down to the noise, without a background.

    Parameters
    ----------
    fitter : HypothesisFitter
        Fitter with an ordinary background.
    nominal : Hypothesis
        The re-tuned plant without effects, with this background.
    singles : sequence of Hypothesis
        The fits of single effects with it, best first.
    share : callable
        Takes the mean squares that a hypothesis without a background leaves, shape (channels,), and
        returns the share of a whole ordinary background that they are.
    confirmed : callable, optional
        Whether a fit that explains these recordings counts.

    Returns
    -------
    Hypothesis or None
        The first one that does; None if there is none.
    """
    rules = fitter.rules
    limit = rules.search.clean_left
    likely: dict[frozenset[str], _Guess] = {}
    for one in sorted(_guesses(fitter, nominal, singles), key=lambda one: share(one.mean_square)):
        if share(one.mean_square) < limit and len(likely) < rules.search.clean_pairs:
            likely.setdefault(frozenset(h.label for h in one.members), one)
    at = len(fitter.nuisances)
    fits = (  # one after the other, because the first one that does is enough
        explained(fitter, _task(one, at, rules.search.clean_steps), share)
        for one in likely.values()
    )
    return next((fit for fit in fits if fit is not None and confirmed(fit)), None)


def explained(
    fitter: HypothesisFitter, task: FitTask, share: Callable[[Array], float]
) -> Hypothesis | None:
    """The fit if it leaves little; it ends where some steps do not halve what it leaves.

    A pair that is the cause gets there quickly, as its start is close. Any other pair drifts to the
    ends of its ranges, where many integration steps fit into a sample.
    """
    limit = fitter.rules.search.clean_left
    steps, left = task.max_iterations, np.inf
    for _ in range(0, fitter.rules.search.settled_steps, steps):
        (fit,) = fitter.fit_all([task])
        before, left = left, share(fit.mean_square)
        if left < limit or left > 0.5 * before:
            break
        task = FitTask.further(fit, steps, is_bare=True)
    return fit if left < limit else None
