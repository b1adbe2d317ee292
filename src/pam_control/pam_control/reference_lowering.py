"""Lowering the joints: brake, hold, then let the air out slowly (stop category 1).

The pressures of both muscles sink in proportion. So the torque sinks in proportion, too, and each
joint settles slowly where gravity takes it, instead of falling as after a vent. The feedback is off
meanwhile: it would hold the joint up until its pressures no longer suffice, and then drop it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum

from pam_control.control_step import JointTelemetry

REST_SPEED = 0.05  # rad/s, of reference and joint; below it a joint counts as at rest
LONGEST_BRAKING = 2.0  # s; after it the lowering begins in any case
EMPTY = 20e3  # Pa gauge
LONGEST_EMPTYING = 2.0  # s, after the desired pressures have reached 0


class LoweringPhase(Enum):
    """Where the lowering is."""

    OFF = "off"
    BRAKING = "braking"
    SINKING = "sinking"
    DONE = "done"


class ReferenceLowering:
    """The lowering of all joints.

    Attributes
    ----------
    phase : LoweringPhase
        Where it is.
    share : float or None
        Share of the pressures that is left while they sink [-]; None otherwise.
    """

    def __init__(self) -> None:
        self.phase = LoweringPhase.OFF
        self.share: float | None = None
        self._since = math.nan

    def start(self) -> None:
        """Begin; the references must be braking."""
        if self.phase is LoweringPhase.OFF:
            self.phase, self._since = LoweringPhase.BRAKING, math.nan

    def cancel(self) -> None:
        """Forget the lowering; the joints have to be taken over where they are."""
        self.phase, self.share = LoweringPhase.OFF, None

    def advance(
        self,
        time: float,
        duration: float,
        joints: Sequence[JointTelemetry],
        pressures: Sequence[float],
    ) -> None:
        """Advance to `time` [s].

        Parameters
        ----------
        time : float
            Present time [s].
        duration : float
            Time in which the desired pressures sink to 0 [s].
        joints : sequence of JointTelemetry
            Of the present cycle.
        pressures : sequence of float
            Measured pressures of the joints' muscles [Pa].
        """
        if self.phase in (LoweringPhase.OFF, LoweringPhase.DONE):
            return
        if math.isnan(self._since):
            self._since = time
        gone = time - self._since
        if self.phase is LoweringPhase.BRAKING:
            if gone >= LONGEST_BRAKING or all(map(_rests, joints)):
                self.phase, self._since, self.share = LoweringPhase.SINKING, time, 1.0
            return
        self.share = max(1.0 - gone / duration, 0.0)
        empty = all(pressure < EMPTY for pressure in pressures)
        if self.share == 0.0 and (empty or gone > duration + LONGEST_EMPTYING):
            self.phase = LoweringPhase.DONE


def _rests(joint: JointTelemetry) -> bool:
    return abs(joint.reference.velocity) < REST_SPEED and abs(joint.motion.velocity) < REST_SPEED
