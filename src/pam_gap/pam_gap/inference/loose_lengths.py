"""Tells when lengths of which no tolerance is stated explain an error.

Lengths that are wrong by some per cent imitate an offset of the encoder, another gain of a pressure
sensor or another pulley. A calliper gives them better than that, but only the owner knows.
"""

from __future__ import annotations

import numpy as np

from pam_gap.inference.candidates import LENGTHS
from pam_gap.inference.hypothesis import Hypothesis, HypothesisFitter
from pam_gap.prediction.fit import mean_squares


def loose_lengths(fitter: HypothesisFitter, hypothesis: Hypothesis) -> tuple[str, ...]:
    """What the re-tuned lengths of a hypothesis explain, in a full sentence; empty if not most.

    Parameters
    ----------
    fitter : HypothesisFitter
        Fitter of the problem.
    hypothesis : Hypothesis
        A fitted hypothesis of it.
    """
    problem, rig = fitter.problem, fitter.problem.rig
    lengths = [
        k
        for k, nuisance in enumerate(fitter.nuisances)
        if nuisance.is_factor
        and nuisance.targets[0].rpartition(".")[2] in (*LENGTHS, "pulley_radius")
    ]
    if rig.length_tolerance is not None or not lengths:
        return ()
    tuned = hypothesis.result.values
    written = tuned.copy()
    written[lengths] = 1.0
    vectors = [fitter.vector(hypothesis.members, values) for values in (tuned, written)]
    left = mean_squares(problem.errors(np.array(vectors)), problem.counted)
    removed = np.where(problem.present, 1.0 - np.sqrt(left[0] / np.maximum(left[1], 1e-12)), 0.0)
    most = int(np.argmax(removed))
    if removed[most] < problem.rules.decision.most_of_the_gap:
        return ()
    farthest = max(lengths, key=lambda k: abs(float(tuned[k]) - 1.0))
    change = 100.0 * (float(tuned[farthest]) - 1.0)
    return (
        f"Re-tuned lengths, such as {fitter.nuisances[farthest].free.name} by {change:+.2g} %, "
        f"explain {100.0 * removed[most]:.0f} % of the error at {problem.names[most]}. The rig "
        f"file states no length_tolerance, so that they may be wrong by "
        f"{100.0 * rig.parameter_tolerance:.2g} % as all other numbers. If they were measured "
        "better, state it and diagnose again: an offset of the encoder, the gain of a pressure "
        "sensor or another pulley radius may be the cause.",
    )
