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
from typing import NamedTuple

from pam_control.control_step import JointTelemetry
from pam_control.feedback.motion_watch import OscillationWatch, TrackingWatch
from pam_control.feedback.swing_watch import Reversals, Swings, SwingWatch
from pam_model.robot import RobotJoint

PAUSE = 0.6  # s after softening or a tube; what is under way with the old loops fades in this time
# A loop that stands still for a larger share of so long oscillates; a smaller one is tolerated,
# because what one pause leaves has faded when the next one comes.
MOST_STILL = 0.3
GAP_MEMORY = 0.5  # s
SMALL, FAST = 0.03, 6.0  # rad, Hz: lower gains are tried first against an oscillation like this;
# a slower one is that of the pressure loops, which only soft gains end
GROWN = 2.0  # of the first swings; smaller ones are less than what soft gains leave
SLOW = 0.8  # of the crossover frequency, below which a loop swings only with friction or a tube


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
        self._oscillation = [OscillationWatch(joint.max_velocity) for joint in joints]
        self._tracking = [TrackingWatch(joint.max_tracking_error) for joint in joints]
        self._swinging = [SwingWatch() for _ in joints]
        self._reversals = [Reversals() for _ in joints]
        self._names = [joint.name for joint in joints]
        self._pause_until = self._swings_fade_until = -math.inf
        self._gaps: deque[tuple[float, float]] = deque()
        self._tubes = [0 for _ in joints]  # muscles that were found to be behind one, by joint
        self._fading_until = [-math.inf for _ in joints]
        self.softened = self.stopped = ""
        self._told: dict[tuple[str, Cause], str] = {}  # swings
        self.lowered, self._first_size = 0, math.inf  # the latter of the first swings, rad

    @property
    def swings(self) -> str:
        """See `LoopGuard`."""
        return "; ".join(self._told.values())

    def clear(self) -> None:
        """Forget everything, after someone has vented the driver."""
        self.softened = self.stopped = ""
        self._told.clear()
        self.lowered, self._first_size = 0, math.inf
        self._pause_until = self._swings_fade_until = -math.inf
        self._gaps.clear()
        self._tubes = [0 for _ in self._names]
        self._fading_until = [-math.inf for _ in self._names]
        self.restart()

    def restart(self) -> None:
        """The joints were taken over: what was seen before belongs to another motion."""
        for watches in (self._oscillation, self._tracking, self._swinging):
            for watch in watches:
                watch.reset()

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

    def _fades(self, index: int, time: float, found: int) -> bool:
        """Whether the oscillation that a tube caused still fades; once for each muscle."""
        if found > self._tubes[index]:
            self._tubes[index], self._fading_until[index] = found, time + PAUSE
            self._oscillation[index].reset()
        return time < self._fading_until[index]

    def judge(
        self,
        time: float,
        joints: Sequence[JointTelemetry],
        tracking_time: float,
        means: Means,
    ) -> GuardAction:
        """Judge the telemetry of a control cycle.

        Parameters
        ----------
        time : float
            Present time [s].
        tracking_time : float
            How long a tracking error may be above its limit [s].
        means : Means
            What can be done.
        """
        answer = self._answer_swings(time, joints, means)
        if answer is not GuardAction.NOTHING:
            return answer
        for index, (joint, oscillation, tracking) in enumerate(
            zip(joints, self._oscillation, self._tracking, strict=True)
        ):
            name, speed = self._names[index], joint.motion.velocity
            error = 0.0 if joint.law.yields else joint.error
            lost = tracking.update(time, error, tracking_time)
            if lost:
                self.stopped = f"{name}: {lost}"
                return GuardAction.STOP
            if joint.law.driven:
                wild = oscillation.too_fast(speed)
            else:
                wild = oscillation.update(time, joint.reference.velocity, speed)
            if self._fades(index, time, joint.behind_tube):
                wild = oscillation.too_fast(speed)
            if not wild or (time < self._pause_until and not self._grows(oscillation)):
                continue
            cycle = self._swinging[index].last_cycle()
            if cycle is not None:
                cause = _cause(cycle, joint.behind_tube, means.crossovers[index])
                wild += f"; likely cause: {cause.value}"
            if self.softened or not means.can_soften:
                even = ", even with soft gains" if means.can_soften else ""
                self.stopped = f"{name}: {wild}{even}"
                return GuardAction.STOP
            self._pause_until = time + PAUSE
            mild = cycle is not None and cycle.size < SMALL and cycle.frequency > FAST
            mild = mild and not oscillation.is_violent
            self.restart()
            if mild and self.lowered < means.steps:
                self.lowered += 1
                self._told.setdefault((name, Cause.DELAY), f"{name}: {wild}")
                return GuardAction.LOWER
            self.softened = f"{name}: {wild}"
            return GuardAction.SOFTEN
        return GuardAction.NOTHING

    def _grows(self, oscillation: OscillationWatch) -> bool:
        """Whether an oscillation becomes violent although gains were lowered."""
        return self.lowered > 0 and not self.softened and oscillation.is_violent

    def _answer_swings(
        self, time: float, joints: Sequence[JointTelemetry], means: Means
    ) -> GuardAction:
        """Tell small swings, and what has to be done against them."""
        changes, rests = 0, True
        for reversals, joint in zip(self._reversals, joints, strict=True):
            velocity, acceleration = joint.reference.velocity, joint.reference.acceleration
            changes += reversals.update(velocity, acceleration)
            rests = rests and velocity == 0.0 and acceleration == 0.0
        verdict = GuardAction.NOTHING
        for name, joint, watch, crossover in zip(
            self._names, joints, self._swinging, means.crossovers, strict=True
        ):
            if joint.law.yields or joint.law.driven:  # others move it
                continue
            seen = watch.update(
                time, joint.error, joint.motion.position, changes, rests, joint.unexplained
            )
            if seen is None or time < max(self._pause_until, self._swings_fade_until):
                continue
            if verdict is GuardAction.NOTHING:
                cause = _cause(seen, joint.behind_tube, crossover)
                told = f"{name}: {_told(seen, cause)}"
                self._told.setdefault((name, cause), told)
                if cause is not Cause.OUTSIDE and (cause not in FRICTION or seen.rests):
                    verdict = self._answer(told, seen, means)
        if verdict is GuardAction.LOWER:  # the other watches go on
            self._swings_fade_until = time + PAUSE
            for watch in self._swinging:
                watch.reset()
        elif verdict is GuardAction.SOFTEN:
            self._pause_until = time + PAUSE
            self.restart()
        return verdict

    def _answer(self, told: str, seen: Swings, means: Means) -> GuardAction:
        if self._first_size == math.inf:
            self._first_size = seen.size
        if self.softened:
            if seen.size < self._first_size:
                return GuardAction.NOTHING
            self.stopped = f"{told}; with soft gains it swings as widely"
            return GuardAction.STOP
        if self.lowered < means.steps:
            self.lowered += 1
            return GuardAction.LOWER
        if not means.can_soften or seen.size < GROWN * self._first_size:
            return GuardAction.NOTHING
        self.softened = told
        return GuardAction.SOFTEN


def _cause(seen: Swings, behind_tube: int, crossover: float) -> Cause:
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
