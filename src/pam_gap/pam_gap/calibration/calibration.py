"""The calibration of one joint: from a rig file that is off, and a log, to one that fits.

The order is that of the stages whose inputs are measured (`staged_fit`): wiring, regressions, gas
and valves, body, then all numbers together beside an ordinary background. What the log has not
narrowed stays as it is written.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from pam_gap.answer.improved_rig import with_number
from pam_gap.calibration.calibration_rules import DEFAULT as DEFAULT_RULES
from pam_gap.calibration.calibration_rules import CalibrationRules
from pam_gap.calibration.free_numbers import (
    GAS,
    STATICS,
    FreeRigNumber,
    Said,
    key_in_file,
    names_of,
)
from pam_gap.calibration.intervals import knowledge
from pam_gap.calibration.last_steps import FittedPoint, last_steps
from pam_gap.calibration.posterior import Posterior
from pam_gap.calibration.scale_of_forces import grows, scale_weights
from pam_gap.calibration.staged_fit import (
    JointFit,
    first_plant,
    fit_stage,
    fit_together,
    stages,
    without_false_stops,
)
from pam_gap.diagnose_recordings import usable_parts
from pam_gap.inference.hypothesis import Hypothesis
from pam_gap.prediction.channel_order import POSITION
from pam_gap.prediction.directions import valve_phase
from pam_gap.prediction.fit import Array
from pam_gap.prediction.gap_figures import GapFigure, gap_figures
from pam_gap.prediction.identifiable import what_is_missing
from pam_gap.prediction.materiality import squared_motion
from pam_gap.prediction.problem import PredictionProblem, PredictionSettings
from pam_gap.prediction.wrong_wiring import CABLES, wrong_wiring
from pam_gap.recordings.recording import Recording
from pam_gap.search.candidate_search import Progress, silent
from pam_model.plant.parameters import INDEX, UNITS, bounds_of
from pam_model.rig import Joint, Rig
from pam_model.rig.partial import PartialRig

NO_COMMANDS = f"{GAS}, which needs the commands"
"""The stage of numbers that were not sought, because the log has no commands."""
FINE: Final = 3
"""Digits of a number behind the first one of the width of its interval, or of itself."""
DETERMINED, RELATIVE, NARROWED, KEPT = "determined", "relative", "narrowed", "kept"


@dataclass(frozen=True, slots=True)
class CalibratedNumber:
    """What a calibration says of one number."""

    # key, unit, stage: key in the rig file, its unit, and the stage that finds it
    key: str
    unit: str
    stage: str
    written: float | None  # as it was written; None if it was missing
    value: float  # as it is in the new rig file
    # low, high: 90 % interval
    low: float
    high: float
    # `determined`; `relative` if only its ratio to the torque per pressure is known as well;
    # `narrowed` if it is known better than before, but not well; `kept` if the log says nothing of
    # it, so that it is as written
    status: str
    # 90 % interval if the torque per pressure is right; None for numbers that do not grow with it
    relative: tuple[float, float] | None = None
    stated: tuple[float, float] | None = None  # the range in the rig file, if it was one


@dataclass(slots=True)
class Calibration:
    """The result for one joint."""

    joint: str  # its name
    rig: Rig | None = None  # the calibrated rig; None if there is none, which `refused` explains
    numbers: tuple[CalibratedNumber, ...] = ()  # every number that was free
    refused: tuple[str, ...] = ()  # why no rig file is written, in full sentences
    # what is exchanged or reversed, in full sentences; it is part of `refused`, too
    wiring: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()  # what was assumed or is missing
    # errors on recordings that took no part in the fit, with the numbers as written and as found
    withheld: tuple[GapFigure, ...] = ()
    # sizes of small effects that every good rig has, as they were fitted; not in the rig file
    small: dict[str, float] = field(default_factory=dict)
    # RMS error of each stage before and after its fit, in multiples of the noise
    stage_errors: dict[str, tuple[float, float]] = field(default_factory=dict)
    # the numbers with their covariance; None if nothing was fitted
    posterior: Posterior | None = field(default=None, repr=False)
    problem: PredictionProblem | None = field(default=None, repr=False)
    before: Array | None = field(default=None, repr=False)
    after: Array | None = field(default=None, repr=False)


def calibrate_joint(
    partial: PartialRig,
    number: int,
    recordings: Sequence[Recording],
    withheld: Sequence[Recording] = (),
    *,
    said: Said,
    rules: CalibrationRules = DEFAULT_RULES,
    threads: int = 1,
    progress: Progress = silent,
) -> Calibration:
    """Find the numbers of one joint from recordings of it.

    Parameters
    ----------
    partial : PartialRig
        What the rig file says.
    recordings, withheld : sequence of Recording
        Recordings that are fitted, and others on which the result is tried.
    said : Said
        How far plain numbers of the rig file may be off.
    rules : CalibrationRules
        Hand-set constants.
    threads : int
        Number of simulations that run in parallel.
    progress : callable
        Called with the current task and the completed share.
    """
    rig = partial.rig
    result = Calibration(rig.joints[number].name)

    def problem_of(what: Rig, some: Sequence[Recording]) -> PredictionProblem:
        parts = usable_parts(what, number, some)
        usual = PredictionSettings(rules.horizon)
        found = PredictionProblem(what, number, parts, threads=threads, usual=usual)
        return without_false_stops(found, rules) if found.recorded[POSITION] else found

    progress("wiring", 0.0)
    problem = problem_of(rig, recordings)
    result.wiring = exchanges(problem, rules)
    result.refused = result.wiring or tuple(what_is_missing(problem))
    if result.refused:
        return result
    progress("first regressions", 0.05)
    numbers, vector = first_plant(problem, partial, said, rules)
    for step, stage in enumerate(stages(problem)):
        progress(f"stage: {stage.name}", 0.1 + 0.15 * step)
        vector, result.stage_errors[stage.name] = fit_stage(problem, stage, numbers, vector, rules)
    progress("all numbers together", 0.4)
    joint = fit_together(problem, numbers, vector, rules)
    found, result.posterior = conclusion(rig, result.joint, numbers, joint, rules)
    result.small = result.posterior.small
    names = {one.key: one.name for one in numbers}
    calibrated = rig
    for what in found:
        if what.status != KEPT:
            calibrated = with_number(calibrated, result.joint, names[what.key], what.value)
    result.numbers = (
        *found, *not_sought(partial, rig.joints[number], found, problem.base.values)
    )  # fmt: skip
    result.problem, result.before = problem, problem.base.values
    progress("withheld recordings", 0.9)
    after = problem_of(calibrated, recordings)
    result.after = after.base.values
    result.wiring = wrong_wiring(after)
    result.refused = (*result.wiring, *misfit(problem, joint.fitted, rules))
    if result.refused:
        return result
    result.rig = calibrated
    if withheld:
        judged = problem_of(rig, withheld)
        result.withheld = tuple(gap_figures(judged, result.before, result.after))
    return result


def exchanges(
    problem: PredictionProblem, rules: CalibrationRules = DEFAULT_RULES
) -> tuple[str, ...]:
    """What is exchanged or reversed in the recordings, in full sentences; empty if nothing is."""
    return wrong_wiring(problem) or one_valve_reversed(problem, rules)


def one_valve_reversed(problem: PredictionProblem, rules: CalibrationRules) -> tuple[str, ...]:
    """A valve whose pressure goes against its command, while the other one's follows its own.

    Two valves that disagree are evidence together, so that less coherence is needed than for one.
    """
    muscles = problem.rig.joints[problem.joint].muscles
    phases = [valve_phase(problem, side, rules.slow_band) for side in range(len(muscles))]
    least = min(phase.coherence for phase in phases)
    against = [phase.phase > 90.0 for phase in phases]
    off = max(min(phase.phase, 180.0 - phase.phase) for phase in phases)
    near = problem.rules.recording.direction_phase
    if least < rules.valve_coherence or off > near or sum(against) != 1:
        return ()
    side = against.index(True)
    return (
        f"Wrong wiring: the sign of the valve command of {muscles[side]} is reversed: "
        f"{phases[side].words('the command', 'the pressure')}; they should agree, at a phase near "
        f"0, as those of {muscles[1 - side]} do. {CABLES}",
    )


def conclusion(
    rig: Rig, name: str, numbers: Sequence[FreeRigNumber], joint: JointFit, rules: CalibrationRules
) -> tuple[tuple[CalibratedNumber, ...], Posterior]:
    """The numbers, fitted once more beside those of which the log says nothing."""
    fitter, fitted = joint.fitter, joint.fitted.result
    point, jacobian = last_steps(
        fitter, FittedPoint(fitted.values, fitted.amounts, fitted.errors), (), rules
    )
    known = knowledge(fitter, point, jacobian, rules)
    stated = [place for place, one in enumerate(numbers) if not one.is_ordinary]
    kept = known.kept(
        {
            k: rules.narrowed_length if numbers[k].stage == STATICS else rules.narrowed
            for k in stated
        }
    )
    spread = np.sqrt(np.diag(known.covariance()))
    for place, one in enumerate(numbers):  # a sensor is taken for right if it may be
        low, high = known.about(place, float(known.values[place]), float(spread[place]))
        if one.is_sensor and place not in kept and low <= one.free.centre <= high:
            kept.append(place)
    count, n = len(numbers), len(fitter.nuisances)
    given = known.given(kept)
    point, _ = last_steps(fitter, FittedPoint(given[:n], given[n:], point.errors), kept, rules)
    values, covariance = point.values, known.covariance(kept)
    weights = np.zeros(len(covariance))
    weights[:count] = scale_weights(rig, name, numbers)
    found = []
    for place in stated:
        one, value = numbers[place], float(values[place])
        ends = known.about(place, value, float(np.sqrt(covariance[place, place])))
        relative = None
        if grows(one) and one.free.is_logarithmic:
            row = np.eye(len(covariance))[place] - weights
            deviation = np.sqrt(max(float(row @ covariance @ row), 0.0))
            relative = known.about(place, value, float(deviation))
        if place in kept:
            status = KEPT
        elif _is_narrow(one, value, ends, rules):
            status = DETERMINED
        elif relative is not None and _is_narrow(one, value, relative, rules):
            status = RELATIVE
        else:
            status = NARROWED
        found.append(
            CalibratedNumber(
                one.key,
                one.unit,
                one.stage,
                one.written,
                value if status == KEPT else rounded(value, *ends),
                *ends,
                status,
                relative,
                one.stated,
            )
        )
    return tuple(found), Posterior(tuple(numbers), values[:count], covariance[:count, :count])


def rounded(value: float, low: float, high: float) -> float:
    """A number without the digits that its interval does not support."""
    size = high - low
    if low > 0.0 or high < 0.0:  # a wide interval of a small number leaves it its digits
        size = min(size, abs(value))
    if not (math.isfinite(size) and size > 0.0):
        return value
    return round(value, FINE - math.floor(math.log10(size)))


def not_sought(
    partial: PartialRig, joint: Joint, found: Sequence[CalibratedNumber], vector: Array
) -> tuple[CalibratedNumber, ...]:
    """The numbers that the rig file leaves open and of which a log of this kind says nothing.

    Parameters
    ----------
    partial : PartialRig
        What the rig file says.
    joint : Joint
        The joint.
    found : sequence of CalibratedNumber
        Those that were sought.
    vector : ndarray
        The plant parameters with which the log was predicted; a missing one was guessed.
    """
    sought = {one.key for one in found}
    left = []
    for name, stage in names_of(partial.rig, joint).items():
        key = key_in_file(name, joint)
        if key in sought or not (key in partial.ranges or key in partial.missing):
            continue
        if name == "joint.gravity_angle" and f"{joint.name}.gravity_torque" not in sought:
            continue  # gravity does not act on the joint
        stated, value = partial.ranges.get(key), float(vector[INDEX[name]])
        written, ends = value if stated else None, stated or bounds_of(name)
        where = NO_COMMANDS if stage == GAS else stage
        left.append(
            CalibratedNumber(key, UNITS[name], where, written, value, *ends, KEPT, stated=stated)
        )
    return tuple(left)


def misfit(
    problem: PredictionProblem, fitted: Hypothesis, rules: CalibrationRules
) -> tuple[str, ...]:
    """Channels that no numbers explain: the rig has something that no rig file describes."""
    share = np.sqrt(fitted.mean_square / np.maximum(squared_motion(problem), 1e-300))
    return tuple(
        f"{problem.names[c]}: the best numbers leave {100.0 * share[c]:.0f} % of the motion "
        "unexplained, so that none of them can be trusted. Check names, units and which robot was "
        "recorded (`pam gap import`), then run `pam gap diagnose`."
        for c in np.flatnonzero(problem.present)
        if share[c] > rules.misfit
    )


def _is_narrow(
    one: FreeRigNumber, value: float, ends: tuple[float, float], rules: CalibrationRules
) -> bool:
    """Whether an interval is narrow enough for a number to count as determined."""
    half = 0.5 * (ends[1] - ends[0])
    if one.unit == "rad":
        return half <= rules.determined_angle
    if one.is_sensor and one.unit == "Pa":
        return half <= one.free.prior
    return half <= rules.determined * abs(value)
