"""The loop that plays a motion: pressures by a proportional loop, the angle by a slow one.

The integral part of the slow loop finds the pressure difference that holds the joint, so that
lengths and weights that are wrong in the rig file do not turn it. Muscles that differ turn a free
joint as soon as they have air, long before the integral has found the difference; a proportional
part holds it meanwhile, and a part in proportion to the speed damps it. The gains on the angle are
in proportion to the co-contraction, as the stiffness of the joint is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from pam_demo.commission.motions import FILL, REST, SampledMotion, Scale
from pam_demo.commission.robot_port import JointReading
from pam_gap.experiments.loop import PressureLoop
from pam_model.errors import PamError
from pam_model.joints.joint_statics import JointStatics
from pam_model.rig import Rig
from pam_model.robot import compose
from pam_model.views.inverse_dynamics import InverseDynamics

BANDWIDTH: Final = 20.0  # 1/s, of the pressure loops
LOWEST: Final = 0.02  # of the highest pressure, in the muscle with less
PROBE: Final = 0.01  # rad
DAMPED: Final = 8.0  # 1/s, decay of a free joint at LOW_LEVEL, by the damping of the slow loop
LOW_LEVEL: Final = 0.12  # of the highest pressure
SPEED_FILTER: Final = 0.02  # s
HELD: Final = 1.0  # proportional gain up to LOW_LEVEL while the muscles are filled [-]
FADE: Final = 1.0  # s, in which it ends after the filling
OUTER: Final = 0.75  # of the range of positions that is used, from its middle
LOWER: Final = 3.0  # s, in which the air is let out
WAITED: Final = 0.8  # share of the slower muscle in a lowering, below which the faster one waits
NEARLY_EMPTY: Final = 5e3  # Pa
LONGEST_LOWERING: Final = 10.0  # s
SLOWEST_TURN: Final = 1.0  # rad/s, of the integral part


def scale_of(rig: Rig, period: float) -> Scale:
    """The sizes of motions on the first joint of a rig, from the numbers that are known.

    Raises
    ------
    PamError
        If position 0 or the middle of the range is outside the model of a muscle.
    """
    joint = rig.joints[0]
    statics = JointStatics.from_rig(rig)
    highest = min(PressureLoop(rig, 0).highest)
    lower, upper = joint.position_limits
    middle = 0.5 * (lower + upper)
    reach = OUTER * 0.5 * (upper - lower)
    half = 0.5 * highest

    def turned(difference: float, position: float) -> float:
        return statics.torque((half + difference, half - difference), position)

    stiffness = (turned(0.0, middle - PROBE) - turned(0.0, middle + PROBE)) / (2.0 * PROBE)
    torque = (turned(0.1 * half, middle) - turned(-0.1 * half, middle)) / (0.2 * half)
    if not (stiffness > 0.0 and torque > 0.0):
        raise PamError(
            f"{joint.name}: the muscles of this rig file do not hold the joint at {middle:+.2f} rad"
        )
    (entry,) = compose(rig).joints
    dynamics = InverseDynamics.from_joint(entry)
    push = dynamics.torque(middle, 0.0, 1.0) - dynamics.torque(middle, 0.0, 0.0)
    per_rad = stiffness / (torque * half)
    # the difference d pushes with `torque` d, and the speed v with `push` v DAMPED at least
    low = LOW_LEVEL * highest * per_rad * torque / push  # rad^2/s^2, of the spring at this level
    damping = DAMPED * push / torque * min(1.0, low / DAMPED**2)
    return Scale(period, highest, reach, middle, per_rad, damping)


class LoopState(NamedTuple):
    """What the slow loop remembers."""

    ratio: float  # integral part: half the pressure difference over the mean pressure [-]
    # start, position, speed: where the joint began, where it was last [rad], and its filtered speed
    # [rad/s]
    start: float
    position: float
    speed: float


class MotionLoop:
    """Commands of one motion, sample by sample.

    Parameters
    ----------
    rig : Rig
        With one joint.
    motion : SampledMotion
        What is played.
    scale : Scale
        Of the rig.
    """

    def __init__(self, rig: Rig, motion: SampledMotion, scale: Scale) -> None:
        self.pressures = PressureLoop(rig, 0, BANDWIDTH)
        self.motion = motion
        self._scale = scale
        self._level, self._position, self._wave = (
            values.tolist() for values in (motion.level, motion.position, motion.wave)
        )

    def init(self, position: float) -> LoopState:
        """The state at the begin, with the joint at a position [rad]."""
        return LoopState(0.0, position, position, 0.0)

    def step(
        self, state: LoopState, k: int, reading: JointReading
    ) -> tuple[tuple[float, float], LoopState]:
        """Valve commands of sample `k`, and the state after it."""
        motion, scale = self.motion, self._scale
        level, time = self._level[k], k * motion.period
        room = max(level - LOWEST * scale.highest, 0.0)
        weight = motion.period / (SPEED_FILTER + motion.period)
        measured = (reading.position - state.position) / motion.period
        speed = state.speed + weight * (measured - state.speed)
        ratio, held = state.ratio, 0.0
        stiffer = max(
            level / (LOW_LEVEL * scale.highest), 1.0
        )  # behind a lag, too much would swing
        if time > REST and level > 0.0:
            s = min((time - REST) / FILL, 1.0)
            s = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
            error = state.start + s * (self._position[k] - state.start) - reading.position
            turn = min(max(motion.bandwidth * error, -SLOWEST_TURN), SLOWEST_TURN)
            most = room / level
            ratio += motion.period * scale.per_rad * turn
            ratio = min(max(ratio, -most), most)
            left = min(max(1.0 - (time - REST - FILL) / FADE, 0.0), 1.0)
            held = scale.per_rad * HELD * left / stiffer**2 * error
        half = (ratio + held) * level + self._wave[k] - scale.damping / stiffer * speed
        half = min(max(half, -room), room)
        commands = self.pressures.commands((level + half, level - half), reading.pressures)
        return commands, LoopState(ratio, state.start, reading.position, speed)


class PressureRelease:
    """Lets the air out slowly: the pressures of both muscles sink in proportion.

    A muscle whose valve is slower than the other's would turn the joint in the end. Therefore the
    faster one waits for it.

    Parameters
    ----------
    loop : PressureLoop
        Of the joint.
    begun : sequence of two floats
        Pressures at the begin [Pa].
    period : float
        Between two samples [s].
    """

    def __init__(self, loop: PressureLoop, begun: Sequence[float], period: float) -> None:
        self._loop, self._period = loop, period
        self._begun = max(begun[0], 0.0), max(begun[1], 0.0)
        self._share, self._time = 1.0, 0.0

    def commands(self, measured: Sequence[float]) -> tuple[float, float] | None:
        """Commands for measured pressures [Pa]; None when the muscles are nearly empty."""
        full = [
            now / then
            for now, then in zip(measured, self._begun, strict=True)
            if then > NEARLY_EMPTY
        ]
        self._time += self._period
        if max(measured) < NEARLY_EMPTY or not full or self._time > LONGEST_LOWERING:
            return None
        wanted = max(self._share - self._period / LOWER, WAITED * max(full), 0.0)
        self._share = min(self._share, wanted)
        first, second = self._begun
        return self._loop.commands((self._share * first, self._share * second), measured)
