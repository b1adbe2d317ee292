"""How clearly each effect would show in a recording, before anything is fitted.

For each effect, the change of the predictions that it causes at its usual size is compared with the
noise. An effect whose change stays below the noise in every second cannot be judged from this
recording: neither its presence nor its absence follows from the answer.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pam_gap.inference.candidates import Candidate
from pam_gap.prediction.fit import Array
from pam_gap.prediction.problem import PredictionProblem
from pam_model.plant.parameters import INDEX


def excitation(
    problem: PredictionProblem, candidates: Sequence[Candidate], floor: Array
) -> dict[str, float]:
    """How clearly each effect, at its usual size, would show in this recording.

    Parameters
    ----------
    problem : PredictionProblem
        Rig and recordings.
    candidates : sequence of Candidate
        The effects; their starting values are the usual sizes.
    floor : ndarray, shape (N_CHANNELS,)
        Mean squared error due to noise alone.

    Returns
    -------
    dict of str to float
        Effect -> RMS change over floor in the channel and the second where it is largest.
    """
    places = [(c, start) for c in candidates for start in c.starts]
    if not places or not problem.counted.any():
        return {}
    lanes = np.repeat(problem.base.values[None], len(places) + 1, axis=0)
    for lane, (candidate, start) in enumerate(places, start=1):
        for targets, value in zip(candidate.targets, start, strict=True):
            lanes[lane, [INDEX[name] for name in targets]] = value
    errors = problem.errors(lanes)
    second = np.floor(problem.row_time / problem.rules.search.score_time).astype(np.intp)
    second += (
        10
        * int(second.max() + 1)
        * np.repeat(np.arange(len(problem.data)), np.diff(problem.offsets))
    )
    _, group = np.unique(second, return_inverse=True)
    counted = problem.counted
    found: dict[str, float] = {}
    for lane, (candidate, _) in enumerate(places, start=1):
        square = (errors[lane] - errors[0]) ** 2 / floor
        square = np.where(np.isfinite(square) & problem.present, square, 0.0)[counted]
        sums = np.zeros((int(group.max()) + 1, square.shape[1]))
        np.add.at(sums, group[counted], square)
        rows = np.bincount(group[counted], minlength=len(sums))
        largest = float(np.sqrt((sums / np.maximum(rows, 1)[:, None]).max()))
        found[candidate.effect] = max(found.get(candidate.effect, 0.0), largest)
    return found


def not_shown(
    problem: PredictionProblem, candidates: Sequence[Candidate], floor: Array
) -> tuple[str, ...]:
    """Effects that would stay below the noise at their usual size, in the order of the table."""
    least = problem.rules.recording.least_excitation
    found = excitation(problem, candidates, floor)
    return tuple(effect for effect, largest in found.items() if largest < least)
