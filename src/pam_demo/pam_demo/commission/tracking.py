"""The tracking test: the controller of the suite, with its designed gains, follows one motion.

The object that the controller node steps is stepped here, sample by sample on the port. A joint
that leaves its limits, or a controller that stops, ends the test.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import pandas as pd

from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_control.reference_lowering import LoweringPhase
from pam_control.references.trajectory import CommandError, TrajectoryPoint
from pam_control.settings import ControlSettings
from pam_demo.commission.play import EMPTY, Log, first_reading, lower, rest, vented
from pam_demo.commission.robot_port import JointReading, RobotPort
from pam_demo.commission.watch import Limits, Seen, watched
from pam_model.errors import PamError
from pam_model.rig import Rig

SETTLE: Final = 2.5  # s, from the take-over to the way to the start
APPROACH: Final = 2.0  # s, to the position where the motion begins
LONGEST_LOWERING: Final = 12.0  # s
REACHES: Final = (0.6, -0.6, 0.3, -0.3, 0.0)  # of the reach
PAUSE: Final = 0.3  # s
STEP: Final = 0.02  # s between waypoints
REST: Final = 1.0  # s, at the start of the motion
AHEAD: Final = 0.5  # s, in which the joint rests, because to plan a motion takes some periods
COLUMNS: Final = ("time", "reference", "position")


@dataclass(frozen=True, slots=True)
class Tracked:
    """How well a motion was followed."""

    # rms, largest: error of the measured angle in the motion [rad]; infinite if it was not followed
    # to its end
    rms: float
    largest: float
    stopped: str  # why it was not; empty if it was
    table: pd.DataFrame  # time [s], reference and measured angle [rad] in the motion
    # largest measured use of the limits: pressure, speed, distance from the middle [-]
    most: tuple[float, float, float] = (math.nan, math.nan, math.nan)


def reaches(middle: float, reach: float, duration: float) -> list[TrajectoryPoint]:
    """Reaches of minimum jerk to shares of the reach, with pauses, from the middle and back.

    Parameters
    ----------
    middle, reach : float
        [rad].
    duration : float
        Of a way as long as the reach [s].
    """
    points: list[TrajectoryPoint] = []
    at, start = 0.0, middle
    for share in REACHES:
        target = middle + share * reach
        stroke = target - start
        count = max(round(duration * max(abs(stroke) / reach, 0.3) / STEP), 10)
        time = count * STEP
        for index in range(1, count + 1):
            x = index / count
            points.append(
                TrajectoryPoint(
                    at + index * STEP,
                    [start + stroke * x**3 * (10.0 - 15.0 * x + 6.0 * x * x)],
                    [stroke / time * 30.0 * x * x * (1.0 - x) ** 2],
                    [stroke / time**2 * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)],
                )
            )
        at, start = at + time + PAUSE, target
        points.append(TrajectoryPoint(at, [target], [0.0], [0.0]))
    return points


def controller_for(port: RobotPort, rig: Rig) -> Controller:
    """The suite's controller with gains designed for a rig, at the rate and delays of a port.

    Raises
    ------
    PamError
        If the numbers of the rig give no safe loop.
    """
    return Controller(
        rig,
        ControlSettings(
            period=port.period,
            measurement_delay=port.measurement_delay,
            command_delay=port.command_delay,
        ),
    )


def designed_gains(controller: Controller) -> list[dict[str, float]]:
    """The gains of the first joint at the stiffnesses for which they were designed."""
    schedule = controller.settings.gains[controller.rig.joints[0].name]
    return [
        {
            "stiffness": stiffness,
            "proportional": gains.proportional,
            "integral": gains.integral,
            "derivative": gains.derivative,
        }
        for stiffness, gains in zip(schedule.stiffnesses, schedule.gains, strict=True)
    ]


def track(
    port: RobotPort, controller: Controller, points: Sequence[TrajectoryPoint], limits: Limits
) -> Tracked:
    """Take the joint over, go to the start of a motion, follow it, and lower the joint.

    Parameters
    ----------
    port : RobotPort
        The robot; its muscles are empty.
    controller : Controller
        Of `controller_for`; what it had learnt is forgotten.
    points : sequence of TrajectoryPoint
        The motion, from rest to rest.
    """
    rig = controller.rig
    name = rig.joints[0].name
    controller.drop_commands()
    controller.forget_adaptation()
    log = Log.of_port(rig, port)
    rows: list[tuple[float, float, float]] = []
    seen, stopped, most = Seen(), "", np.zeros(3)
    commands = vented(rig)
    reading = first_reading(port, commands)
    where = float(points[-1].positions[0])
    way = [TrajectoryPoint(APPROACH, [where], [0.0], [0.0])]
    begin = reading.time + SETTLE + APPROACH + REST
    due = [(reading.time + SETTLE, way), (begin, list(points))]
    end = begin + points[-1].time_from_start
    followed = False
    try:
        while reading.time <= end and not stopped:
            now = reading.time
            seen, stopped = watched(seen, reading, limits, port.period)
            if not stopped and due and now >= due[0][0] - AHEAD:
                stopped = _follow(controller, name, *due.pop(0), now)
                if not stopped:  # the last commands held the resting joint meanwhile
                    reading = port.advance(commands)
                    now = reading.time
                    seen = seen._replace(time=now, position=reading.position)
            if stopped:
                break
            most = np.maximum(most, limits.shares(reading.pressures, seen.speed, reading.position))
            output = controller.step(now, _measurement(reading))
            if output.commands is None:
                stopped = output.reason
                break
            if now >= begin:
                sampled = reading.position_time - port.measurement_delay
                reference = controller.references.sample(name, sampled).position
                rows.append((now - begin, reference, reading.position))
            commands = (output.commands[0], output.commands[1])
            reading = port.advance(commands)
            log.add(reading, commands)
        followed = bool(rows) and not stopped
    finally:  # also at Ctrl-C
        if followed:
            _lower_by(port, controller, reading)
        else:
            lower(port, rig, reading, log)
    table = pd.DataFrame(np.array(rows).reshape(-1, 3), columns=COLUMNS)
    error = (table["reference"] - table["position"]).to_numpy()
    pressure, speed, place = most.tolist()
    return Tracked(
        float(np.sqrt(np.mean(error**2))) if followed else math.inf,
        float(np.abs(error).max()) if followed else math.inf,
        stopped,
        table,
        (pressure, speed, place),
    )


def _measurement(reading: JointReading) -> Measurement:
    """A reading as the controller takes it."""
    return Measurement(
        [reading.position], list(reading.pressures), reading.position_time, reading.pressure_time
    )


def _follow(
    controller: Controller,
    name: str,
    start: float,
    points: Sequence[TrajectoryPoint],
    now: float,
) -> str:
    """Follow a trajectory from `start` on [s]; why it is refused, or empty."""
    try:
        controller.references.follow([name], points, start=start, now=now)
    except CommandError as error:
        return str(error)
    return ""


def _lower_by(port: RobotPort, controller: Controller, reading: JointReading) -> None:
    """Lower the joint by the controller, then vent."""
    begin = reading.time
    controller.lower(begin)
    while reading.time - begin < LONGEST_LOWERING:
        output = controller.step(reading.time, _measurement(reading))
        if output.commands is None or controller.lowering.phase is LoweringPhase.DONE:
            break
        reading = port.advance((output.commands[0], output.commands[1]))
    rest(port, controller.rig, EMPTY)


def not_possible(error: PamError) -> Tracked:
    """A test that could not be made, because the rig file gives no safe controller."""
    return Tracked(math.inf, math.inf, str(error), pd.DataFrame(columns=COLUMNS))
