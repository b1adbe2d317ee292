"""Prandtl-Ishlinskii hysteresis: a weighted sum of play operators.

Standard form (not in the review), symmetric about its centre. The length-pressure loop of a muscle
is not symmetric: use one set of weights for each branch, or a static nonlinearity after the model.
"""

from __future__ import annotations

from collections.abc import Sequence

from pam_model.domain import require
from pam_model.errors import DomainError


class PrandtlIshlinskii:
    """Output from input, rate-independent; the state is the position of each play.

    Parameters
    ----------
    thresholds : sequence of float
        r_i, half the width of each play, in the input's unit.
    weights : sequence of float
        w_i, in the output's unit per input unit.

    Raises
    ------
    DomainError
        For sequences of unequal length, none at all, or a threshold below 0.
    """

    def __init__(self, thresholds: Sequence[float], weights: Sequence[float]) -> None:
        if len(thresholds) != len(weights) or not thresholds:
            raise DomainError(
                f"{len(thresholds)} thresholds and {len(weights)} weights: "
                "each play needs one of each"
            )
        require("thresholds", thresholds, 0.0)
        require("weights", weights)
        self.thresholds = tuple(float(r) for r in thresholds)
        self.weights = tuple(float(w) for w in weights)
        self.plays = [0.0] * len(self.thresholds)

    def update(self, value: float) -> float:
        """Move the input to a value and return the output."""
        require("value", value)
        self.plays = [
            max(value - threshold, min(value + threshold, play))
            for play, threshold in zip(self.plays, self.thresholds, strict=True)
        ]
        return sum(w * play for w, play in zip(self.weights, self.plays, strict=True))
