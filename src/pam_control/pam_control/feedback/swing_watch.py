"""Watches the error of a joint, at rest and in motion, for swings too small for `motion_watch`.

A loop with more delay than its gains bear, with a tube before a muscle, or with dry friction and an
integral, may swing about its reference with an amplitude of some milliradians, whose speed is far
below that of any motion. A few swings tell it: from one turning point to the next the error changes
by about the same way in about the same time, again and again. Settling after a motion fades, a blow
fades, and pushes by hand are not that regular.

In motion a reference causes errors, too: with friction they swing twice or three times for each
change of the direction of its acceleration. So swings count while no reference changes that, begins
or ends.

The noise of a sensor, or an encoder that flickers between two counts, turns the error back all the
time. It bends the error from one sample to the next as no joint can, so a turning point has to
stand out from what bends were seen lately.

At rest, a joint that sticks stands for a large part of the time and jumps in the rest. One that a
delay or a tube keeps swinging moves like a sine about its reference, whose speed is below a fifth
of the largest one in 13 % of the time.

In motion, dry friction ends every swing where the joint stops, however fast the reference is; then
it goes on without turning back. Where the breakaway is soft, it hardly stands, and its cycle
resembles a sine. The swings of a linear loop know nothing of the speed that they are added to: they
turn the joint back, or do not stop it.

Where friction only slows the joint down, the torques tell: those that the model does not explain
take energy from the joint all the time. The work that they take, divided by the way, is the torque
of the friction. A joint without it swings because it is driven late: the torques of its inertia
give back in one half of a swing what they take in the other. Friction is a possible cause if its
torque is larger than those with which the joint swings. A delay remains another one: friction that
does not change with the speed does not damp the swings of a joint that moves on.

Sources: K. J. Astrom and T. Hagglund, Advanced PID Control, ISA 2006, section 10.5 (detection of
oscillating loops by the areas between zero crossings, and stiction by their shape; here by turning
points, because the mean of the error is unknown); T. Hagglund, "A control-loop performance
monitor", Control Engineering Practice 3 (1995) 1543-1551; H. Olsson and K. J. Astrom, "Friction
generated limit cycles", IEEE Transactions on Control Systems Technology 9 (2001) 629-636, and B.
Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, "A survey of models, analysis tools and
compensation methods for the control of machines with friction", Automatica 30 (1994) 1083-1138,
section 4 (stick-slip: the cycle in which the speed comes to zero and stays on one side of it).
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

SWINGS: Final = 4  # this many equal ones in a row are an oscillation
CYCLE: Final = 2  # swings, which tell the cause where another watch has seen an oscillation
LEAST: Final = 3e-3  # rad, from one turning point to the next; smaller ones are harmless
TURN: Final = 1e-3  # rad back from the farthest place make a turning point, at least
ABOVE_NOISE: Final = 1.2  # of the largest bend of the error lately, which a sensor alone makes
LATELY: Final = 1.0  # s
SHORTEST, LONGEST = 0.025, 1.7  # s, duration of a swing: 20 to 0.3 Hz
FADING: Final = 0.7  # the last swing below this share of the first one: the motion fades
UNEVEN: Final = 1.6  # ratio of durations above which two swings are not of one oscillation
UNEQUAL: Final = 1.25  # the same of swings to one side in motion, where both ways may differ
SETTLES: Final = 0.3  # s, of a joint that was taken over
PARTS: Final = 8  # of a swing
STANDS: Final = 0.2  # of the longest way in a part; with a shorter one the joint stands
STUCK: Final = 0.4  # share of the parts in which it stands, by which a joint sticks
STOPS: Final = 0.08  # of the longest way in a quarter of a cycle, on which a joint stops
KEPT: Final = 4.0 * LONGEST  # s

Array = npt.NDArray[np.float64]


class Reversals:
    """Counts the changes of one reference: of the direction of its acceleration, or its end."""

    def __init__(self) -> None:
        self._sign = 0.0
        self._moves = False

    def update(self, velocity: float, acceleration: float) -> int:
        """How many changes there are in this cycle."""
        moves = velocity != 0.0 or acceleration != 0.0
        changes = int(moves != self._moves)
        self._moves = moves
        if acceleration * self._sign < 0.0:
            changes += 1
        if acceleration != 0.0:
            self._sign = math.copysign(1.0, acceleration)
        return changes


class Swing(NamedTuple):
    """From one turning point of the error to the next."""

    # size, duration: [rad], [s]
    size: float
    duration: float
    changes: int  # of the references meanwhile
    rests: bool  # whether all references rested


class Swings(NamedTuple):
    """An oscillation that was seen."""

    size: float  # from one turning point to the next [rad]
    frequency: float  # [Hz]
    rests: bool  # whether the references rested
    sticks: bool  # whether the joint moves as one that sticks
    rubs: bool = False  # whether friction takes more torque than the swings have


class SwingWatch:
    """The turning points of the error of one joint."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget what was seen."""
        self._since = math.inf
        self._direction = 0.0
        self._farthest = self._last = math.nan  # errors: present extreme, and last turning point
        self._reached = self._turned = 0.0  # when they were reached
        self._time = self._before = self._change = math.nan  # of the last sample
        self._bend = 0.0  # largest second difference of the error lately, rad
        self._changes, self._rests = 0, True
        self._swings: deque[Swing] = deque(maxlen=SWINGS)
        self._places: deque[tuple[float, float, float]] = deque()

    def update(
        self,
        time: float,
        error: float,
        position: float,
        changes: int,
        rests: bool,
        torque: float = math.nan,
    ) -> Swings | None:
        """Take a cycle.

        Parameters
        ----------
        time : float
            [s].
        error : float
            Reference minus measured position [rad].
        position : float
            Measured [rad].
        changes : int
            Of all references in this cycle.
        rests : bool
            Whether all references rest.
        torque : float, optional
            Of the muscles, beside that of the model without inertia [N m]; NaN if it is not known.

        Returns
        -------
        Swings or None
            What is seen since the last turning point.
        """
        self._since = min(self._since, time)
        if time - self._since < SETTLES:
            return None
        self._places.append((time, position, torque))
        if self._places[0][0] < time - KEPT:
            self._places.popleft()
        self._changes += changes
        self._rests = self._rests and rests
        turn = self._turning(time, error)
        if math.isnan(self._farthest):
            self._farthest, self._reached = error, time
        ahead = error - self._farthest
        if self._direction == 0.0:
            if abs(ahead) > turn:
                self._direction = math.copysign(1.0, ahead)
                self._last, self._turned = self._farthest, self._reached
                self._farthest, self._reached = error, time
            return None
        if ahead * self._direction > 0.0:
            self._farthest, self._reached = error, time
        if ahead * self._direction >= -turn:
            return None
        size, duration = abs(self._farthest - self._last), self._reached - self._turned
        self._swings.append(Swing(size, duration, self._changes, self._rests))
        self._last, self._turned = self._farthest, self._reached
        self._direction = -self._direction
        self._farthest, self._reached = error, time
        self._changes, self._rests = 0, rests
        return self._seen()

    def _turning(self, time: float, error: float) -> float:
        """How far back from the farthest place is a turning point now [rad]."""
        change, step = error - self._before, time - self._time
        bend = abs(change - self._change)
        if bend >= self._bend:
            self._bend = bend
        elif step > 0.0:
            self._bend *= max(1.0 - step / LATELY, 0.0)
        self._time, self._before, self._change = time, error, change
        return max(TURN, ABOVE_NOISE * self._bend)

    def last_cycle(self) -> Swings | None:
        """The last cycle if it was one of an oscillation, which may grow."""
        return self._seen(CYCLE)

    def _seen(self, count: int = SWINGS) -> Swings | None:
        swings = list(self._swings)[-count:]
        if len(swings) < count or any(
            swing.size < LEAST or not SHORTEST <= swing.duration <= LONGEST for swing in swings
        ):
            return None
        sizes, durations = [swing.size for swing in swings], [swing.duration for swing in swings]
        fades = sizes[-1] < FADING * sizes[0] or min(sizes) < FADING**2 * max(sizes)
        if fades or any(swing.changes for swing in swings):
            return None
        rests = all(swing.rests for swing in swings)
        if not (
            all(_even(*pair, UNEVEN) for pair in pairwise(durations))
            or (
                not rests
                and count > CYCLE
                and all(_even(durations[way], durations[way + 2], UNEQUAL) for way in (0, 1))
            )
        ):
            return None
        lasted = sum(durations)
        times, places, torques = np.array(self._places).T
        at = np.linspace(self._turned - lasted, self._turned, count * PARTS + 1)
        ways = np.diff(np.interp(at, times, places))
        during = (times >= at[0]) & (times <= at[-1])
        return Swings(
            sizes[-1],
            count / (2.0 * lasted),
            rests,
            _sticks(ways, rests),
            _rubs(places[during], torques[during]),
        )


def _sticks(ways: Array, rests: bool) -> bool:
    """Whether a joint at rest stood for most of the time, or one in motion stopped.

    `ways` [rad] are those of equal parts of the time, `PARTS` of each swing.
    """
    if not rests:
        return _stops(ways.reshape(-1, 2 * PARTS))
    return float(np.mean(np.abs(ways) < STANDS * np.abs(ways).max())) > STUCK


def _rubs(places: Array, torques: Array) -> bool:
    """Whether the torques [N m] take more from a joint along its places [rad] than they swing."""
    ways = np.diff(places)
    return float(torques[1:] @ ways) > float(np.std(torques)) * float(np.abs(ways).sum())


def _stops(ways: Array) -> bool:
    """Whether a joint stops in each cycle and does not turn back; ways (cycles, parts) [rad]."""
    onward = ways * np.sign(ways.sum())
    quarters = np.lib.stride_tricks.sliding_window_view(onward, PARTS // 2, axis=1).sum(axis=2)
    return bool(np.all(np.abs(quarters.min(axis=1)) < STOPS * quarters.max(axis=1)))


def _even(one: float, other: float, ratio: float) -> bool:
    return 1.0 / ratio < one / other < ratio
