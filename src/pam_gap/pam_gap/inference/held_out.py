"""Scores on data that were not used for the fit: two folds of alternating blocks with guards.

The parameters are fitted on one fold and scored on the other, and the other way round. Rows that
are nearer to a border than the guard belong to neither fold. An error of the observer decays within
its horizon, and slower states (creep, temperature) follow the measured history in both folds. A
guard of a few horizons is therefore enough to separate the folds.

Where a muscle on a bench is held at several lengths, each length is withheld once instead, and
predicted from the others: blocks in time would only ask whether a fitted length is fitted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pam_gap.inference.hypothesis import FitTask, Hypothesis, HypothesisFitter, Rows
from pam_gap.inference.score import Score
from pam_gap.prediction.channel_order import POSITION
from pam_gap.prediction.fit import Array
from pam_gap.prediction.problem import PredictionProblem
from pam_model.robot import compose

OTHER_LENGTHS = "other lengths"


@dataclass(frozen=True, slots=True)
class Folds:
    """What is fitted and what is withheld in turn."""

    # rows that are fitted, and rows that are withheld meanwhile
    turns: tuple[tuple[Rows, Rows], ...]
    score_block: np.ndarray  # shape (n_rows,): score block of each counted row, -1 for none
    n_blocks: int  # number of score blocks
    withheld: str = "other times"  # what is withheld, in words

    @property
    def used(self) -> Rows:
        """Rows that are withheld once."""
        result: Rows = np.any([withheld for _, withheld in self.turns], axis=0)
        return result


@dataclass(frozen=True, slots=True)
class HeldOut(Score):
    """The score of one hypothesis on data that were not used for its fit, with the fit itself."""

    hypothesis: Hypothesis  # the fit to all data
    fold_values: tuple[Array, ...]  # parameters fitted on each fold

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


def held_lengths(problem: PredictionProblem) -> np.ndarray | None:
    """Number of the length at which a muscle on a bench is held in each row, shape (n_rows,).

    -1 is on the way from one length to another. None where the muscle is not held at three lengths
    or more for most of the time; two lengths that differ less than `lengths_apart` are one.
    """
    if not problem.is_bench:
        return None
    rules = problem.rules.search
    position = np.concatenate(
        [
            data.rows(data.measured[:, POSITION])[: int(end - start)]
            for data, start, end in zip(
                problem.data, problem.offsets[:-1], problem.offsets[1:], strict=True
            )
        ]
    )
    muscle = problem.rig.muscle(problem.muscles[0])
    arms = compose(problem.rig).joints[problem.joint].arms
    apart = rules.lengths_apart * muscle.rest_length / abs(arms[0].length)
    order = np.sort(position[problem.counted])
    groups = np.split(order, np.flatnonzero(np.diff(order) > apart) + 1)
    kept = [
        (float(group[0]), float(group[-1]))
        for group in groups
        if group.size >= rules.least_length_time * order.size and np.ptp(group) < apart
    ]
    found = np.full(problem.n_rows, -1)
    for number, (low, high) in enumerate(kept):
        found[(position >= low) & (position <= high)] = number
    is_held = np.mean(found[problem.counted] >= 0) >= rules.mostly_held if order.size else False
    return found if len(kept) >= rules.fewest_lengths and is_held else None


def make_folds(problem: PredictionProblem) -> Folds:
    """Cut a problem's counted rows into folds: two of alternating blocks, or one per length."""
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
    lengths = held_lengths(problem)
    if lengths is not None:
        number = np.where((block >= 0) & (lengths >= 0), lengths % rules.most_lengths, -1)
        each = [number == k for k in range(min(int(lengths.max()) + 1, rules.most_lengths))]
        turns = [((number >= 0) & ~own, own) for own in each if own.any()]
        if len(turns) >= rules.fewest_lengths:
            return Folds(tuple(turns), block, used.size, OTHER_LENGTHS)
    first, second = fold == 0, fold == 1
    return Folds(((first, second), (second, first)), block, used.size)


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
    a drift that was fitted to one fold would be carried on into the other. An effect that only one
    fold shows keeps about its size in the fit to the other one. At a length that is withheld,
    whether the other lengths give its size is just what is asked.
    """
    is_fitted = [bool(h.result.values.size) for h in hypotheses]
    tasks = [
        FitTask.further(
            h,
            fitter.rules.search.fold_steps,
            rows=own,
            cached=h.result.jacobian,
            amounts=h.result.amounts,
            is_bare=not h.result.amounts.size,
            stays=folds.withheld != OTHER_LENGTHS,
        )
        for h, fitted in zip(hypotheses, is_fitted, strict=True)
        if fitted
        for own, _ in folds.turns
    ]
    parts = iter(fitter.fit_all(tasks))
    scores: list[HeldOut] = []
    for h, fitted in zip(hypotheses, is_fitted, strict=True):
        sums = np.zeros((folds.n_blocks, h.result.errors.shape[1]))
        counts, simulated = np.zeros_like(sums), np.zeros_like(sums)
        values: list[Array] = []
        for _, other in folds.turns:
            part = next(parts) if fitted else h
            values.append(part.result.values)
            more_sums, more_counts = block_sums(part.result.errors, folds, other)
            sums += more_sums
            counts += more_counts
            simulated += block_sums(part.simulated, folds, other)[0]
        scores.append(HeldOut.of(h, sums, counts, tuple(values), simulated))
    return scores
