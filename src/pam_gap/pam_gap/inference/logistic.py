"""The logistic function of a number; the import of scipy.special takes a third of a second."""

import math


def logistic(x: float) -> float:
    """1/(1 + exp(-x))."""
    if x >= 0.0:
        return 1.0 / (1.0 + math.exp(-x))
    return math.exp(x) / (1.0 + math.exp(x))
