"""How the flow of a valve differs from what its data say, learnt while it works.

With the flow u that the data promise for the command, the flow m that the measured pressure and the
motion of the muscle show, the part w of m that the motion takes, and the full flow c,

    m - u = a max(u, 0) + b min(u, 0) + o c + e w + z c sat(u/(h c)) - s max(u, 0) r - l P
            + t g - d du/dt

a and b are what the supply and the exhaust path give more, or the gas volume takes less; r is the
share of the full flow that was taken lately, and s tells that the supply falls with it; o is an
opening that nobody commanded; l is a leak, whose flow grows with the pressure P and does not depend
on what the valve does; e tells that the gas is not isothermal, or that its volume is another
than written; z is negative if the spool overlaps its ports; d is a delay or a lag that nobody told.
g is the average of u - w over the last second or two, and t tells that the gas gives its heat to
the wall in such a time: compressed gas with the exponent k and the time constant T of the wall has
(k - 1) T s/(T s + 1) (u - w), which is a = b = k - 1 and e = t = 1 - k.
A fit over the last seconds of work finds the nine. The command of the valve is computed with the
first eight, and the feedforward looks ahead by d as well.

What happens in every control cycle are functions of rows (`feedback.loop_rows`), which the compiled
pressure loops call; `FlowAdaptation` has the fit, which is due every 20 ms.

Both sides pass the same slow filter, so that neither a pressure nor a flow is differentiated. Where
the sensor is found to be before a tube (`TubeSearch`), the loss in it is subtracted from what it
shows.

Source: P. Beater, Pneumatic Drives, Springer 2007, chapters 5 and 6 (paths and overlap of a valve,
chamber). The form of the fit is derived here.
"""

from __future__ import annotations

import math
from typing import Any, Final

from pam_control.adaptation.recursive_fit import WEIGHTS, RecursiveFit, Suspect, take_sample
from pam_control.adaptation.tube_search import TUBE_SHARE, TubeSearch, search_tube
from pam_control.limited import limited
from pam_control.rows.loop_rows import (
    N_FULL,
    N_PER_PRESSURE,
    N_PER_SQUARE,
    N_SMOOTH,
    N_WEIGHTS,
    V_BEGUN,
    V_DELAY,
    V_FOUND_DELAY,
    V_LATE,
    V_MOVED,
    V_PER_RATE,
    V_SINCE,
    V_SMOOTH,
    V_TAKEN,
    V_TRUE,
    V_TUBE,
    V_WARM,
    V_WEIGHTS,
)
from pam_model.plant.compiled import entry_point, prepare

FILTER: Final = 0.06  # s
EVERY: Final = 0.02  # s between two updates of the fit
NOISE: Final = 0.01  # of the full flow
TRIFLE: Final = 0.003  # of the full flow; less is left to the pressure loop
LEAST_WORK: Final = 0.004  # of the full flow; a valve that is nearly shut tells nothing
DEVIATIONS: Final = (0.3, 0.3, 0.05, 0.5, 0.05, 3.0, 0.05, 0.3, 0.02)  # the last one in s
LOWEST: Final = (-0.5, -0.5, -0.08, -1.0, -0.1, 0.0, 0.0, -0.5, -math.inf)
HIGHEST: Final = (0.5, 0.5, 0.08, 1.0, 0.0, math.inf, 0.08, 0.0, math.inf)
OPENED: Final = 2  # index of o
LEAK: Final = 6  # index of l
QUANTILE: Final = 1.645  # of the normal distribution, for an interval of 90 %
WALL: Final = 1.5  # s, time constant of g; of a muscle of 0.2 l with natural convection
LATELY: Final = 10.0  # s, time constant of r
MOST_DROOP: Final = 0.5  # of the flow
LEAST_SHARE: Final = 0.4  # of the promised flow
LEAST_DELAY: Final = 4e-3  # s; less is left to the feedback
LONGEST_DELAY: Final = 0.04  # s
LATE: Final = Suspect(LEAST_DELAY, 4.0)  # a soft gas volume looks a little like a delay
DELAY_RATE: Final = 0.02  # s/s, at which the feedforward is moved to a delay that was found
LEARNT_EDGE: Final = 0.03  # h, of the full flow
USED_EDGE: Final = 0.01  # the same for the command: an overlap is not filled within it, for calm


def droop_of(v: Any) -> float:
    """Share of the flow that the supply lacks now [-]."""
    return float(min(v[V_WEIGHTS + 5] * v[V_TAKEN], MOST_DROOP))


def least_share(v: Any) -> float:
    """Flow over promised flow in the worse direction, at most 1 [-]."""
    a, b = v[V_WEIGHTS], v[V_WEIGHTS + 1]
    return float(max(1.0 + min(a - droop_of(v), b, 0.0), LEAST_SHARE))


