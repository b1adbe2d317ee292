"""A controller in closed loop with the independent plant, and how well it did.

The controller is the object that the node steps. It is driven at 500 Hz; its commands act one
period after the measurement that they are computed from, and it is told this delay.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pam_check.blind.plants import FIRST
from pam_check.blind.truth_plant import Sensors, TruthJoint, TruthMuscle
from pam_check.control.running_truth import RUNNING
from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.settings import ControlSettings
from pam_model.errors import PamError
from pam_model.rig import Rig

PERIOD: Final = 0.002  # s
SETTLED: Final = 1.5  # s, from the take-over to the motion
APPROACH: Final = (0.2, 0.8)  # s after the take-over, and duration, of the way to the start
MOTIONS_BEGIN_AT: Final = 0.0  # rad
RESTS: Final = 2.0  # s, after the motion
JUDGED: Final = 1.0  # s, the end of the rest, where nothing may move
LIMIT_CYCLE: Final = 4e-3  # rad from peak to peak at rest, ten steps of the encoder
CLIPPED: Final = 0.999  # spool command
START_PRESSURE: Final = 2.0e5  # Pa

Muscles = tuple[TruthMuscle, TruthMuscle]
TOLD: Final = ControlSettings(period=PERIOD, measurement_delay=0.0, command_delay=PERIOD)
"""Settings with the delays of this loop."""


@dataclass(frozen=True, slots=True)
class PlayedRun:
    """How a controller played a motion.

    Attributes
    ----------
    rms : float
        RMS error of the true angle during the motion [rad]; infinite if it stopped.
    clipped : float
        Share of the motion in which a valve was at its end, of the valve that was there longer [-].
    limit_cycle : float
        True motion at rest, from peak to peak, without its drift [rad].
    activity : float
        Mean change of the spool commands per second of the motion [1/s].
    stopped, softened : str
        Why the controller stopped, or used soft gains; empty if it did not.
    swings : str
        What it told of small swings; empty if it saw none.
    """

    rms: float
    clipped: float
    limit_cycle: float
    activity: float
    stopped: str = ""
    softened: str = ""
    swings: str = ""

    @property
    def cycles(self) -> bool:
        """Whether the joint ends in a limit cycle, or the controller had to stop it."""
        return bool(self.stopped) or self.limit_cycle > LIMIT_CYCLE


def true_rig(rig: Rig) -> tuple[TruthJoint, Muscles]:
    """The first joint of a rig file as the independent plant has it.

    Raises
    ------
    PamError
        For a rig whose nominal physics this plant does not have.
    """
    joint = rig.joints[0]
    muscles = tuple(rig.muscle(name) for name in joint.muscles)
    for muscle in muscles:
        if muscle.model != "chou_hannaford" or muscle.wall_thickness != 0.0:
            raise PamError(f"{muscle.name}: model must be chou_hannaford with wall_thickness 0")
        if muscle.valve.kind != "flow":
            raise PamError(f"{muscle.name}: valve.kind must be flow")
    named = [rig.effects, joint.effects, *(muscle.effects for muscle in muscles)]
    if rig.gas.polytropic_exponent != 1.0 or any(named):
        raise PamError("the rig file must have gas.polytropic_exponent 1 and name no effects")
    first, second = (
        TruthMuscle(
            thread_length=muscle.thread_length,
            turns=muscle.turns,
            rest_length=muscle.rest_length,
            neutral_length=muscle.neutral_length,
            dead_volume=muscle.dead_volume,
            sonic_conductance=muscle.valve.sonic_conductance,
            critical_ratio=muscle.valve.critical_ratio,
            time_constant=muscle.valve.time_constant,
        )
        for muscle in muscles
    )
    lower, upper = joint.position_limits
    truth = TruthJoint(
        pulley_radius=joint.pulley_radius,
        inertia=joint.inertia,
        viscous_friction=joint.viscous_friction,
        gravity_torque=joint.gravity_torque,
        gravity_angle=joint.gravity_angle,
        lower_limit=lower,
        upper_limit=upper,
        temperature=rig.gas.temperature,
        ambient_pressure=rig.gas.ambient_pressure,
        supply_pressure=rig.supply_pressure,
    )
    return truth, (first, second)


class RunTrace:
    """What happened in a run, one row per period.

    Attributes
    ----------
    position, measured : ndarray
        True angle, and that of the encoder [rad].
    reference : ndarray
        Angle, velocity and acceleration [rad], [rad/s], [rad/s^2].
    pressures, commands : ndarray
        Measured [Pa]; spool positions computed from this sample [-].
    """

    def __init__(self, count: int) -> None:
        self.position = np.full(count, math.nan)
        self.measured = np.full(count, math.nan)
        self.reference = np.full((count, 3), math.nan)  # with velocity and acceleration
        self.pressures = np.full((count, 2), math.nan)
        self.commands = np.zeros((count, 2))


def play(
    controller: Controller,
    joint: TruthJoint,
    muscles: Muscles,
    points: Sequence[TrajectoryPoint],
    seed: int,
    goes_to: float | None = MOTIONS_BEGIN_AT,
    plant_name: str = FIRST,
) -> tuple[PlayedRun, RunTrace]:
    """Hold, go to where motions begin, follow one, hold; return the figures and what happened.

    The joint goes to the beginning because an encoder with a wrong zero shows another angle at
    first: without it, the motion would begin with a jump that no effect of the rig explains. A
    motion that is learnt by repetitions has to be the only one under its name (`goes_to` None).
    `plant_name` is one of `RUNNING`.
    """
    motion = points[-1].time_from_start
    count = round((SETTLED + motion + RESTS) / PERIOD)
    plant = RUNNING[plant_name](
        joint,
        muscles,
        Sensors(),
        np.random.default_rng(seed),
        period=PERIOD,
        count=count,
        pressure=START_PRESSURE,
    )
    controller.drop_commands()
    name = controller.rig.joints[0].name
    # no law can see the zero of the encoder: the error is that of the angle without noise
    offset = joint.position_offset
    trace, commands = RunTrace(count), (0.0, 0.0)
    approach, begin = round(APPROACH[0] / PERIOD), round(SETTLED / PERIOD)
    stopped = ""
    for k in range(count):
        now = k * PERIOD
        shown = plant.advance(commands)
        if k == approach and goes_to is not None:
            start = [TrajectoryPoint(APPROACH[1], [goes_to], [0.0], [0.0])]
            controller.references.follow([name], start, start=None, now=now)
        if k == begin:
            controller.references.follow([name], points, start=None, now=now)
        output = controller.step(now, Measurement([shown[2]], [shown[0], shown[1]], now, now))
        if output.commands is None:
            stopped = output.reason
            break
        commands = (output.commands[0], output.commands[1])
        reference = controller.references.sample(name, now)
        trace.reference[k] = reference.position, reference.velocity, reference.acceleration
        trace.position[k] = plant.truth[k, 2] + offset
        trace.pressures[k], trace.measured[k] = shown[:2], shown[2]
        trace.commands[k] = commands
    moving = slice(begin, begin + round(motion / PERIOD))
    spools = trace.commands[moving]
    error = (trace.reference[:, 0] - trace.position)[moving]
    resting = trace.position[-round(JUDGED / PERIOD) :]
    still = math.inf
    if not stopped:
        index = np.arange(resting.size)
        still = float(np.ptp(resting - np.polyval(np.polyfit(index, resting, 1), index)))
    played = PlayedRun(
        rms=math.inf if stopped else float(np.sqrt(np.mean(error**2))),
        clipped=float(np.mean(np.abs(spools) >= CLIPPED, axis=0).max()),
        limit_cycle=still,
        activity=float(np.abs(np.diff(spools, axis=0)).sum() / motion),
        stopped=stopped,
        softened=controller.guard.softened,
        swings=controller.guard.swings,
    )
    return played, trace
