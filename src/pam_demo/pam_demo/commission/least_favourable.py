"""How far a motion may go: until the least favourable robot is near a limit.

Every number of the rig is only known within an interval. A motion is simulated on the robots of a
Plackett-Burman design, in which each number is at one end of its interval in half of the robots,
independently of all others (R. L. Plackett and J. P. Burman, Biometrika 33, 1946; here its
Hadamard matrix of Sylvester's construction). The mean difference between both halves is the main
effect of a number on the highest pressure, the speed and the travel. The robot that has all numbers
at the end that makes one of these worse is the least favourable one for it. The motion is then
made smaller until these robots, and the worst of the design, keep a share of all limits.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.linalg import hadamard

from pam_demo.commission.knowledge import Known
from pam_demo.commission.motion_loop import MotionLoop, PressureRelease
from pam_demo.commission.motions import SampledMotion, Scale
from pam_demo.commission.robot_port import JointReading
from pam_demo.commission.watch import Limits, Seen, watched
from pam_gap.answer.improved_rig import with_number
from pam_model.joints.joint_statics import JointStatics
from pam_model.plant.parameters import PlantParameters, bounds_of
from pam_model.plant.simulate import Plant, vented_state
from pam_model.rig import Rig

Array = npt.NDArray[np.float64]

PLANNED: Final = (0.85, 0.55, 0.85)
"""Shares of the limits that a motion may use on the least favourable robot: pressure, speed,
distance from the middle of the range."""
SCREENED, PERIOD = 0.016, 0.008
"""Periods of the loop in a simulated motion [s]: on the robots of the design, and on the worst."""
STEP: Final = 5e-4  # s, of the integration
SHARES: Final = (1.0, 0.8, 0.6, 0.45, 0.3, 0.2, 0.1)
PACES: Final = (1.0, 0.5, 0.25)
LENGTH_SHARES: Final = (1.0, 0.8, 0.6, 0.4, 0.2, 0.0)
SPEED_FILTER_WARM: Final = 0.5  # s, before which a vented joint may still swing


@dataclass(frozen=True, slots=True)
class Foreseen:
    """The largest use of the limits in a simulated motion: pressure, speed, distance [-]."""

    pressure: float
    speed: float
    distance: float

    @property
    def all(self) -> Array:
        """The three shares, shape (3,)."""
        return np.array([self.pressure, self.speed, self.distance])

    @property
    def is_permitted(self) -> bool:
        """Whether a motion may be played."""
        return bool(np.all(self.all <= PLANNED))


@dataclass(frozen=True, slots=True)
class Permitted:
    """How large a motion may be."""

    # share, pace: of the motion as it was asked for, and of the bandwidth of its slow loop; share 0
    # if nothing is permitted
    share: float
    pace: float
    worst: Foreseen  # what it does on the least favourable robots
    robots: tuple[Mapping[str, float], ...]  # these robots, as changes of plant parameters


def foreseen(
    rig: Rig,
    changes: Mapping[str, float],
    motion: SampledMotion,
    scale: Scale,
    limits: Limits,
    period: float = PERIOD,
) -> Foreseen:
    """Simulate a motion on a robot whose numbers differ from the rig file.

    Parameters
    ----------
    rig : Rig
        With one joint, by which the loop is made.
    changes : mapping of str to float
        Plant parameters of the robot.
    motion, scale, limits : SampledMotion, Scale, Limits
        What is played.
    period : float
        Of the loop [s].
    """
    parameters = PlantParameters.from_rig(rig).forced(dict(changes))
    plant = Plant(parameters, STEP, vented_state(parameters))
    motion = motion.every(max(round(period / motion.period), 1))
    loop = MotionLoop(rig, motion, scale)
    output = plant.output
    reading = JointReading(0.0, output["position"], (0.0, 0.0))
    state, seen = loop.init(reading.position), Seen()
    most = np.zeros(3)
    lowering: PressureRelease | None = None
    for k in itertools.count():
        seen, _ = watched(seen, reading, limits)
        if k * motion.period > SPEED_FILTER_WARM:
            shares = limits.shares(reading.pressures, seen.speed, reading.position)
            most = np.maximum(most, shares)
        if k < motion.level.size:
            commands, state = loop.step(state, k, reading)
        else:
            lowering = lowering or PressureRelease(loop.pressures, reading.pressures, motion.period)
            following = lowering.commands(reading.pressures)
            if following is None:
                break
            commands = following
        position, *pressures = plant.step(commands, motion.period)
        if not math.isfinite(position):
            return Foreseen(math.inf, math.inf, math.inf)
        reading = JointReading((k + 1) * motion.period, position, (pressures[0], pressures[1]))
    return Foreseen(*most.tolist())


def design(known: Sequence[Known]) -> list[dict[str, float]]:
    """The robots of the design, and the most likely one at the end."""
    free = [one for one in known if one.low < one.high]
    middle = {one.name: one.value for one in known}
    return [
        *(middle | {one.name: _end(one, sign) for one, sign in zip(free, row, strict=True)}
          for row in _signs(len(free)).tolist()),
        middle,
    ]  # fmt: skip


def _signs(count: int) -> Array:
    """Ends of `count` numbers, one row for each robot."""
    size = 2 ** math.ceil(math.log2(count + 1))
    found: Array = hadamard(size)[:, 1 : count + 1].astype(float)
    return found


def _end(one: Known, sign: float) -> float:
    low, high = bounds_of(one.name)
    return min(max(one.high if sign > 0 else one.low, low), high)


def reaching(rig: Rig, known: Sequence[Known], robot: Mapping[str, float]) -> dict[str, float]:
    """A robot with lengths so near to the likely ones that its muscles reach both limits.

    Lengths that are all at their worst ends may belong to no robot: a muscle would be longer than
    its threads within the range of the joint.
    """
    joint = rig.joints[0]
    lower, upper = joint.position_limits
    found = dict(robot)
    for share in LENGTH_SHARES:
        trial = rig
        for one in known:
            if one.is_length:
                found[one.name] = one.value + share * (robot[one.name] - one.value)
                trial = with_number(trial, joint.name, one.name, found[one.name])
        low, high = JointStatics.from_rig(trial).position_range
        if low <= lower and upper <= high:
            break
    return found


def least_favourable(
    rig: Rig, known: Sequence[Known], motion: SampledMotion, scale: Scale, limits: Limits
) -> tuple[Mapping[str, float], ...]:
    """The robots within the intervals on which a motion comes nearest to the limits.

    Parameters
    ----------
    rig, motion, scale, limits
        As for `foreseen`.
    known : sequence of Known
        Intervals of the numbers.
    """
    robots = [reaching(rig, known, robot) for robot in design(known)]
    free = [one for one in known if one.low < one.high]
    found = np.array(
        [foreseen(rig, robot, motion, scale, limits, SCREENED).all for robot in robots]
    )
    found = np.minimum(found, 10.0)
    effects = _signs(len(free)).T @ (found[:-1] - found[:-1].mean(axis=0))
    middle = robots[-1]
    chosen = []
    for column in range(found.shape[1]):
        worst = {
            one.name: _end(one, effect)
            for one, effect in zip(free, effects[:, column].tolist(), strict=True)
        }
        worst = reaching(rig, known, middle | worst)
        chosen += [worst, robots[int(np.argmax(found[:, column]))]]
    return tuple(chosen)


def permitted(
    rig: Rig,
    robots: Sequence[Mapping[str, float]],
    motion: SampledMotion,
    scale: Scale,
    limits: Limits,
    simulate: Callable[..., Foreseen] = foreseen,
) -> Permitted:
    """The largest share of a motion that all these robots may play.

    If even a small one is too much, it is tried with a slower loop and less co-contraction.

    Parameters
    ----------
    rig, motion, scale, limits
        As for `foreseen`.
    robots : sequence of mapping
        The least favourable robots.
    simulate : callable
        `foreseen`, or another plant.
    """
    worst = Foreseen(math.inf, math.inf, math.inf)
    for pace, share in itertools.product(PACES, SHARES):
        played = motion.smaller(share).gentler(pace)
        most = np.zeros(3)
        for robot in robots:
            most = np.maximum(most, simulate(rig, robot, played, scale, limits).all)
            worst = Foreseen(*most.tolist())
            if not worst.is_permitted:
                break
        else:
            return Permitted(share, pace, worst, tuple(robots))
    return Permitted(0.0, PACES[-1], worst, tuple(robots))
