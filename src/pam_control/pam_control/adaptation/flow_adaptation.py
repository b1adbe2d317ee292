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

Both sides pass the same slow filter, so that neither a pressure nor a flow is differentiated. Where
the sensor is found to be before a tube (`TubeSearch`), the loss in it is subtracted from what it
shows.

Source: P. Beater, Pneumatic Drives, Springer 2007, chapters 5 and 6 (paths and overlap of a valve,
chamber). The form of the fit is derived here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pam_control.adaptation.recursive_fit import RecursiveFit, Suspect
from pam_control.adaptation.tube_search import TubeSearch
from pam_control.limited import limited

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


@dataclass(slots=True)
class FlowSample:
    """One control cycle of a valve.

    Attributes
    ----------
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

    promised: float
    capacity: float
    pressure: float
    lost: float
    per_rate: float
    moved: float
    delay: float


class FlowAdaptation:
    """Learns and corrects the flow of one valve.

    Parameters
    ----------
    full_flow : float
        Of the open valve from the supply [kg/s].
    supply : float
        Its pressure [Pa absolute].
    turn : float, optional
        Part of the time between two updates after which the first one is due, so that several
        valves do not compute theirs in one control cycle [-].
    tube : float, optional
        Squared conductance of the valve over that of the tube that the rig file names [-].

    Attributes
    ----------
    delay : float
        Delay or lag of the commands beside what the rig file tells [s].
    tube : TubeSearch
        Whether the sensor is before a tube.
    """

    def __init__(
        self, full_flow: float, supply: float, turn: float = 0.0, tube: float = 0.0
    ) -> None:
        self._full, self._per_pressure, self._turn = full_flow, full_flow / supply, turn
        self._fit = RecursiveFit(DEVIATIONS, NOISE, TRIFLE, LATE, LEAK)
        self.tube = TubeSearch(full_flow, supply, tube)
        self.forget()
        self.restart()

    def forget(self) -> None:
        """Nothing is known."""
        self.tube.forget()
        self.forget_flows()

    def forget_flows(self) -> None:
        """Nothing is known but the tube."""
        self._fit.forget()
        self._bound()
        self.delay = 0.0

    def restart(self) -> None:
        """Begin anew with the filters; what was learnt is kept."""
        self.tube.restart()
        self._smooth: list[float] = []
        self._late = self._moved = self._taken = self._warm = 0.0
        self._since = -self._turn * EVERY

    @property
    def weights(self) -> list[float]:
        """a, b, o, e, z, s, l, t and d [s] within their bounds."""
        return self._weights

    def _bound(self) -> None:
        self._weights = [
            max(low, min(high, weight))
            for low, high, weight in zip(LOWEST, HIGHEST, self._fit.weights, strict=True)
        ]

    @property
    def opened(self) -> tuple[float, float]:
        """Opening that nobody commanded [-], and half of its interval of 90 %."""
        return self._weights[OPENED], QUANTILE * self._fit.deviation(OPENED)

    @property
    def least_share(self) -> float:
        """Flow over promised flow in the worse direction, at most 1 [-]."""
        a, b, *_ = self._weights
        return max(1.0 + min(a - self._droop, b, 0.0), LEAST_SHARE)

    @property
    def _droop(self) -> float:
        """Share of the flow that the supply lacks now [-]."""
        return min(self._weights[5] * self._taken, MOST_DROOP)

    def corrected(self, flow: float, moved: float, capacity: float, pressure: float) -> float:
        """The flow to ask the valve's data for, so that the valve gives `flow` [kg/s].

        Parameters
        ----------
        flow : float
            Wanted [kg/s].
        moved : float
            The part of it that the motion of the muscle takes [kg/s].
        capacity : float
            Full flow in its direction [kg/s].
        pressure : float
            In the muscle [Pa absolute].
        """
        a, b, o, e, z, _, leak, wall, _ = self._weights
        left = flow - o * capacity - e * moved - wall * self._warm
        left += leak * self._per_pressure * pressure
        left -= z * capacity * limited(left / (USED_EDGE * capacity), -1.0, 1.0)
        return left / max(1.0 + (a - self._droop if left > 0.0 else b), LEAST_SHARE)

    def learn(self, step: float, sample: FlowSample) -> None:
        """Take a sample, `step` [s] after the last one."""
        if step <= 0.0:
            return
        share = step / (max(sample.delay, 0.0) + step)
        self._late += share * (sample.promised - self._late)
        self._moved += share * (sample.moved - self._moved)
        u, c = self._late, sample.capacity
        overlap = c * limited(u / (LEARNT_EDGE * c), -1.0, 1.0)
        up, down = (u, 0.0) if u > 0.0 else (0.0, u)
        self._taken += step / LATELY * (up / self._full - self._taken)
        drooped = -up * self._taken
        self._warm += step / (WALL + step) * (u - self._moved - self._warm)
        leaking = -self._per_pressure * sample.pressure
        still = (overlap, drooped, leaking, self._warm)
        inside = sample.pressure - sample.lost
        lost = self.tube.unit_loss(u, sample.pressure)
        raw = (inside, sample.pressure, lost, up, down, c, self._moved, *still)
        weight = step / (FILTER + step)
        # without `strict`, which would take as long as the rest
        pairs = zip(self._smooth or raw, raw)  # noqa: B905
        self._smooth = [smooth + weight * (now - smooth) for smooth, now in pairs]
        self._since += step
        wanted = min(self._fit.weights[-1], LONGEST_DELAY)
        wanted = wanted if wanted > LEAST_DELAY else 0.0
        reach = DELAY_RATE * step
        self.delay += limited(wanted - self.delay, -reach, reach)
        if self._since < EVERY:
            return
        slow, shown, lost, up, down, _, moved = self._smooth[:7]
        per_rate = sample.per_rate
        known = self.tube.share > 0.0
        rates = (up / per_rate, down / per_rate, moved / per_rate)
        works = up - down > LEAST_WORK * self._full
        self.tube.update(self._since, shown, rates, lost, works)
        if known != (self.tube.share > 0.0):
            self.forget_flows()  # they were seen through another sensor, as it were
        elif works:
            seen = per_rate * (inside - slow) / FILTER + moved
            functions = np.array((*self._smooth[3:], (up + down - u) / FILTER)) / self._full
            self._fit.update(functions, (seen - up - down) / self._full, self._since)
            self._bound()
        self._since = 0.0
