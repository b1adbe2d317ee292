"""What follows if the tolerance of the lengths is not stated.

Lengths that are wrong by some per cent imitate an offset of the encoder, another gain of a pressure
sensor or another pulley: 2 % of a muscle of 0.3 m on a pulley of 35 mm are 0.17 rad. A ruler gives
them better than that, but only the owner knows whether one was used. Where lengths that are as
uncertain as all other numbers explain most of an error, the diagnosis is therefore repeated with
lengths as a ruler gives them. Wrong lengths then are one more explanation, with many free numbers,
and no longer part of every explanation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pam_gap.inference.evidence import Evidence
from pam_gap.inference.hypothesis import Hypothesis, HypothesisFitter
from pam_gap.inference.posterior import posterior
from pam_gap.prediction.fit import mean_squares
from pam_gap.rules import DEFAULT, Rules
from pam_gap.rules.search_rules import SearchRules
from pam_model.plant.written_numbers import LENGTHS
from pam_model.rig import Rig

WRONG_LENGTHS = "wrong lengths"
"""Name of the cause that lengths beyond the tolerance of a ruler are."""


@dataclass(frozen=True, slots=True)
class LooseLengths:
    """Re-tuned lengths that explain most of an error, although their tolerance is not stated."""

    example: str  # the length that was changed most, and by how much
    share: float  # share of the RMS error that the lengths remove
    channel: str  # channel of this error
    tolerance: float  # relative tolerance that was assumed for them

    @property
    def caution(self) -> str:
        """What this means for an answer in which they are re-tuned, in full sentences."""
        return (
            f"Re-tuned lengths, such as {self.example}, explain {100.0 * self.share:.0f} % of the "
            f"error at {self.channel}. The rig file states no length_tolerance, so that they may "
            f"be wrong by {100.0 * self.tolerance:.2g} % as all other numbers. If they were "
            "measured better, state it and diagnose again: an offset of the encoder, the gain of a "
            "pressure sensor or another pulley radius may be the cause."
        )

    def rival_caution(self, assumed: float) -> str:
        """What this means for an answer with lengths of a smaller tolerance that was assumed."""
        return (
            "The rig file states no length_tolerance; lengths within "
            f"{100.0 * assumed:.2g} %, as a ruler gives them, are assumed here. Lengths that are "
            f"wrong by up to {100.0 * self.tolerance:.2g} %, such as {self.example}, would explain "
            f"{100.0 * self.share:.0f} % of the error at {self.channel} as well. If yours may be "
            "wrong by that much, state it and diagnose again."
        )


def as_measured(rig: Rig, rules: SearchRules = DEFAULT.search) -> Rig:
    """The rig with the tolerance of lengths that a ruler gives, where none is stated."""
    if rig.length_tolerance is not None:
        return rig
    return replace(rig, length_tolerance=min(rules.ruler, rig.parameter_tolerance))


def probability_of_lengths(tight: Evidence[Any], loose: Evidence[Any], rules: Rules) -> float:
    """Probability that wrong lengths are a part of the explanation.

    They count as one more cause. Numbers of the rig file have no price in any explanation.

    Parameters
    ----------
    tight, loose : Evidence
        What the searches with lengths as measured and with loose ones found.
    rules : Rules
        What is believed beforehand, and what matters.
    """
    fits = [loose.nominal, *loose.finalists]
    wrong = [replace(one, effects=(*one.effects, WRONG_LENGTHS)) for one in fits]
    found = posterior(replace(tight, tried=(*tight.tried, *wrong)), rules)
    return sum(p for name, p in found.items() if WRONG_LENGTHS in name.split(" + "))


def shared_probabilities(
    tight: Mapping[str, float], loose: Mapping[str, float], of_lengths: float
) -> dict[str, float]:
    """Probabilities of explanations: those with lengths as measured, and those with wrong ones.

    Parameters
    ----------
    tight, loose : mapping
        Explanation -> probability, given lengths as measured, and given wrong ones.
    of_lengths : float
        Probability of the latter.
    """
    found = {
        name: (1.0 - of_lengths) * tight.get(name, 0.0) + of_lengths * loose.get(name, 0.0)
        for name in {**tight, **loose}
    }
    return dict(sorted(found.items(), key=lambda pair: -pair[1]))


def loose_lengths(fitter: HypothesisFitter, hypothesis: Hypothesis) -> LooseLengths | None:
    """The re-tuned lengths of a hypothesis; None unless they explain most of an error."""
    problem, rig = fitter.problem, fitter.problem.rig
    lengths = [
        k
        for k, nuisance in enumerate(fitter.nuisances)
        if nuisance.is_factor
        and nuisance.targets[0].rpartition(".")[2] in (*LENGTHS, "pulley_radius")
    ]
    if rig.length_tolerance is not None or not lengths:
        return None
    tuned = hypothesis.result.values
    written = tuned.copy()
    written[lengths] = 1.0
    vectors = [fitter.vector(hypothesis.members, values) for values in (tuned, written)]
    left = mean_squares(problem.errors(np.array(vectors)), problem.counted)
    removed = np.where(problem.present, 1.0 - np.sqrt(left[0] / np.maximum(left[1], 1e-12)), 0.0)
    most = int(np.argmax(removed))
    if removed[most] < problem.rules.decision.most_of_the_gap:
        return None
    farthest = max(lengths, key=lambda k: abs(float(tuned[k]) - 1.0))
    change = 100.0 * (float(tuned[farthest]) - 1.0)
    return LooseLengths(
        f"{fitter.nuisances[farthest].free.name} by {change:+.2g} %",
        float(removed[most]),
        problem.names[most],
        rig.parameter_tolerance,
    )
