"""Follows the trajectories of a joint, and lets a `RepeatedMotion` record and correct them.

The correction is computed in a thread of its own, since it takes milliseconds; the control cycle
only looks values up. A trajectory that begins before the computation has ended is played as the
one before, and is not learnt from.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

from pam_control.learning.repeated_motion import FADE, TAIL, RepeatedMotion, RepetitionRecord
from pam_control.references.spline import JointSpline

_WORKER = ThreadPoolExecutor(1, thread_name_prefix="learning")


class MotionLearner:
    """One joint's repetitions.

    Parameters
    ----------
    motion : RepeatedMotion
        What is known of the motion.
    learnt : callable
        Called in the thread of the computation after each repetition that was learnt from.
    """

    def __init__(self, motion: RepeatedMotion, learnt: Callable[[], None] = lambda: None) -> None:
        self.motion, self._learnt = motion, learnt
        self._spline: JointSpline | None = None
        self._refused: JointSpline | None = None
        self._recording: RepetitionRecord | None = None
        self._future: Future[None] | None = None

    def wait(self) -> None:
        """Wait for the computation after the last repetition."""
        if self._future is not None:
            self._future.result()

    @property
    def busy(self) -> bool:
        """Whether the last repetition is still being learnt from."""
        return self._future is not None and not self._future.done()

    def interrupt(self) -> None:
        """The joint no longer follows its motion."""
        self._spline = self._recording = None

    def follow(self, spline: JointSpline | None) -> None:
        """Receive the present trajectory of the joint, every cycle; None if it has none."""
        if spline is self._spline or (spline is not None and spline is self._refused):
            return
        self._spline, self._recording = spline, None
        if spline is None or self.busy:
            return
        if not self.motion.is_of(spline, TAIL):
            self.motion.refuse()
            self._spline = None
            self._refused = spline
            return
        self._recording = RepetitionRecord()

    def torque(self, time: float, usual: float) -> tuple[float, float]:
        """Base and correction [N m] at a time [s].

        Parameters
        ----------
        time : float
            Present time [s].
        usual : float
            What the adaptation adds [N m], before the motion and some time after it.
        """
        spline = self._spline
        if spline is None:
            return usual, 0.0
        known = self.motion.corrected(time - spline.start_time)
        if known is None:
            return usual, 0.0
        base, correction = known
        if time < spline.start_time:  # what was recorded then looks ahead already
            return usual, correction
        after = time - spline.end_time - TAIL
        left = 1.0 if after <= 0.0 else max(1.0 - after / FADE, 0.0)
        return usual + left * (base - usual), left * correction

    def record(self, time: float, error: float, base: float, position: float) -> None:
        """Take one cycle: its time [s], error [rad], base torque [N m] and reference [rad]."""
        spline, recording = self._spline, self._recording
        if spline is None or recording is None or time < spline.start_time:
            return
        if math.isnan(error):
            self._recording = None
            return
        recording.times.append(time - spline.start_time)
        recording.errors.append(error)
        recording.base.append(base)
        recording.path.append(position)
        if time >= spline.end_time + TAIL:
            self._recording = None
            self._future = _WORKER.submit(self._take, recording)

    def _take(self, recording: RepetitionRecord) -> None:
        self.motion.take(recording)
        self._learnt()
