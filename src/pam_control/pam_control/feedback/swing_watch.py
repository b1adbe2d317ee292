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
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pam_control.plan_memory import newest
from pam_control.rows.watch_rows import (
    B_BEGAN,
    B_BEND,
    B_CHANGE,
    B_CHANGES,
    B_DIRECTION,
    B_ERROR,
    B_FARTHEST,
    B_LAST,
    B_LAST_AT,
    B_MOVES,
    B_N_SWINGS,
    B_PUSH_SIGN,
    B_REACHED_AT,
    B_RESTS,
    B_SWINGS,
    B_SWUNG,
    B_TIME,
    N_SWING,
    SWING_CHANGES,
    SWING_DURATION,
    SWING_RESTS,
    SWING_SIZE,
    SWINGS,
)

CYCLE: Final = 2  # swings, which tell the cause where another watch has seen an oscillation
LEAST: Final = 3e-3  # rad, from one turning point to the next; smaller ones are harmless
TURN: Final = 1e-3  # rad back from the farthest place make a turning point, at least
ABOVE_NOISE: Final = 1.2  # of the largest bend of the error lately, which a sensor alone makes
LATELY: Final = 1.0  # s
SHORTEST, LONGEST = 0.025, 1.7  # s, duration of a swing: 20 to 0.3 Hz
FADING: Final = 0.7  # the last swing below this share of an earlier one: the motion fades
UNEVEN: Final = 1.6  # ratio of durations above which two swings are not of one oscillation
UNEQUAL: Final = 1.25  # the same of swings to one side in motion, where both ways may differ
SETTLES: Final = 0.3  # s, of a joint that was taken over
PARTS: Final = 8  # of a swing
STANDS: Final = 0.2  # of the longest way in a part; with a shorter one the joint stands
STUCK: Final = 0.4  # share of the parts in which it stands, by which a joint sticks
STOPS: Final = 0.08  # of the longest way in a quarter of a cycle, on which a joint stops
KEPT: Final = 4.0 * LONGEST  # s

Array = npt.NDArray[np.float64]


def reference_changes(b: Any, velocity: float, acceleration: float) -> float:
    """How many changes of a reference there are: of its acceleration's direction, or its end."""
    moves = 1.0 if velocity != 0.0 or acceleration != 0.0 else 0.0
    changes = 1.0 if moves != b[B_MOVES] else 0.0
    b[B_MOVES] = moves
    if acceleration * b[B_PUSH_SIGN] < 0.0:
        changes += 1.0
    if acceleration != 0.0:
        b[B_PUSH_SIGN] = math.copysign(1.0, acceleration)
    return changes


def begin_swings(b: Any, ends: Any) -> None:
    """Forget what was seen of the error; `ends` are those of the places of the joint."""
    b[B_BEGAN], b[B_DIRECTION] = math.inf, 0.0
    b[B_FARTHEST] = b[B_LAST] = math.nan
    b[B_REACHED_AT] = b[B_LAST_AT] = 0.0
    b[B_TIME] = b[B_ERROR] = b[B_CHANGE] = math.nan
    b[B_BEND], b[B_CHANGES], b[B_RESTS] = 0.0, 0.0, 1.0
    b[B_SWUNG] = b[B_N_SWINGS] = 0.0
    ends[0], ends[1] = 0, 0


