"""Whether swings are reported: every rig that swings at rest, soon, and none that does not.

`pam check reported-swings` plays the motions of `rough_control` on the independent plant with
hidden effects, pairs of them and delays, and lets the joint rest after each. A joint that goes on
swinging has to be reported within three seconds, by what the controller says or does. With
`--ordinary`, each rig with one effect plays drawn motions for so long, as robots at work do:
reaches, pauses and sines. What is reported there of a joint that swings neither at rest nor in the
second before is a false alarm.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Final

import numpy as np

from pam_check.blind.effect_cases import KNOWN
from pam_check.blind.truth_plant import Array, Sensors
from pam_check.control.closed_loop import (
    APPROACH,
    MOTIONS_BEGIN_AT,
    PERIOD,
    SETTLED,
    START_PRESSURE,
    TOLD,
)
from pam_check.control.hidden_rigs import NOTHING, HiddenRig, chosen_rigs, names
from pam_check.control.rough_control import RoughControl
from pam_check.control.running_truth import RunningTruth
from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_control.references.trajectory import TrajectoryPoint
from pam_model.command_line import Arguments, Outcome, progress
from pam_model.common_options import chosen_rig
from pam_model.rig import load_rig

RESTS: Final = 5.0  # s, after the motion
JUDGED: Final = 2.0  # s, the end of the rest
LEAST: Final = 3e-3  # rad from peak to peak; what swings less is harmless
SWINGS_BY: Final = 2e-3  # rad that a swing goes at least, for which an alarm is right
FEWEST_WAYS, SHOWN_WITHIN = 4, 1.0  # to and fro, and in how many seconds before the alarm
TOLD_WITHIN: Final = 3.0  # s after the joint should rest
LONGEST_PIECE: Final = 20.0  # s of ordinary motion, after which the controller starts anew
PAUSES: Final = (0.1, 2.0)  # s
REACHES: Final = (0.6, 2.0)  # s
SINES: Final = (0.2, 1.5)  # Hz
STEP: Final = 0.02  # s between waypoints
FADED: Final = 0.15  # share of a sine in which it is faded in, and out


@dataclass(frozen=True, slots=True)
class SwingResult:
    """One motion on one rig.

    Attributes
    ----------
    rig, motion : str
        What was hidden and what was played.
    size : float
        Way of the true error from peak to peak at the end of the rest, without its drift [rad];
        infinite if the controller stopped.
    told_at : float
        When swings were told or acted upon first, after the motion began [s]; infinite if never.
    late : float
        The same after the joint should have come to rest; negative in motion [s].
    told : str
        What was told.
    swung : bool
        Whether the true error went to and fro in the second before it was told.
    """

    rig: str
    motion: str
    size: float
    told_at: float
    late: float
    told: str
    swung: bool = False

    @property
    def swings(self) -> bool:
        """Whether the joint swings at rest."""
        return LEAST < self.size < math.inf

    @property
    def untold(self) -> bool:
        """Whether the joint swings at rest and this was not told in time."""
        return self.swings and not self.late <= TOLD_WITHIN


def played(
    controller: Controller,
    truth: HiddenRig,
    points: Sequence[TrajectoryPoint],
    seed: int,
    rests: float = RESTS,
) -> Iterator[tuple[float, float, str]]:
    """Play a motion and rest, cycle by cycle.

    Yields
    ------
    tuple of float, float, str
        Time after the motion began [s]; error of the true angle [rad], NaN where the controller
        has stopped, which is the end; and what was told so far.
    """
    moves = points[-1].time_from_start
    count, begin = round((SETTLED + moves + rests) / PERIOD), round(SETTLED / PERIOD)
    controller.drop_commands()
    controller.forget_adaptation()
    plant = RunningTruth(
        *truth, Sensors(), np.random.default_rng(seed), period=PERIOD, count=count,
        pressure=START_PRESSURE,
    )  # fmt: skip
    name, guard = controller.rig.joints[0].name, controller.guard
    approach = [TrajectoryPoint(APPROACH[1], [MOTIONS_BEGIN_AT], [0.0], [0.0])]
    starts = {round(APPROACH[0] / PERIOD): approach, begin: points}
    commands = (0.0, 0.0)
    for k in range(count):
        now = k * PERIOD
        shown = plant.advance(commands)
        if k in starts:
            controller.references.follow([name], starts[k], start=None, now=now)
        output = controller.step(now, Measurement([shown[2]], [shown[0], shown[1]], now, now))
        told = guard.stopped or guard.softened or guard.swings
        if output.commands is None:
            yield now - SETTLED, math.nan, told
            return
        commands = (output.commands[0], output.commands[1])
        reference = controller.references.sample(name, now).position
        yield now - SETTLED, reference - float(plant.truth[k, 2]), told


def watch(
    controller: Controller, truth: HiddenRig, points: Sequence[TrajectoryPoint], seed: int
) -> tuple[float, float, str, bool]:
    """Play a motion and rest, and watch what is told first.

    Returns
    -------
    size : float
        Of the swing at rest [rad]; infinite if the controller has stopped the joint.
    told_at : float
        After the motion began [s].
    told : str
        What was told first.
    swung : bool
        Whether the joint swung before that.
    """
    errors: list[float] = []
    told_at, first, swung = math.inf, "", False
    for time, error, told in played(controller, truth, points, seed):
        errors.append(error)
        if told and not first:
            told_at, first = time, told
            before = errors[-round(SHOWN_WITHIN / PERIOD) :]
            swung = ways(before, SWINGS_BY) >= FEWEST_WAYS
    if math.isnan(errors[-1]):
        return math.inf, told_at, first, swung
    return swing_size(np.array(errors[-round(JUDGED / PERIOD) :])), told_at, first, swung


def ways(errors: Sequence[float], least: float) -> int:
    """How often an error goes at least so far in one direction, and then in the other."""
    count, direction, low, high = 0, 0, errors[0], errors[0]
    for error in errors:
        low = error if direction > 0 else min(low, error)
        high = error if direction < 0 else max(high, error)
        if direction <= 0 and error - low >= least:
            count, direction, high = count + 1, 1, error
        elif direction >= 0 and high - error >= least:
            count, direction, low = count + 1, -1, error
    return count


def swing_size(errors: Array) -> float:
    """Way from peak to peak of an error without its drift, in its unit."""
    times = np.arange(errors.size)
    return float(np.ptp(errors - np.polyval(np.polyfit(times, errors, 1), times)))


@dataclass(frozen=True, slots=True)
class Act:
    """A reach of minimum jerk, or a sine that is faded in and out.

    Attributes
    ----------
    begin, lasts : float
        [s].
    at, stroke, amplitude : float
        Where it begins, the way of a reach, and of a sine its amplitude [rad].
    turns : float
        Of a sine [-].
    """

    begin: float
    lasts: float
    at: float
    stroke: float
    amplitude: float
    turns: float

    def angle(self, times: Array) -> Array:
        """Angles at some times [rad]; twice differentiable."""
        x = np.clip((times - self.begin) / self.lasts, 0.0, 1.0)
        fade = _smooth(np.minimum(1.0, np.minimum(x, 1.0 - x) / FADED))
        wave = self.amplitude * fade * np.sin(2.0 * math.pi * self.turns * x)
        return self.at + self.stroke * _smooth(x) + wave

    def points(self, positions_only: bool) -> list[TrajectoryPoint]:
        """Its waypoints; with velocities and accelerations, unless only positions are wanted."""
        h = 1e-4
        count = round(self.lasts / STEP)
        times = self.begin + STEP * np.arange(1, count + 1, dtype=np.float64)
        before, middle, after = (self.angle(times + shift) for shift in (-h, 0.0, h))
        if positions_only:
            return [
                TrajectoryPoint(float(t), [float(q)]) for t, q in zip(times, middle, strict=True)
            ]
        speeds, pushes = (after - before) / (2.0 * h), (after - 2.0 * middle + before) / h**2
        speeds[-1] = pushes[-1] = 0.0
        return [
            TrajectoryPoint(*(float(t), [float(q)], [float(v)], [float(a)]))
            for t, q, v, a in zip(times, middle, speeds, pushes, strict=True)
        ]


def _smooth(x: Array) -> Array:
    """From 0 to 1 with minimum jerk."""
    return x**3 * (10.0 - 15.0 * x + 6.0 * x * x)


def ordinary_motion(random: np.random.Generator, seconds: float) -> list[TrajectoryPoint]:
    """Drawn reaches of minimum jerk, pauses and sines, within so long [s].

    In one half of the motions, only positions are given, as a recording or a policy does; in the
    others velocities and accelerations, too, as a planner does.
    """
    points: list[TrajectoryPoint] = []
    time, at = 0.0, MOTIONS_BEGIN_AT
    positions_only = bool(random.uniform() < 0.5)
    while True:
        if random.uniform() < 0.7:
            target = float(random.uniform(-0.6, 0.6))
            lasts = float(random.uniform(*REACHES)) * max(1.0, abs(target - at) / 0.6)
            turns = amplitude = 0.0
        else:
            target, turns = at, float(random.integers(2, 6))
            lasts = turns / float(random.uniform(*SINES))
            amplitude = min(0.25, 0.6 - abs(at)) * (1.0 if at < 0.0 else -1.0)
        lasts = round(lasts / STEP) * STEP
        if time + lasts > seconds:
            if points:
                return points
            continue  # the first one is longer than the whole
        points += Act(time, lasts, at, target - at, amplitude, turns).points(positions_only)
        time, at = time + lasts + float(random.uniform(*PAUSES)), target
        fields = ((), ()) if positions_only else ([0.0], [0.0])
        points.append(TrajectoryPoint(time, [at], *fields))


def _watched(
    rough: RoughControl, rig: str, motion: str, points: Sequence[TrajectoryPoint], seed: int
) -> SwingResult:
    size, told_at, told, swung = watch(rough.controller, rough.hidden(rig), points, seed)
    late = told_at - points[-1].time_from_start
    return SwingResult(rig, motion, size, told_at, late, told, swung)


def _swings(rough: RoughControl, rig: str) -> list[SwingResult]:
    return [
        _watched(rough, rig, motion, points, rough.seed) for motion, points in rough.motions.items()
    ]


def _ordinary(rough: RoughControl, rig: str, seconds: float) -> list[SwingResult]:
    results, number = [], 0
    while seconds > 0.0:
        piece = min(seconds, LONGEST_PIECE)
        random = np.random.default_rng([rough.seed, names().index(rig), number])
        points = ordinary_motion(random, max(piece, 5.0))
        results.append(_watched(rough, rig, f"piece {number}", points, rough.seed + number))
        seconds, number = seconds - piece, number + 1
    return results


def _row(result: SwingResult) -> str:
    size = "stopped" if math.isinf(result.size) else f"{1e3 * result.size:.1f} mrad"
    told = f"after {result.told_at:.1f} s: {result.told}" if result.told else "nothing told"
    return f"{result.rig:40s} {result.motion:10s} {size:>10s} {'UNTOLD' * result.untold:6s} {told}"


def run(given: Arguments) -> Outcome:
    """Play all motions and print the table; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        For a rig that is unknown or cannot be used.
    """
    rigs = chosen_rigs("--rigs", given.rigs, [NOTHING, *KNOWN] if given.ordinary else names())
    settings = TOLD.replace(adaptation=not given.no_adaptation)
    rough = RoughControl(load_rig(chosen_rig(given)), settings, given.seed)
    results: list[SwingResult] = []
    with progress(len(rigs), "rigs") as bar:
        for done, name in enumerate(rigs, start=1):
            found = (
                _ordinary(rough, name, given.ordinary) if given.ordinary else _swings(rough, name)
            )
            results += found
            for result in found:
                if not given.ordinary or result.told or result.swings:
                    print(_row(result), flush=True)
            bar.show(done, name)
    untold = [result for result in results if result.untold]
    swinging = {result.rig for result in results if result.size > LEAST}
    false = [
        result for result in results if result.told and not (result.swung or result.rig in swinging)
    ]
    told = {result.rig for result in results if result.told}
    print(
        f"{len(rigs)} rigs: {len(swinging)} swing at rest or are stopped, "
        f"{len({result.rig for result in untold})} of them untold after {TOLD_WITHIN:g} s; of "
        f"{len(told)} something is told, of {len({result.rig for result in false})} that do "
        "not swing"
    )
    problems = [f"{each.rig}, {each.motion}: {1e3 * each.size:.1f} mrad untold" for each in untold]
    if given.ordinary:
        problems += [f"{each.rig}, {each.motion}: {each.told}" for each in false]
    return Outcome({"seed": given.seed, "results": [asdict(each) for each in results]}, problems)
