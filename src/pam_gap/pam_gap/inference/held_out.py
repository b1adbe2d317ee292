"""Scores on data that were not used for the fit: two folds of alternating blocks with guards.

The parameters are fitted on one fold and scored on the other. Rows that are nearer to a border than
the guard belong to neither fold. An error of the observer decays within its horizon, and slower
states (creep, temperature) follow the measured history in both folds. A guard of a few horizons is
therefore enough to separate the folds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pam_gap.inference.hypothesis import FitTask, Hypothesis, HypothesisFitter, Rows
from pam_gap.inference.score import Score
from pam_gap.prediction.fit import Array
from pam_gap.prediction.problem import PredictionProblem


@dataclass(frozen=True, slots=True)
class Folds:
    """Rows of each fold, and the score block of each counted row (-1 for none)."""

    rows: tuple[Rows, Rows]
    score_block: np.ndarray
    n_blocks: int


@dataclass(frozen=True, slots=True)
class HeldOut(Score):
    """The score of one hypothesis on data that were not used for its fit, with the fit itself.

    Attributes
    ----------
    hypothesis : Hypothesis
        The fit to all data.
    fold_values : tuple of ndarray
        Parameters fitted on each fold.
    """

    hypothesis: Hypothesis
    fold_values: tuple[Array, ...]

    @classmethod
    def of(
        cls,
        hypothesis: Hypothesis,
        sums: Array,
        counts: Array,
        fold_values: tuple[Array, ...] = (),
        simulated_sums: Array | None = None,
    ) -> HeldOut:
        """The score of a hypothesis from its block sums."""
        free = sum(len(member.free) for member in hypothesis.members)
        return cls(
            hypothesis.effects,
            hypothesis.label,
            free,
            sums,
            counts,
            hypothesis,
            fold_values,
            ordinary=hypothesis.ordinary,
            cut_off=tuple(dict.fromkeys(effect for effect, *_ in hypothesis.at_the_end)),
            simulated_sums=simulated_sums,
        )


def make_folds(problem: PredictionProblem) -> Folds:
    """Cut a problem's counted rows into two folds."""
    rules = problem.rules.search
    n = problem.n_rows
    fold = np.full(n, -1)
    block = np.full(n, -1)
    next_block = 0
    for start, end in zip(problem.offsets[:-1], problem.offsets[1:], strict=True):
        time = problem.row_time[start:end]
        length = max(min(rules.fold_time, float(time[-1]) / 4.0), 4.0 * rules.guard / 3.0)
        turn = np.floor(time / length).astype(int)
        from_border = np.minimum(time - turn * length, (turn + 1) * length - time)
        guard = min(rules.guard / 2.0, 0.2 * length)
        inside = (from_border > guard) & problem.counted[start:end]
        fold[start:end][inside] = turn[inside] % 2
        pieces = np.floor(time / rules.score_time).astype(int)
        block[start:end][inside] = next_block + pieces[inside]
        next_block += int(pieces.max()) + 1
    used = np.unique(block[block >= 0])
    block = np.where(block >= 0, np.searchsorted(used, block), -1)
    return Folds((fold == 0, fold == 1), block, used.size)


def block_sums(errors: Array, folds: Folds, rows: Rows) -> tuple[Array, Array]:
    """Sum of squares and number of known rows of each score block, over the given rows."""
    sums = np.zeros((folds.n_blocks, errors.shape[1]))
    counts = np.zeros_like(sums)
    chosen = rows & (folds.score_block >= 0)
    place = folds.score_block[chosen]
    square = errors[chosen] ** 2
    known = np.isfinite(square)
    np.add.at(sums, place, np.where(known, square, 0.0))
    np.add.at(counts, place, known.astype(np.float64))
    return sums, counts


def score_held_out(fitter: HypothesisFitter, folds: Folds, hypothesis: Hypothesis) -> HeldOut:
    """Continue the fit to all data on each fold, and score it on the other fold."""
    return score_all(fitter, folds, [hypothesis])[0]


def score_all(
    fitter: HypothesisFitter, folds: Folds, hypotheses: Sequence[Hypothesis]
) -> list[HeldOut]:
    """Held-out scores of several hypotheses; all their fits run side by side.

    The amounts of an ordinary background are those of all data. They are not what is tested, and
    a drift that was fitted to one fold would be carried on into the other.
    """
    is_fitted = [bool(h.result.values.size) for h in hypotheses]
    tasks = [
        FitTask(
            h.members,
            h.result.values,
            fitter.rules.search.fold_steps,
            own,
            h.result.jacobian,
            amounts=h.result.amounts,
            is_bare=not h.result.amounts.size,
        )
        for h, fitted in zip(hypotheses, is_fitted, strict=True)
        if fitted
        for own in folds.rows
    ]
    parts = iter(fitter.fit_all(tasks))
    scores: list[HeldOut] = []
    for h, fitted in zip(hypotheses, is_fitted, strict=True):
        sums = np.zeros((folds.n_blocks, h.result.errors.shape[1]))
        counts, simulated = np.zeros_like(sums), np.zeros_like(sums)
        values: list[Array] = []
        for other in folds.rows[::-1]:
            part = next(parts) if fitted else h
            values.append(part.result.values)
            more_sums, more_counts = block_sums(part.result.errors, folds, other)
            sums += more_sums
            counts += more_counts
            simulated += block_sums(fitter.simulated_errors(part), folds, other)[0]
        scores.append(HeldOut.of(h, sums, counts, tuple(values), simulated))
    return scores
