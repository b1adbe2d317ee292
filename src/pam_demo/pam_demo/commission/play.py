"""Plays on a port: the first touch of the valves, the start-up check, a motion, a lowering.

Everything is watched sample by sample. Where a watch ends a motion, the air is let out slowly, as
at the end of every motion.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from pam_demo.commission.motion_loop import BANDWIDTH, MotionLoop, PressureRelease
from pam_demo.commission.motions import SampledMotion, Scale
from pam_demo.commission.robot_port import JointReading, RobotPort
from pam_demo.commission.watch import Limits, Seen, watched
from pam_driver.safety.start_up_check import NOT_EMPTY, REPETITIONS, StartUpCheck
from pam_gap.experiments.loop import PressureLoop
from pam_gap.recordings.recording import COMMANDS, JOINTS, PRESSURES
from pam_model.rig import Rig
from pam_model.robot import compose
from pam_ros.valve_command import FLOW, PRESSURE_REGULATOR, ValveCommandFormat

Array = npt.NDArray[np.float64]
EMPTY: Final = 1.0  # s, of venting at the end of a motion
TOUCH: Final = 0.4  # s, in which a valve is opened a little towards its exhaust
TOUCH_OPENING: Final = 0.3  # of full opening, at its end
WAKING: Final = 2.0  # s
FOLLOWS: Final = 0.3  # of the wanted mean pressure, that must be reached
FOLLOWS_WITHIN: Final = 1.0  # s
RISEN: Final = 3e3  # Pa, that a muscle must not rise while all vent
RISEN_FOR: Final = 0.012  # s, so that a single reading accuses no valve
SHUT: Final = (0.0, 0.0)
CLOSE: Final = 1e-6  # s, between moments that are the same
LONGEST_CHECK: Final = 120.0  # s


@dataclass(slots=True)
class Log:
    """Rows of a recording."""

    rig: Rig  # with the names of the joint and its muscles
    # from the sample of a reading without an age to the moment at which commands that are sent
    # together with it reach the valves [s]; of `of_port`
    late: float
    rows: list[tuple[float, ...]] = field(default_factory=list)
    # of the angle and the pressures of each row [s]
    stamps: list[tuple[float, float]] = field(default_factory=list)

    @classmethod
    def of_port(cls, rig: Rig, port: RobotPort) -> Log:
        """A log that puts the delays of a port right, which are no properties of the robot."""
        # an answer is one period late even without a delay: it is sent with the next reading
        return cls(rig, port.measurement_delay + port.command_delay - port.period)

    def add(self, reading: JointReading, commands: Sequence[float]) -> None:
        """Add a reading, and the commands that are sent from then on."""
        self.rows.append((reading.time, reading.position, *reading.pressures, *commands))
        self.stamps.append((reading.position_time, reading.pressure_time))

    def table(self) -> pd.DataFrame:
        """The recording, with the names of channels and the time from its first row [s].

        Each measurement counts at its stamp, and is interpolated to the times of the rows.
        """
        joint = self.rig.joints[0]
        names = [
            "time",
            f"{JOINTS}{joint.name}.position",
            *(f"{PRESSURES}{muscle}" for muscle in joint.muscles),
            *(f"{COMMANDS}{muscle}" for muscle in joint.muscles),
        ]
        rows = np.array(self.rows).reshape(-1, len(names))
        sent = np.searchsorted(rows[:, 0], rows[:, 0] - self.late + CLOSE, side="right") - 1
        rows[:, -2:] = rows[np.maximum(sent, 0), -2:]
        stamps = np.array(self.stamps).reshape(-1, 2)
        for column, of in ((1, 0), (2, 1), (3, 1)):
            rows[:, column] = _at(rows[:, 0], stamps[:, of], rows[:, column])
        table = pd.DataFrame(rows, columns=names)
        table["time"] -= table["time"].iloc[0] if len(table) else 0.0
        return table


def _at(times: Array, stamps: Array, values: Array) -> Array:
    """Values at other times than those of their stamps [s]; the last one holds until the end."""
    if np.abs(times - stamps).max(initial=0.0) < CLOSE:
        return values
    new = np.diff(stamps, prepend=-np.inf) > 0.0  # a message is read once more if none is newer
    result: Array = np.interp(times, stamps[new], values[new])
    return result


class Finding(NamedTuple):
    """What a check of valves, hoses and sensors has found."""

    text: str  # in words
    turns_wrong: bool = False  # whether every pulse that turned the joint turned it the wrong way
    # whether the pulse of every muscle turned the joint, and nothing else was found
    is_complete: bool = False


@dataclass(frozen=True, slots=True)
class Played:
    """A motion that was played."""

    table: pd.DataFrame  # the recording, by channels
    stopped: str  # why it was ended early; empty if it was not
    # largest measured use of the limits: pressure, speed, distance from the middle [-]
    most: tuple[float, float, float]


def vented(rig: Rig) -> tuple[float, float]:
    """The commands that empty both muscles."""
    first, second = ValveCommandFormat(rig.valve_kinds).vented
    return first, second


def first_reading(port: RobotPort, commands: Sequence[float]) -> JointReading:
    """A reading that is known, if there is one within `WAKING`.

    While numbers are identified the process has other work, and its first measurement may be old.
    """
    reading = port.advance(commands)
    for _ in range(round(WAKING / port.period)):
        if reading.known or reading.refusal:
            break
        reading = port.advance(commands)
    return reading


def touch(port: RobotPort, rig: Rig) -> str:
    """Open each flow valve a little towards its exhaust; why it does not vent, or empty.

    A valve whose sign is reversed would fill its muscle when it is told to vent, so this comes
    before anything else. A regulator cannot be reversed in this way. A pressure that rises while
    all valves are shut is not that of a reversed valve.
    """
    joint = rig.joints[0]
    kinds = [rig.muscle(name).valve.kind for name in joint.muscles]
    begin = first_reading(port, SHUT)
    if begin.problem:
        remedy = ": clear its faults and activate it, then start again" if begin.refusal else ""
        return _sentence(begin.problem + remedy)
    full = [n for n, p in zip(joint.muscles, begin.pressures, strict=True) if p > NOT_EMPTY]
    if full:
        return f"{' and '.join(full)} must be empty at the begin; vent the robot first."
    flow_valves = [side for side, kind in enumerate(kinds) if kind == FLOW]
    for opened in (None, *flow_valves) if flow_valves else ():
        fills, problem = _filled(port, opened)
        if problem:
            return _sentence(problem)
        if fills is not None and opened is None:
            return (
                f"{joint.muscles[fills]} fills although its valve should be shut: the valve "
                "leaks, or its zero is off."
            )
        if fills is not None and opened is not None:
            return (
                f"The valve of {joint.muscles[opened]} fills {joint.muscles[fills]} when it should "
                "vent: the sign of its command is reversed, or supply and exhaust are exchanged."
            )
    return ""


def _filled(port: RobotPort, opened: int | None) -> tuple[int | None, str]:
    """The muscle that fills while a valve is opened towards its exhaust, or while all are shut.

    Readings that are missing accuse no valve: the trial is repeated, and then ends with the reason.
    """
    problem = ""
    for _ in range(REPETITIONS + 1):
        begin = first_reading(port, SHUT)
        if begin.problem:
            return None, begin.problem
        fills, problem = _trial(port, opened, begin)
        port.advance(SHUT)
        if not problem:
            return fills, ""
    return None, problem


def _trial(port: RobotPort, opened: int | None, begin: JointReading) -> tuple[int | None, str]:
    """One opening of a valve: the muscle that fills, and why nothing can be said."""
    count, risen_for = round(TOUCH / port.period), 0.0
    for k in range(count):
        commands = list(SHUT)
        if opened is not None:
            commands[opened] = -TOUCH_OPENING * (k + 1) / count
        shown = port.advance(commands)
        if shown.problem:
            return None, shown.problem
        risen = [a - b for a, b in zip(shown.pressures, begin.pressures, strict=True)]
        risen_for = risen_for + port.period if max(risen) >= RISEN else 0.0
        if risen_for >= RISEN_FOR:
            return risen.index(max(risen)), ""
    return None, ""


def start_up_check(port: RobotPort, rig: Rig) -> tuple[Finding, ...]:
    """What the driver's start-up check finds; empty if all is as it should be.

    It needs no more than the rig file of one joint, and says which hose, valve or sensor is at the
    wrong place. While a measurement is missing, all valves vent; the check then repeats its pulse,
    as after every pause.
    """
    robot = compose(rig)
    commands = vented(rig)
    scales = [
        muscle.valve.full_scale if muscle.valve.kind == PRESSURE_REGULATOR else 1.0
        for muscle in rig.muscles
    ]
    fractions = [c / (s or 1.0) for c, s in zip(commands, scales, strict=True)]
    check = StartUpCheck(robot, fractions, port.period)
    reading = first_reading(port, commands)
    begin = reading.time
    check.start(begin)
    while not check.finished:
        if not reading.known:
            reading = first_reading(port, commands)
        if reading.problem:
            return (Finding(reading.problem),)
        if reading.time - begin > LONGEST_CHECK:
            return (Finding(f"it has not ended within {LONGEST_CHECK:g} s"),)
        set_points = check.setpoints(reading.pressures, [reading.position], reading.time)
        reading = port.advance([f * (s or 1.0) for f, s in zip(set_points, scales, strict=True)])
    rest(port, rig, EMPTY)
    wrong = bool(check.turned_right) and not any(check.turned_right.values())
    complete = len(check.turned_right) == len(check.findings) == len(robot.muscles)
    return tuple(Finding(str(one), wrong, complete) for one in check.findings)


def _sentence(reason: str) -> str:
    return reason[0].upper() + reason[1:] + "."


def rest(port: RobotPort, rig: Rig, duration: float) -> None:
    """Vent for a while [s]."""
    commands = vented(rig)
    for _ in range(round(duration / port.period)):
        port.advance(commands)


def lower(port: RobotPort, rig: Rig, reading: JointReading, log: Log) -> None:
    """Let the air out slowly from the present pressures, then vent."""
    lowering = PressureRelease(PressureLoop(rig, 0, BANDWIDTH), reading.pressures, port.period)
    while all(map(math.isfinite, reading.pressures)) and not reading.refusal:
        commands = lowering.commands(reading.pressures)
        if commands is None:
            break
        reading = port.advance(commands)
        log.add(reading, commands)
    commands = vented(rig)
    for _ in range(round(EMPTY / port.period)):
        log.add(port.advance(commands), commands)


def play(port: RobotPort, rig: Rig, motion: SampledMotion, scale: Scale, limits: Limits) -> Played:
    """Play a motion and record it; a watch may end it.

    Parameters
    ----------
    port : RobotPort
        The robot; its muscles are empty.
    rig : Rig
        With one joint, by which the loop is made.
    motion, scale, limits : SampledMotion, Scale, Limits
        What is played. Whatever ends it, the air is let out slowly.
    """
    loop, log = MotionLoop(rig, motion, scale), Log.of_port(rig, port)
    commands = vented(rig)
    reading = first_reading(port, commands)
    log.add(reading, commands)
    state, seen, stopped = loop.init(reading.position), Seen(), ""
    most, behind = np.zeros(3), 0
    try:
        for k in range(motion.level.size):
            seen, stopped = watched(seen, reading, limits, port.period)
            short = 0.5 * sum(reading.pressures) < FOLLOWS * motion.level[k] - NOT_EMPTY
            behind = behind + 1 if short else 0
            if behind * motion.period > FOLLOWS_WITHIN:
                stopped = "the pressures do not follow their commands: the driver may have vented"
            if stopped:
                break
            shares = limits.shares(reading.pressures, seen.speed, reading.position)
            most = np.maximum(most, shares)
            commands, state = loop.step(state, k, reading)
            reading = port.advance(commands)
            log.add(reading, commands)
    finally:  # also at Ctrl-C
        lower(port, rig, reading, log)
    pressure, speed, place = most.tolist()
    return Played(log.table(), stopped, (pressure, speed, place))