def watch_swings(
    b: Any, places: Any, ends: Any, time: float, error: float, position: float, changes: float,
    rests: float, torque: float,
) -> bool:  # fmt: skip
    """Take a cycle; return whether a swing has ended, so that `last_swings` may see something.

    Parameters
    ----------
    b, places, ends : row, rows, (int, int)
        Of the joint (`watch_rows`), and of where it was lately: time, position, torque.
    time : float
        [s].
    error : float
        Reference minus measured position [rad].
    position : float
        Measured [rad].
    changes : float
        Of all references in this cycle.
    rests : float
        Whether all references rest.
    torque : float
        Of the muscles, beside that of the model without inertia [N m]; NaN if it is not known.
    """
    b[B_BEGAN] = min(b[B_BEGAN], time)
    if time - b[B_BEGAN] < SETTLES:
        return False
    ends[1] += 1
    row = places[newest(places, ends)]
    row[0], row[1], row[2] = time, position, torque
    if places[ends[0]][0] < time - KEPT:
        ends[0] = (ends[0] + 1) % len(places)
        ends[1] -= 1
    b[B_CHANGES] += changes
    b[B_RESTS] = min(b[B_RESTS], rests)
    turn = turning_way(b, time, error)
    if math.isnan(b[B_FARTHEST]):
        b[B_FARTHEST], b[B_REACHED_AT] = error, time
    ahead = error - b[B_FARTHEST]
    if b[B_DIRECTION] == 0.0:
        if abs(ahead) > turn:
            b[B_DIRECTION] = math.copysign(1.0, ahead)
            turn_round(b, time, error)
        return False
    if ahead * b[B_DIRECTION] > 0.0:
        b[B_FARTHEST], b[B_REACHED_AT] = error, time
    if ahead * b[B_DIRECTION] >= -turn:
        return False
    if b[B_N_SWINGS] == SWINGS:
        for at in range(B_SWINGS, B_SWINGS + (SWINGS - 1) * N_SWING):
            b[at] = b[at + N_SWING]
        b[B_N_SWINGS] -= 1.0
    at = B_SWINGS + int(b[B_N_SWINGS]) * N_SWING
    b[B_N_SWINGS] += 1.0
    b[at + SWING_SIZE] = abs(b[B_FARTHEST] - b[B_LAST])
    b[at + SWING_DURATION] = b[B_REACHED_AT] - b[B_LAST_AT]
    b[at + SWING_CHANGES], b[at + SWING_RESTS] = b[B_CHANGES], b[B_RESTS]
    b[B_DIRECTION] = -b[B_DIRECTION]
    turn_round(b, time, error)
    b[B_CHANGES], b[B_RESTS] = 0.0, rests
    return True


def turn_round(b: Any, time: float, error: float) -> None:
    """Let the farthest error be the last turning point, and go on from this one [rad]."""
    b[B_LAST], b[B_LAST_AT] = b[B_FARTHEST], b[B_REACHED_AT]
    b[B_FARTHEST], b[B_REACHED_AT] = error, time


def turning_way(b: Any, time: float, error: float) -> float:
    """How far back from the farthest place is a turning point now [rad]."""
    change, step = error - b[B_ERROR], time - b[B_TIME]
    bend = abs(change - b[B_CHANGE])
    if bend >= b[B_BEND]:
        b[B_BEND] = bend
    elif step > 0.0:
        b[B_BEND] *= max(1.0 - step / LATELY, 0.0)
    b[B_TIME], b[B_ERROR], b[B_CHANGE] = time, error, change
    return float(max(TURN, ABOVE_NOISE * b[B_BEND]))


class Swings(NamedTuple):
    """An oscillation that was seen."""

    size: float  # from one turning point to the next [rad]
    frequency: float  # [Hz]
    rests: bool  # whether the references rested
    sticks: bool  # whether the joint moves as one that sticks
    rubs: bool = False  # whether friction takes more torque than the swings have


def last_swings(b: Any, places: Any, ends: Any, count: int = SWINGS) -> Swings | None:
    """The oscillation of which the last swings of a joint are, if they are of one.

    `CYCLE` of them may grow.
    """
    kept = int(b[B_N_SWINGS])
    if kept < count:
        return None
    swings = [
        [float(b[B_SWINGS + number * N_SWING + place]) for place in range(N_SWING)]
        for number in range(kept - count, kept)
    ]
    sizes, durations, changes, rested = zip(*swings, strict=True)
    if not all(size >= LEAST for size in sizes) or not all(
        SHORTEST <= duration <= LONGEST for duration in durations
    ):
        return None
    rests = all(rested)
    # at rest, the end of the motion may have been the first swing, and the next one the largest
    whole = max(sizes) if rests else sizes[0]
    fades = sizes[-1] < FADING * whole or min(sizes) < FADING**2 * max(sizes)
    if fades or any(changes):
        return None
    if not (
        all(_even(*pair, UNEVEN) for pair in pairwise(durations))
        or (
            not rests
            and count > CYCLE
            and all(_even(durations[way], durations[way + 2], UNEQUAL) for way in (0, 1))
        )
    ):
        return None
    lasted, until = sum(durations), float(b[B_LAST_AT])
    first, last = int(ends[0]), int(ends[0] + ends[1])
    order = np.arange(first, last) % len(places)
    times, where, torques = np.asarray(places)[order].T
    at = np.linspace(until - lasted, until, count * PARTS + 1)
    ways = np.diff(np.interp(at, times, where))
    during = (times >= at[0]) & (times <= at[-1])
    return Swings(
        sizes[-1],
        count / (2.0 * lasted),
        rests,
        _sticks(ways, rests),
        _rubs(where[during], torques[during]),
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
