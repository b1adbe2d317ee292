"""The loop that plays a motion: pressures by a proportional loop, the angle by a slow integral one.

The integral loop finds the pressure difference that holds the joint, so that lengths and weights
that are wrong in the rig file do not turn it. Its gain is in proportion to the co-contraction, as
the stiffness of the joint is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from pam_demo.commission.motions import EMPTY, FILL, LOWER, REST, Motion, Scale
from pam_demo.commission.robot_port import Reading
from pam_gap.experiments.loop import PressureLoop
from pam_model.errors import PamError
from pam_model.joints.antagonistic_joint import AntagonisticJoint
from pam_model.rig import Rig

BANDWIDTH: Final = 20.0  # 1/s, of the pressure loops
LOWEST: Final = 0.02  # of the highest pressure, in the muscle with less
PROBE: Final = 0.01  # rad
OUTER: Final = 0.75  # of the range of positions that is used, from its middle
SLOWEST_TURN: Final = 0.5  # rad/s, of the slow loop


def scale_of(rig: Rig, period: float) -> Scale:
    """The sizes of motions on the first joint of a rig, from the numbers that are known.

    Raises
    ------
    PamError
        If position 0 or the middle of the range is outside the model of a muscle.
    """
    joint = rig.joints[0]
    statics = AntagonisticJoint.from_rig(rig)
    highest = min(PressureLoop(rig, 0).highest)
    lower, upper = joint.position_limits
    middle = 0.5 * (lower + upper)
    reach = OUTER * 0.5 * (upper - lower)
    half = 0.5 * highest

    def turned(difference: float, position: float) -> float:
        return statics.torque(half + difference, half - difference, position)

    stiffness = (turned(0.0, middle - PROBE) - turned(0.0, middle + PROBE)) / (2.0 * PROBE)
    torque = (turned(0.1 * half, middle) - turned(-0.1 * half, middle)) / (0.2 * half)
    if not (stiffness > 0.0 and torque > 0.0):
        raise PamError(
            f"{joint.name}: the muscles of this rig file do not hold the joint at {middle:+.2f} rad"
        )
    return Scale(period, highest, reach, middle, stiffness / (torque * half))


class LoopState(NamedTuple):
    """Half the pressure difference over the mean pressure [-], and where the joint began [rad]."""

    ratio: float
    start: float


class MotionLoop:
    """Commands of one motion, sample by sample.

    Parameters
    ----------
    rig : Rig
        With one joint.
    motion : Motion
        What is played.
    scale : Scale
        Of the rig.
    """

    def __init__(self, rig: Rig, motion: Motion, scale: Scale) -> None:
        self.pressures = PressureLoop(rig, 0, BANDWIDTH)
        self.motion = motion
        self._scale = scale
        self._level, self._position, self._wave = (
            values.tolist() for values in (motion.level, motion.position, motion.wave)
        )
        self._ends = motion.duration - EMPTY - LOWER  # here the slow loop ends

    def init(self, position: float) -> LoopState:
        """The state at the begin, with the joint at a position [rad]."""
        return LoopState(0.0, position)

    def step(
        self, state: LoopState, k: int, reading: Reading
    ) -> tuple[tuple[float, float], LoopState]:
        """Valve commands of sample `k`, and the state after it."""
        motion, scale = self.motion, self._scale
        level, time = self._level[k], k * motion.period
        room = max(level - LOWEST * scale.highest, 0.0)
        ratio = state.ratio
        if REST < time < self._ends and level > 0.0:
            s = min((time - REST) / FILL, 1.0)
            s = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
            wanted = state.start + s * (self._position[k] - state.start)
            turn = motion.bandwidth * (wanted - reading.position)
            turn = min(max(turn, -SLOWEST_TURN), SLOWEST_TURN)
            ratio += motion.period * scale.per_rad * turn
            most = room / level
            ratio = min(max(ratio, -most), most)
        half = min(max(ratio * level + self._wave[k], -room), room)
        commands = self.pressures.commands((level + half, level - half), reading.pressures)
        return commands, LoopState(ratio, state.start)

    def lowering(
        self, since: float, begun: Sequence[float], measured: Sequence[float]
    ) -> tuple[float, float]:
        """Commands that let the air out slowly, `since` seconds after a motion has been ended.

        Parameters
        ----------
        since : float
            [s].
        begun, measured : sequence of two floats
            Pressures at the end of the motion, and now [Pa].
        """
        share = max(1.0 - since / LOWER, 0.0)
        return self.pressures.commands((share * begun[0], share * begun[1]), measured)
