"""What the controller does when its loops oscillate, do not follow or pause: soften, then stop.

First the gains are replaced by a safe set, which is designed for a much larger delay. The safe set
stays until the driver has been vented, since the delay still exists. If the joint still
oscillates after a pause, or follows its reference with too large an error, the controller stops.
The oscillation that a tube in front of a muscle causes until it is found also gets a pause to fade,
because the pressure loops change then.

Swings that are too small for that are told with their likely cause, and answered step by step,
because the safe gains leave larger errors of friction and load: the gains are lowered, and lowered
again while the swings go on; if they have grown to twice the first ones, the safe gains are used,
and a joint that swings with these as widely as at first is stopped. A delay makes a loop swing at
its crossover frequency or above. What is slower and does not stick comes from outside, and lower
gains would yield more to it. So would a joint that sticks or rubs in motion: with softer feedback
it stands longer and jumps farther. At rest it is the integral that makes it jump. Where it rubs
and does not stick, friction and a delay cannot be told apart while it moves, and both are told.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from enum import Enum
from typing import Any, NamedTuple

import numpy as np

from pam_control.feedback.motion_watch import (
    FAST,
    LOST,
    NOTHING,
    begin_oscillation,
    begin_tracking,
    is_fast,
    is_lost,
    is_violent,
    watch_oscillation,
    what_was_found,
)
from pam_control.feedback.swing_watch import (
    CYCLE,
    Swings,
    begin_swings,
    last_swings,
    reference_changes,
    watch_swings,
)
from pam_control.plan_memory import Rings
from pam_control.rows.telemetry_rows import (
    Z_DRIVEN,
    Z_ERROR,
    Z_POSITION,
    Z_PRESSURES,
    Z_REFERENCE_PUSH,
    Z_REFERENCE_SPEED,
    Z_SPEED,
    Z_TUBES,
    Z_UNEXPLAINED,
    Z_YIELDS,
)
from pam_control.rows.watch_rows import (
    B_FADES_UNTIL,
    B_FOUND,
    B_LARGEST_ERROR,
    B_LARGEST_SPEED,
    B_SWUNG,
    B_TUBES,
    N_WATCH,
    SWINGS,
)
from pam_model.plant.compiled import entry_point, for_kernel, prepare
from pam_model.robot import RobotJoint

PAUSE = 0.6  # s after other gains or a tube; what is under way with the old loops fades in it
# A loop that stands still for a larger share of so long oscillates; a smaller one is tolerated,
# because what one pause leaves has faded when the next one comes.
MOST_STILL = 0.3
GAP_MEMORY = 0.5  # s
MILD, QUICK = 0.03, 6.0  # rad, Hz: lower gains are tried first against an oscillation like this;
# a slower one is that of the pressure loops, which only soft gains end
GROWN = 2.0  # of the first swings; smaller ones are less than what soft gains leave
SLOW = 0.8  # of the crossover frequency, below which a loop swings only with friction or a tube
PLACES, PEAKS = 8192, 1024
"""For how many cycles there is room at first of what `swing_watch` and `motion_watch` keep."""
SOME_SWUNG, ALL_WELL = -2, -1
"""What `watch_joints` returns instead of the number of a joint."""


class GuardAction(Enum):
    """What the controller has to do."""

    NOTHING = "nothing"
    LOWER = "lower"
    SOFTEN = "soften"
    STOP = "stop"


class Cause(Enum):
    """Why a joint swings."""

    TUBE = "a tube between valve and muscle"
    STICKING = "dry friction that sticks, with the integral of the feedback"
    RUBBING = "dry friction or hysteresis, which takes much of the torque; or a delay as well"
    OUTSIDE = "an outside torque that swings: the loop itself could not swing so slowly"
    DELAY = "a delay that the rig file does not name"


FRICTION = {Cause.STICKING, Cause.RUBBING}


class Means(NamedTuple):
    """What can be done, and how the loops are."""

    can_soften: bool  # whether there are safe gains
    steps: int  # how often the normal gains can be lowered
    # least crossover frequency of each joint's loop with the normal gains [rad/s]
    crossovers: Sequence[float]


def swings_end(time: float, z: Any, b: Any, places: Any, ends: Any) -> bool:
    """Watch the errors of all joints; return whether a swing of one, `B_SWUNG`, has ended."""
    changes, rests, some = 0.0, 1.0, False
    for i in range(len(z)):
        velocity, acceleration = z[i][Z_REFERENCE_SPEED], z[i][Z_REFERENCE_PUSH]
        changes += reference_changes(b[i], velocity, acceleration)
        if velocity != 0.0 or acceleration != 0.0:
            rests = 0.0
    for i in range(len(z)):
        b[i][B_SWUNG] = 0.0
        # a joint that others move is not watched
        if z[i][Z_YIELDS] == z[i][Z_DRIVEN] == 0.0 and watch_swings(
            b[i], places[i], ends[i], time, z[i][Z_ERROR], z[i][Z_POSITION], changes, rests,
            z[i][Z_UNEXPLAINED],
        ):  # fmt: skip
            b[i][B_SWUNG], some = 1.0, True
    return some


def watch_motion(z: Any, b: Any, peaks: Any, ends: Any, time: float, longest: float) -> int:
    """Watch the error and the speed of a joint; return what is found."""
    if is_lost(b, time, 0.0 if z[Z_YIELDS] > 0.0 else z[Z_ERROR], longest):
        return LOST
    speed, found = z[Z_SPEED], NOTHING
    if z[Z_DRIVEN] == 0.0:
        found = watch_oscillation(b, peaks, ends, time, z[Z_REFERENCE_SPEED], speed)
    if z[Z_TUBES] > b[B_TUBES]:  # once for each muscle
        b[B_TUBES], b[B_FADES_UNTIL] = z[Z_TUBES], time + PAUSE
        begin_oscillation(b, ends)
    if z[Z_DRIVEN] > 0.0 or time < b[B_FADES_UNTIL]:
        found = FAST if is_fast(b, speed, 0.0) else NOTHING
    return found


@entry_point
def watch_joints(
    first: int, time: float, longest: float, z: Any, b: Any, places: Any, place_ends: Any,
    peaks: Any, peak_ends: Any,
) -> int:  # fmt: skip
    """Watch the joints in a cycle.

    Parameters
    ----------
    first : int
        The first joint whose motion is watched; a negative one begins the cycle.
    time, longest : float
        Present time, and how long a tracking error may be above its limit [s].
    z, b, places, place_ends, peaks, peak_ends : rows
        Of all joints: telemetry and watches, and the rings of both watches.

    Returns
    -------
    int
        The next joint with which something is wrong, `B_FOUND`; or `SOME_SWUNG`, after which the
        motions of all joints are still to be watched; or `ALL_WELL`.
    """
    if first < 0 and swings_end(time, z, b, places, place_ends):
        return SOME_SWUNG
    for i in range(max(first, 0), len(z)):
        b[i][B_FOUND] = watch_motion(z[i], b[i], peaks[i], peak_ends[i], time, longest)
        if b[i][B_FOUND] != NOTHING:
            return i
    return ALL_WELL


class LoopGuard:
    """The watches of all joints.

    Parameters
    ----------
    joints : sequence of RobotJoint
        The joints, with their limits.

    Attributes
    ----------
    softened, stopped : str
        Why the safe gains are used, and why the controller has stopped; empty if it has not.
    swings : str
        Which joints have swung since the last vent, and why, each cause once; empty if none has.
    lowered : int
        How often the gains are to be lowered because of swings.
    """

    def __init__(self, joints: Sequence[RobotJoint]) -> None:
        count = len(joints)
        self._watches = for_kernel(np.zeros((count, N_WATCH)))
        self._places, self._peaks = Rings(count, 3, PLACES), Rings(count, 2, PEAKS)
        for b, joint in zip(self._watches, joints, strict=True):
            b[B_LARGEST_SPEED], b[B_LARGEST_ERROR] = joint.max_velocity, joint.max_tracking_error
        self._names = [joint.name for joint in joints]
        self._pause_until = -math.inf
        self._gaps: deque[tuple[float, float]] = deque()
        self.softened = self.stopped = ""
        self._told: dict[tuple[str, Cause], str] = {}  # swings
        self.lowered, self._first_size = 0, math.inf  # the latter of the first swings, rad
        self._forget_tubes()
        self.restart()
        telemetry = for_kernel(np.zeros((count, Z_PRESSURES)))
        prepare(watch_joints, -1, 0.0, 0.0, telemetry, *self._rows())

    def _rows(self) -> tuple[Any, ...]:
        """The last arguments of `watch_joints`."""
        places, peaks = self._places, self._peaks
        return self._watches, places.rows, places.ends, peaks.rows, peaks.ends

    def _forget_tubes(self) -> None:
        for b in self._watches:
            b[B_TUBES], b[B_FADES_UNTIL] = 0.0, -math.inf

    @property
    def swings(self) -> str:
        """See `LoopGuard`."""
        return "; ".join(self._told.values())

    def clear(self) -> None:
        """Forget everything, after someone has vented the driver."""
        self.softened = self.stopped = ""
        self._told.clear()
        self.lowered, self._first_size = 0, math.inf
        self._pause_until = -math.inf
        self._gaps.clear()
        self._forget_tubes()
        self.restart()

    def restart(self) -> None:
        """The joints were taken over: what was seen before belongs to another motion."""
        self._forget_motions()
        self._forget_swings()

    def _forget_motions(self) -> None:
        for b, ends in zip(self._watches, self._peaks.ends, strict=True):
            begin_tracking(b)
            begin_oscillation(b, ends)

    def _forget_swings(self) -> None:
        for b, ends in zip(self._watches, self._places.ends, strict=True):
            begin_swings(b, ends)

    def watch_gaps(self, time: float, gap: float, longest: float) -> str:
        """Stop a loop that stands still again and again; return why, or an empty text.

        No gains are stable with such gaps: the joint oscillates, with soft gains as well.

        Parameters
        ----------
        time, gap : float
            Present time, and time since the last control cycle [s].
        longest : float
            A gap above this counts [s].
        """
        if gap <= longest:
            return ""
        gaps = self._gaps
        gaps.append((time, gap))
        while gaps[0][0] <= time - GAP_MEMORY:
            gaps.popleft()
        if len(gaps) > 1 and sum(one for _, one in gaps) > MOST_STILL * GAP_MEMORY:
            self.stopped = (
                f"the control loop paused {len(gaps)} times for more than {1e3 * longest:.0f} ms "
                f"within {GAP_MEMORY:g} s: the host is too slow"
            )
        return self.stopped

    def judge(self, time: float, telemetry: Any, tracking_time: float, means: Means) -> GuardAction:
        """Judge the telemetry of a control cycle.

        Parameters
        ----------
        time : float
            Present time [s].
        telemetry : rows
            Of all joints (`telemetry_rows`).
        tracking_time : float
            How long a tracking error may be above its limit [s].
        means : Means
            What can be done.
        """
        self._places.make_room()
        self._peaks.make_room()
        rows = (time, tracking_time, telemetry, *self._rows())
        found = watch_joints(-1, *rows)
        if found == SOME_SWUNG:
            answer = self._answer_swings(time, telemetry, means)
            if answer is not GuardAction.NOTHING:
                return answer
            found = watch_joints(0, *rows)
        while found != ALL_WELL:
            answer = self._answer_motion(found, time, telemetry[found], means)
            if answer is not GuardAction.NOTHING:
                return answer
            found = watch_joints(found + 1, *rows)
        return GuardAction.NOTHING

    def _answer_motion(self, joint: int, time: float, z: Any, means: Means) -> GuardAction:
        """What has to be done against what was found of the motion of a joint."""
        b, name = self._watches[joint], self._names[joint]
        wild = what_was_found(b, time, z[Z_ERROR], z[Z_SPEED])
        if b[B_FOUND] == LOST:
            self.stopped = f"{name}: {wild}"
            return GuardAction.STOP
        grows = self.lowered > 0 and not self.softened and is_violent(b)
        if time < self._pause_until and not grows:
            return GuardAction.NOTHING
        cycle = self._seen(joint, CYCLE)
        if cycle is not None:
            cause = _cause(cycle, z[Z_TUBES] > 0.0, means.crossovers[joint])
            wild += f"; likely cause: {cause.value}"
        if self.softened or not means.can_soften:
            even = ", even with soft gains" if means.can_soften else ""
            self.stopped = f"{name}: {wild}{even}"
            return GuardAction.STOP
        self._pause_until = time + PAUSE
        mild = cycle is not None and cycle.size < MILD and cycle.frequency > QUICK
        mild = mild and not is_violent(b)
        self._forget_motions()
        if mild and self.lowered < means.steps:
            self.lowered += 1
            self._told.setdefault((name, Cause.DELAY), f"{name}: {wild}")
            return GuardAction.LOWER
        self.softened = f"{name}: {wild}"
        self._forget_swings()
        return GuardAction.SOFTEN

    def _seen(self, joint: int, count: int) -> Swings | None:
        """The oscillation that the last swings of a joint are of."""
        places = self._places
        return last_swings(self._watches[joint], places.rows[joint], places.ends[joint], count)

    def _answer_swings(self, time: float, telemetry: Any, means: Means) -> GuardAction:
        """Tell small swings, and what has to be done against them."""
        verdict = GuardAction.NOTHING
        if time < self._pause_until:
            return verdict
        for joint, (name, z) in enumerate(zip(self._names, telemetry, strict=True)):
            if self._watches[joint][B_SWUNG] == 0.0:
                continue
            seen = self._seen(joint, SWINGS)
            if seen is not None and verdict is GuardAction.NOTHING:
                cause = _cause(seen, z[Z_TUBES] > 0.0, means.crossovers[joint])
                told = f"{name}: {_told(seen, cause)}"
                self._told.setdefault((name, cause), told)
                if cause is not Cause.OUTSIDE and (cause not in FRICTION or seen.rests):
                    verdict = self._answer(told, seen, means)
        if verdict in (GuardAction.LOWER, GuardAction.SOFTEN):
            self._pause_until = time + PAUSE
            self.restart()
        return verdict

    def _answer(self, told: str, seen: Swings, means: Means) -> GuardAction:
        if self._first_size == math.inf:
            self._first_size = seen.size
        if self.softened:
            if seen.size < max(self._first_size, MILD):
                return GuardAction.NOTHING
            self.stopped = f"{told}; with soft gains it swings as widely"
            return GuardAction.STOP
        if self.lowered < means.steps:
            self.lowered += 1
            return GuardAction.LOWER
        if not means.can_soften or seen.size < max(GROWN * self._first_size, MILD):
            return GuardAction.NOTHING
        self.softened = told
        return GuardAction.SOFTEN


def _cause(seen: Swings, behind_tube: bool, crossover: float) -> Cause:
    """The likely cause of swings, in a loop with this crossover frequency [rad/s]."""
    if behind_tube:
        return Cause.TUBE
    if seen.sticks:
        return Cause.STICKING
    if seen.rubs:
        return Cause.RUBBING
    if 2.0 * math.pi * seen.frequency < SLOW * crossover:
        return Cause.OUTSIDE
    return Cause.DELAY


def _told(seen: Swings, cause: Cause) -> str:
    """What is told of swings that were seen."""
    where = "at rest" if seen.rests else "in motion"
    return (
        f"the joint swings {where} by {1e3 * seen.size:.1f} mrad at {seen.frequency:.2g} Hz; "
        f"likely cause: {cause.value}"
    )
