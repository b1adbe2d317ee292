"""When a small test motion may move a joint that rests, so that its stiffness can be estimated.

The measurements of a joint that only holds do not show its stiffness. Where a person has asked for
it, every joint is moved once by `sine_burst` after it has come to rest at another position, or has
got another stiffness. Its data are used like those of any other motion
(`adaptation.stiffness_estimate`). The joints are tested one after the other. Any reference that
arrives meanwhile takes the joint over, as from any trajectory.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from pam_control.references.reference_generator import ReferenceGenerator
from pam_model.within_limits import within

REST: Final = 2.0  # s, after the end of a motion
STILL: Final = 1e-6  # rad/s
SAME_POSITION: Final = 0.02  # rad
SAME_STIFFNESS: Final = 0.05  # relative


class StiffnessExcitation:
    """Chooses the joint to be tested."""

    def __init__(self, references: ReferenceGenerator) -> None:
        self._references = references
        self._still_since: dict[str, float] = {}
        self._tested: dict[str, tuple[float, float]] = {}

    def due(
        self, now: float, stiffnesses: Sequence[float], amplitude: float
    ) -> tuple[str, float] | None:
        """The joint that is to be tested now, and its position [rad]; None if there is none.

        Parameters
        ----------
        now : float
            Present time [s].
        stiffnesses : sequence of float
            Commanded, by joint [N m/rad].
        amplitude : float
            Of the test motion, for which the joint needs room on both sides [rad].
        """
        found = None
        for (name, (low, high)), stiffness in zip(
            self._references.limits.items(), stiffnesses, strict=True
        ):
            reference = self._references.sample(name, now)
            if self._busy(name, now) or abs(reference.velocity) > STILL:
                self._still_since.pop(name, None)
                continue
            since = self._still_since.setdefault(name, now)
            position = reference.position
            has_room = within(position, low + amplitude, high - amplitude)
            if now - since >= REST and has_room and not self._was_tested(name, position, stiffness):
                found = found or (name, position, stiffness)
        if found is None or len(self._still_since) < len(self._references.limits):
            return None
        name, position, stiffness = found
        self._tested[name] = position, stiffness
        return name, position

    def _busy(self, name: str, now: float) -> bool:
        spline = self._references.spline(name)
        in_motion = spline is not None and now < spline.end_time
        return in_motion or self._references.following(name) == "stream"

    def _was_tested(self, name: str, position: float, stiffness: float) -> bool:
        if name not in self._tested:
            return False
        before, then = self._tested[name]
        same = abs(stiffness - then) <= SAME_STIFFNESS * then
        return same and abs(position - before) <= SAME_POSITION

    def forget(self) -> None:
        """Test every joint again, as soon as it rests."""
        self._still_since.clear()
        self._tested.clear()
