"""Compares what was learnt with having learnt nothing, all the time, and takes back what fails.

A fit over many seconds goes on acting for seconds after the rig has become another one: a load was
taken off, friction has worn in, a hose was exchanged. Before a fit takes a new sample it has told
what it expects. With the values y that then came and the expectations f, the share

    s = sum(f y) / sum(f^2)

is the one with which the least of y would have been left in the last moments; 0 is the controller
without adaptation, 1 the one that uses all that was learnt. What was learnt acts by this share,
from 0 to 1. It is 1 while the expectations hold, 0.5 while they are twice too large, and 0 while
what was learnt does harm. A prior of the size of what a fit may neglect speaks for 1.

A share below 1 means as well that old samples are of another rig: the fit forgets them faster.

Sources: J. Mincer and V. Zarnowitz, "The evaluation of economic forecasts", in: Economic Forecasts
and Expectations, NBER 1969 (regression of what came on what was forecast); A. P. Dawid,
"Statistical theory: the prequential approach", Journal of the Royal Statistical Society A 147
(1984) 278-292; T. R. Fortescue, L. S. Kershenbaum and B. E. Ydstie, "Implementation of self-tuning
regulators with variable forgetting factors", Automatica 17 (1981) 831-835.
"""

from __future__ import annotations

import math
from typing import Any, Final

from pam_control.adaptation.normal_equations import COMMON, OWN, SHARE

WINDOW: Final = 0.3  # s of motion or work; a load is taken off within one stroke
LEAST_KEPT: Final = 0.05  # of the memory of a fit; a stroke is remembered in any case


def begin_comparison(state: Any) -> None:
    """Nothing was expected yet."""
    state[COMMON], state[OWN], state[SHARE] = 0.0, 0.0, 1.0


def compare(state: Any, trifle: float, expected: float, value: float, duration: float) -> None:
    """Take what was expected of a value and the value; write the share that has helped lately.

    Parameters
    ----------
    state : row
        Of a fit (`normal_equations`).
    trifle : float
        Root mean square below which nothing that was learnt is judged, in the value's unit.
    expected, value : float
        In their unit.
    duration : float
        Time since the last value [s].
    """
    prior, kept = WINDOW * trifle * trifle, math.exp(-duration / WINDOW)
    state[COMMON] = kept * state[COMMON] + duration * expected * value
    state[OWN] = kept * state[OWN] + duration * expected * expected
    share = (state[COMMON] + prior) / (state[OWN] + prior)
    state[SHARE] = max(min(share, 1.0), 0.0)


def memory_of(state: Any, usual: float) -> float:
    """How long a fit may remember now that remembers for a usual time [s]."""
    return float(usual * max(state[SHARE], LEAST_KEPT))
