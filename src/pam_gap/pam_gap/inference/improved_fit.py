"""The fit whose numbers the improved rig file holds.

The fit behind a verdict contains an ordinary background as amounts of known changes, which no rig
file can hold. Most of its parts are effects of the table, however, and small amounts of them belong
into a rig file as well as large ones. They are therefore fitted once more together with the causes,
now as effects with a size of their own up to the ordinary one, and without any amounts.

What helps along the recording need not help elsewhere. Of the fit with and the fit without these
sizes, the one that leaves less on held-out data is used; if even that leaves more than the rig file
as written, there is no improved rig file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pam_gap.inference.background import Background
from pam_gap.inference.candidates import Candidate, ordinary_sizes
from pam_gap.inference.confidence import pooled_rms
from pam_gap.inference.held_out import Folds, HeldOut, score_all
from pam_gap.inference.hypothesis import FitTask, Hypothesis, HypothesisFitter
from pam_gap.prediction.fit import Array
from pam_model.effects import EFFECTS


def ordinary_members(
    fitter: HypothesisFitter,
    background: Background,
    chosen: Hypothesis,
    candidates: Sequence[Candidate],
) -> tuple[tuple[Candidate, ...], Array]:
    """Effects of which a fit contains an ordinary amount, and starting values of their parameters.

    The size of each is limited to the ordinary one. An effect that the rig file states already is
    left out: its size there may be larger.
    """
    problem = fitter.problem
    amount: dict[str, float] = {}
    for effect, fitted in zip(background.effects, chosen.result.amounts, strict=True):
        owners = len(problem.sides) if effect and EFFECTS[effect].scope == "muscle" else 1
        amount[effect] = amount.get(effect, 0.0) + float(fitted) / owners
    sizes = {
        path: (effect, size)
        for effect, paths, size in ordinary_sizes(
            problem.rig, problem.rig.joints[problem.joint], problem.sides
        )
        for path in paths
    }
    members: list[Candidate] = []
    starts: list[float] = []
    for candidate in candidates:
        share = min(amount.get(candidate.effect, 0.0), 1.0)
        is_known = all(
            path in sizes
            for targets, (_, reach) in zip(candidate.targets, candidate.ordinary, strict=True)
            for path in targets
            if reach > 0.0
        )
        if share <= 0.0 or not is_known or candidate.effect in chosen.effects:
            continue
        free = []
        for parameter, start, (neutral, reach) in zip(
            candidate.free, candidate.starts[0].tolist(), candidate.ordinary, strict=True
        ):
            if reach > 0.0:
                free.append(replace(parameter, high=min(parameter.high, neutral + reach)))
                starts.append(neutral + share * reach)
            else:
                free.append(parameter)
                starts.append(start)
        members.append(replace(candidate, free=tuple(free)))
    return tuple(members), np.array(starts)


def left_over(score: HeldOut, present: np.ndarray) -> float:
    """RMS error of a simulation alone on held-out data, over all channels."""
    plain = score.simulated
    return float(pooled_rms(plain.sums.sum(axis=0), plain.counts.sum(axis=0), present))


def improved_fit(
    fitter: HypothesisFitter,
    folds: Folds,
    chosen: HeldOut,
    candidates: Sequence[Candidate],
    written: HeldOut,
) -> HeldOut | None:
    """The score of the fit that the improved rig file holds; None if no fit improves the rig file.

    Parameters
    ----------
    fitter : HypothesisFitter
        Fitter of the problem.
    folds : Folds
        Folds for the scores.
    chosen : HeldOut
        The hypothesis that the verdict names.
    candidates : sequence of Candidate
        All effects.
    written : HeldOut
        Score of the rig file as written.
    """
    scores = [chosen]
    if fitter.background is not None:
        best, steps = chosen.hypothesis, fitter.rules.search.settled_steps
        tasks = [FitTask.further(best, steps, is_bare=True)]
        beside, starts = ordinary_members(fitter, fitter.background, best, candidates)
        if beside:
            values = np.concatenate([best.result.values, starts])
            tasks.append(FitTask((*best.members, *beside), values, steps, is_bare=True))
        scores = score_all(fitter, folds, fitter.fit_all(tasks))
    present = fitter.problem.present
    least = min(scores, key=lambda score: left_over(score, present))
    return least if left_over(least, present) < left_over(written, present) else None