def corrected_flow(
    n: Any, v: Any, flow: float, moved: float, capacity: float, pressure: float
) -> float:
    """The flow to ask the valve's data for, so that the valve gives `flow` [kg/s].

    Parameters
    ----------
    n, v : rows
        Numbers and state of the loop.
    flow : float
        Wanted [kg/s].
    moved : float
        The part of it that the motion of the muscle takes [kg/s].
    capacity : float
        Full flow in its direction [kg/s].
    pressure : float
        In the muscle [Pa absolute].
    """
    w = V_WEIGHTS
    left = flow - v[w + 2] * capacity - v[w + 3] * moved - v[w + 7] * v[V_WARM]
    left += v[w + 6] * n[N_PER_PRESSURE] * pressure
    left -= v[w + 4] * capacity * limited(left / (USED_EDGE * capacity), -1.0, 1.0)
    path = v[w] - droop_of(v) if left > 0.0 else v[w + 1]
    return float(left / max(1.0 + path, LEAST_SHARE))


def unit_loss(n: Any, flow: float, pressure: float) -> float:
    """Loss of a tube with q = 1 [Pa], at a flow [kg/s] and a pressure [Pa absolute]."""
    return float(n[N_PER_SQUARE] * flow * abs(flow) / pressure)


def forget_weights(v: Any) -> None:
    """Use nothing that was learnt of the flows; the fit has to forget it as well."""
    for place in range(N_WEIGHTS):
        v[V_WEIGHTS + place] = 0.0
    v[V_DELAY] = v[V_FOUND_DELAY] = 0.0


def take_flow(
    n: Any,
    v: Any,
    step: float,
    promised: float,
    capacity: float,
    pressure: float,
    lost: float,
    per_rate: float,
    moved: float,
    delay: float,
) -> None:
    """Take one control cycle of a valve.

    Parameters
    ----------
    n, v : rows
        Numbers and state of the loop.
    step : float
        Time since the last one [s].
    promised : float
        Flow of the command by the valve's data, without leaks [kg/s].
    capacity : float
        Full flow in its direction [kg/s].
    pressure : float
        Measured [Pa absolute].
    lost : float
        Part of it that a tube which was found loses [Pa].
    per_rate : float
        V/(k R T), flow per pressure rate [kg/Pa].
    moved : float
        Flow that the motion of the muscle takes, P dV/dt/(R T), when the command acts [kg/s].
    delay : float
        From the measurement until the command acts [s].
    """
    if step <= 0.0:
        return
    share = step / (max(delay, 0.0) + step)
    v[V_LATE] += share * (promised - v[V_LATE])
    v[V_MOVED] += share * (moved - v[V_MOVED])
    u, c = v[V_LATE], capacity
    up, down = (u, 0.0) if u > 0.0 else (0.0, u)
    v[V_TAKEN] += step / LATELY * (up / n[N_FULL] - v[V_TAKEN])
    v[V_WARM] += step / (WALL + step) * (u - v[V_MOVED] - v[V_WARM])
    v[V_TRUE], v[V_PER_RATE] = pressure - lost, per_rate
    overlap = c * limited(u / (LEARNT_EDGE * c), -1.0, 1.0)
    raw = (
        v[V_TRUE], pressure, unit_loss(n, u, pressure), up, down, c, v[V_MOVED],
        overlap, -up * v[V_TAKEN], -n[N_PER_PRESSURE] * pressure, v[V_WARM],
    )  # fmt: skip
    weight = step / (FILTER + step) if v[V_BEGUN] > 0.0 else 1.0
    v[V_BEGUN] = 1.0
    for place in range(N_SMOOTH):
        smooth = v[V_SMOOTH + place]
        v[V_SMOOTH + place] = (
            smooth + weight * (raw[place] - smooth) if weight < 1.0 else raw[place]
        )
    v[V_SINCE] += step
    wanted = min(v[V_FOUND_DELAY], LONGEST_DELAY)
    wanted = wanted if wanted > LEAST_DELAY else 0.0
    reach = DELAY_RATE * step
    v[V_DELAY] += limited(wanted - v[V_DELAY], -reach, reach)


def bound_weights(v: Any, weights: Any) -> None:
    """Let the control cycle use the weights of the fit within their bounds."""
    for place in range(N_WEIGHTS):
        bounded = max(LOWEST[place], min(HIGHEST[place], weights[place]))
        v[V_WEIGHTS + place] = bounded
    v[V_FOUND_DELAY] = weights[N_WEIGHTS - 1]


