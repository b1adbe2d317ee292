"""One joint's motion that is repeated: what is added to its torque after each repetition.

During the first repetitions the adaptation learns the rig (`pam_control.adaptation`), and what it
adds is recorded. Then it is played as recorded, so that only one thing changes from one repetition
to the next: the correction, which `LearningFilter` computes from the error after each repetition.

The part of an error that does not repeat would be played with the opposite sign the next time,
in addition to the part of that time. If two errors in a row have a negative inner product, nothing
of them repeats, and the learning rate is reduced: to a half, then a third and so on, so that what
does not repeat averages out. As long as errors repeat, the whole error is learnt.

A joint with friction answers less to a torque than any plant that the filter was designed for, so
that each repetition takes away little of the error. If a share c of an error has come again, a step
1/(1 - c) times as long would have taken all of it away (the secant rule). The next step has this
length, up to `LONGEST_STEP`, unless an error has turned round before.

A repetition that is worse than the best one ends the learning: the correction of the best is used
from then on. Nothing is learnt from a repetition that was interrupted.

Sources: H. Kesten, "Accelerated stochastic approximation", Annals of Mathematical Statistics 29
(1958) 41-59 (a step shrinks only when the error turns round); B. Delyon, A. Juditsky, "Accelerated
stochastic approximation", SIAM Journal on Optimization 3 (1993) 868-881 (by the inner product);
A. C. Aitken, "On Bernoulli's numerical solution of algebraic equations", Proceedings of the Royal
Society of Edinburgh 46 (1926) 289-305 (the secant rule for an error that shrinks by a constant).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from pam_control.references.spline import JointSpline

Array = npt.NDArray[np.float64]

TAIL: Final = 0.3  # s after a motion that belong to it
FADE: Final = 0.5  # s, in which the torque goes over to what is usual, after a motion
WORSE: Final = 1.05  # times the best error ends the learning,
NOISE: Final = 5e-5  # rad; if it is more than this as well
PATH_STEP: Final = 1e-2  # rad; motions that differ by less are the same
PLACES: Final = 40  # of a trajectory that are compared before it is played
LONGEST_STEP: Final = 2.0  # |1 - 2 L P| < 1 for whatever answers less than L was designed for
GAP: Final = 0.05  # s without a control cycle; a repetition with one teaches nothing


class Filter(Protocol):
    """What computes the next correction."""

    def next_torque(self, torque: Array, error: Array, period: float) -> Array:
        """The torque of the next repetition [N m] from the last one and its error [rad]."""
        ...


@dataclass(frozen=True, slots=True)
class Learnt:
    """What is played in a repetition, one value per period."""

    path: Array  # positions of the reference, by which the motion is known again [rad]
    base: Array  # torque that the adaptation had added [N m]
    correction: Array  # torque that the repetitions added [N m]
    error: float = math.nan  # RMS error with it [rad]; NaN before it was played

    def is_of(self, path: Array) -> bool:
        """Whether it belongs to this motion."""
        common = min(path.size, self.path.size)
        return abs(path.size - self.path.size) <= 1 and bool(
            np.abs(path[:common] - self.path[:common]).max(initial=0.0) < PATH_STEP
        )


@dataclass(slots=True)
class RepetitionRecord:
    """One repetition while it runs: times since its start [s], and values at these times."""

    times: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    base: list[float] = field(default_factory=list)
    path: list[float] = field(default_factory=list)

    def sampled(self, period: float) -> tuple[Array, Array, Array] | None:
        """Errors, base and path, one value per period [s]; None if control cycles are missing."""
        times = np.array(self.times)
        if times.size < 2 or float(np.diff(times).max()) > GAP:
            return None
        grid = period * np.arange(math.floor(times[-1] / period + 0.5))
        errors, base, path = (
            np.interp(grid, times, values) for values in (self.errors, self.base, self.path)
        )
        return errors, base, path


class RepeatedMotion:
    """Learns one motion of one joint.

    Parameters
    ----------
    filter : Filter
        Computes the next correction.
    period : float
        Of the control loop [s].
    warm_up : int
        Repetitions in which the adaptation learns.
    known : Learnt, optional
        From an earlier session.

    Attributes
    ----------
    history : list of float
        RMS errors of all repetitions [rad].
    ended : str
        Why nothing more is learnt; empty while learning.
    share : float
        Of an error that is learnt [-].
    """

    def __init__(
        self, filter: Filter, period: float, warm_up: int, known: Learnt | None = None
    ) -> None:
        self._filter, self._period, self._warm_up = filter, period, warm_up
        self.played = known
        self.best = known
        self.history: list[float] = []
        self.ended = ""
        self.share = 1.0
        self._before: Array = np.zeros(0)  # error of the repetition before

    def refuse(self) -> None:
        """Note that another motion was played under this name."""
        self.ended = "another motion was played under this name"

    def is_of(self, spline: JointSpline, tail: float) -> bool:
        """Whether a trajectory is the one that is known; true if none is known."""
        if self.played is None:
            return True
        path = self.played.path
        if abs(spline.end_time - spline.start_time + tail - path.size * self._period) > 0.02:
            return False
        places = np.linspace(0, path.size - 1, PLACES).astype(int).tolist()
        return all(
            abs(spline.sample(spline.start_time + self._period * k).position - path[k]) < PATH_STEP
            for k in places
        )

    def corrected(self, since: float) -> tuple[float, float] | None:
        """Base and correction [N m] at a time since the start of the motion; None: nothing known.

        Before and after the motion the values at its ends hold.
        """
        if self.played is None:
            return None
        index = max(0, min(round(since / self._period), self.played.base.size - 1))
        return float(self.played.base[index]), float(self.played.correction[index])

    def take(self, recording: RepetitionRecord) -> None:
        """Learn from a complete repetition."""
        sampled = recording.sampled(self._period)
        if sampled is None:
            return
        error, base, path = sampled
        rms = float(np.sqrt(np.mean(error**2)))
        if self.played is not None and not self.played.is_of(path):
            self.refuse()
            return
        self.history.append(rms)
        if self.played is None:
            if len(self.history) >= self._warm_up:
                self.played = Learnt(path, base, np.zeros_like(base), rms)
                self._go_on(self.played, error)
            return
        if self.ended:
            return
        tried = Learnt(self.played.path, self.played.base, self.played.correction, rms)
        least = math.inf if self.best is None or math.isnan(self.best.error) else self.best.error
        if rms > max(WORSE * least, least + NOISE):
            self.played = self.best
            self.ended = (
                f"repetition {len(self.history)} had {1e3 * rms:.2f} mrad, the best one "
                f"{1e3 * least:.2f} mrad, which is used from now on"
            )
            return
        self._go_on(tried, error)

    def _go_on(self, tried: Learnt, error: Array) -> None:
        if self.best is None or not tried.error >= self.best.error:
            self.best = tried
        learnt = self._step(error) * error
        count = min(tried.correction.size, error.size)  # by a period more or less
        correction = np.zeros_like(tried.correction)
        correction[:count] = self._filter.next_torque(
            tried.correction[:count], learnt[:count], self._period
        )
        self.played = Learnt(tried.path, tried.base, correction)

    def _step(self, error: Array) -> float:
        """How many times an error [rad] is learnt, by what of the one before has come again."""
        common = min(error.size, self._before.size)
        before, self._before = self._before[:common], error
        size = float(before @ before)
        again = float(error[:common] @ before) / size if size > 0.0 else 0.0
        if again < 0.0:
            self.share = 1.0 / (1.0 / self.share + 1.0)
        if self.share < 1.0:
            return self.share
        return 1.0 / max(1.0 - again, 1.0 / LONGEST_STEP)
