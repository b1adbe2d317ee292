"""The learning of all joints under one name of a motion, and its file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from pam_control.learning.learnt_file import LearntFile
from pam_control.learning.motion_learner import MotionLearner
from pam_control.learning.repeated_motion import Filter, RepeatedMotion
from pam_model.rig import Rig


class LearningSession:
    """One motion of all joints.

    Parameters
    ----------
    path : Path or None
        File in which it is kept; None: in memory only.
    filters : mapping of str to Filter
        By joint.
    period : float
        Of the control loop [s].
    warm_up : int
        Repetitions in which the adaptation learns.
    read : callable
        See `LearntFile`.

    Attributes
    ----------
    learners : dict of str to MotionLearner
        By joint.
    problem : str
        Why the file was ignored or could not be written; empty if all is well.

    Raises
    ------
    PamError
        For a file that cannot be read.
    """

    def __init__(
        self,
        rig: Rig,
        name: str,
        path: Path | None,
        filters: Mapping[str, Filter],
        period: float,
        warm_up: int,
        read: Callable[..., Any],
    ) -> None:
        self.name = name
        self._file = None if path is None else LearntFile(path, rig, read)
        self.problem = "" if self._file is None else self._file.note
        known = {} if self._file is None else self._file.motion(name)
        self.learners: dict[str, MotionLearner] = {}
        for joint, each in filters.items():
            motion = RepeatedMotion(each, period, warm_up, known.get(joint))
            self.learners[joint] = MotionLearner(motion, partial(self._keep, joint))

    def _keep(self, joint: str) -> None:
        best = self.learners[joint].motion.best
        if self._file is None or best is None:
            return
        try:
            self._file.keep(self.name, joint, best)
        except OSError as error:
            self.problem = f"not kept: {error}"

    def report(self, joint: str) -> str:
        """One line for a log: the errors of a joint's repetitions."""
        motion = self.learners[joint].motion
        errors = ", ".join(f"{1e3 * rms:.2f}" for rms in motion.history) or "not played yet"
        return f"{self.name}: RMS errors [mrad] {errors}" + (
            f"; learning has ended: {motion.ended}" if motion.ended else ""
        )