@entry_point
def learn_flow(
    n: Any, v: Any, t: Any, tube_given: Any, tube_state: Any, tube_rows: Any, tube_products: Any,
    tube_scratch: Any, tube_functions: Any, given: Any, state: Any, rows: Any, products: Any,
    scratch: Any, functions: Any,
) -> bool:  # fmt: skip
    """Learn from the filtered samples of a valve.

    Parameters
    ----------
    n, v, t : rows
        Numbers and state of the loop, and state of the search for a tube.
    tube_given, tube_state, tube_rows, tube_products, tube_scratch, tube_functions : rows
        Fit of the tube.
    given, state, rows, products, scratch, functions : rows
        Fit of the flow.

    Returns
    -------
    bool
        Whether a tube was found or is gone, so that the flows have to be forgotten.
    """
    s, full, known = V_SMOOTH, n[N_FULL], t[TUBE_SHARE] > 0.0
    slow, shown, lost, up, down = v[s], v[s + 1], v[s + 2], v[s + 3], v[s + 4]
    moved, per_rate, since = v[s + 6], v[V_PER_RATE], v[V_SINCE]
    works = up - down > LEAST_WORK * full
    v[V_SINCE] = 0.0
    search_tube(
        t, since, shown, up / per_rate, down / per_rate, moved / per_rate, lost, works,
        tube_given, tube_state, tube_rows, tube_products, tube_scratch, tube_functions,
    )  # fmt: skip
    v[V_TUBE] = t[TUBE_SHARE]
    if known != (t[TUBE_SHARE] > 0.0):
        return True
    if works:
        for place in range(N_SMOOTH - 3):
            functions[place] = v[s + 3 + place] / full
        functions[N_SMOOTH - 3] = (up + down - v[V_LATE]) / FILTER / full
        seen = per_rate * (v[V_TRUE] - slow) / FILTER + moved
        value = (seen - up - down) / full
        take_sample(value, since, given, state, rows, products, scratch, functions)
        bound_weights(v, rows[WEIGHTS])
    return False


class FlowAdaptation:
    """Learns the flow of one valve.

    Parameters
    ----------
    n, v : rows
        Numbers and state of the loop; they stay those of the loop.
    supply : float
        Pressure of the supply [Pa absolute].
    turn : float, optional
        Part of the time between two updates after which the first one is due, so that several
        valves do not compute theirs in one control cycle [-].
    tube : float, optional
        Squared conductance of the valve over that of the tube that the rig file names [-].

    Attributes
    ----------
    tube : TubeSearch
        Whether the sensor is before a tube.
    """

    def __init__(self, n: Any, v: Any, supply: float, turn: float = 0.0, tube: float = 0.0) -> None:
        self._turn, self._n, self._v = turn, n, v
        self._fit = RecursiveFit(DEVIATIONS, NOISE, TRIFLE, LATE, LEAK)
        self.tube = TubeSearch(float(n[N_FULL]), supply, tube)
        n[N_PER_PRESSURE], n[N_PER_SQUARE] = n[N_FULL] / supply, self.tube.per_square
        self.forget()
        self.restart()
        prepare(learn_flow, *self._rows())

    def _rows(self) -> tuple[Any, ...]:
        """The arguments of `learn_flow`."""
        tube = self.tube
        return self._n, self._v, tube.row, *tube.fit.rows, *self._fit.rows

    def forget(self) -> None:
        """Nothing is known."""
        self.tube.forget()
        self._v[V_TUBE] = self.tube.share
        self.forget_flows()

    def forget_flows(self) -> None:
        """Nothing is known but the tube."""
        self._fit.forget()
        bound_weights(self._v, self._fit.weights)
        self._v[V_DELAY] = 0.0

    def restart(self) -> None:
        """Begin anew with the filters; what was learnt is kept."""
        self.tube.restart()
        for place in (V_LATE, V_MOVED, V_TAKEN, V_WARM, V_BEGUN):
            self._v[place] = 0.0
        self._v[V_SINCE] = -self._turn * EVERY

    @property
    def weights(self) -> list[float]:
        """a, b, o, e, z, s, l, t and d [s] within their bounds."""
        return [float(self._v[V_WEIGHTS + place]) for place in range(N_WEIGHTS)]

    @property
    def delay(self) -> float:
        """Delay or lag of the commands beside what the rig file tells [s]."""
        return float(self._v[V_DELAY])

    @property
    def opened(self) -> tuple[float, float]:
        """Opening that nobody commanded [-], and half of its interval of 90 %."""
        opened = float(self._v[V_WEIGHTS + OPENED])
        return opened, QUANTILE * self._fit.deviation(OPENED)

    def update(self) -> None:
        """Learn from the filtered samples; due when `V_SINCE` has reached `EVERY`."""
        if learn_flow(*self._rows()):
            self.forget_flows()  # they were seen through another sensor, as it were
