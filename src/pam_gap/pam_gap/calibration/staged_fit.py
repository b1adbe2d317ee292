"""Fits in stages, each with measured inputs, and then of all numbers together.

The gas is simulated along the measured motion, the body along the measured pressures, so that no
error of one stage passes on to the next. Linear regressions (`pam_model.identify.joint_regression`)
give the start of each stage.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pam_gap.calibration.calibration_rules import CalibrationRules
from pam_gap.calibration.free_numbers import (
    BODY,
    GAS,
    ORDINARY_BODY,
    ORDINARY_VALVE,
    SENSORS,
    STATICS,
    FreeRigNumber,
    Said,
    free_numbers,
)
from pam_gap.calibration.small_errors import ValvePlay, small_errors
from pam_gap.inference.background import Background, has_regulators
from pam_gap.inference.hypothesis import Hypothesis, HypothesisFitter
from pam_gap.prediction.channel_order import BOTH_PRESSURES, N_CHANNELS, POSITION
from pam_gap.prediction.fit import Array, fit
from pam_gap.prediction.gap_figures import noise_level
from pam_gap.prediction.problem import PredictionProblem, PredictionSettings
from pam_gap.recordings.recording import LOCKED, SHUT, TURNED_OVER
from pam_model.identify.joint_regression import MotionRecord, body_regression, valve_regression
from pam_model.plant.muscle_arms import SIDES
from pam_model.plant.parameters import INDEX, NAMES
from pam_model.rig.partial import PartialRig

GAS_SETTINGS = PredictionSettings(follow_motion=True)
BODY_SETTINGS = PredictionSettings(follow_pressures=True)


def motion_records(problem: PredictionProblem) -> list[MotionRecord]:
    """The recordings in which the joint moves freely, as regressions take them."""
    return [
        MotionRecord(
            data.recording.sample_time,
            data.commands if data.has_commands else None,
            data.measured[:, BOTH_PRESSURES],
            data.measured[:, POSITION],
            np.pi if data.recording.mounting == TURNED_OVER else 0.0,
        )
        for data in problem.data
        if data.recording.mounting not in (LOCKED, SHUT)
        and data.external is None
        and problem.recorded[POSITION]
    ]


def without_false_stops(problem: PredictionProblem, rules: CalibrationRules) -> PredictionProblem:
    """The problem with stops that the joint does not meet where it has moved.

    A stop that the joint has passed is not where the rig file says: its encoder has another zero.
    The simulated joint would lose its speed there, and whether it just reaches the stop would
    depend on every number.
    """
    low, high = (problem.base[f"joint.{end}_limit"] for end in ("lower", "upper"))
    angles = [data.measured[:, POSITION] for data in problem.data]
    least = float(np.min([np.nanmin(one) for one in angles])) - rules.stop_margin
    most = float(np.max([np.nanmax(one) for one in angles])) + rules.stop_margin
    if low <= least and most <= high:
        return problem
    changed = {"joint.lower_limit": min(low, least), "joint.upper_limit": max(high, most)}
    return problem.based_on(changed)


def first_numbers(
    problem: PredictionProblem, partial: PartialRig, lengths: Mapping[str, float]
) -> dict[str, float]:
    """The written numbers, and those of the regressions where they can be used.

    Parameters
    ----------
    problem : PredictionProblem
        The rig as written, and its recordings.
    partial : PartialRig
        What the rig file says.
    lengths : mapping of str to float
        Relative standard deviation of each length, by plant parameter.
    """
    start = dict(zip(NAMES, problem.base.values.tolist(), strict=True))
    records = motion_records(problem)
    if not records:
        return start
    for name, value in body_regression(problem.rig, problem.joint, records, lengths).items():
        if name in start and (value > 0.0 or name.endswith("_angle")):
            start[name] = value
        elif name.startswith("factor "):
            start[name.removeprefix("factor ")] *= value
    for side, owner in enumerate(SIDES):
        found = valve_regression(problem.rig, problem.joint, side, records)
        muscle = problem.rig.joints[problem.joint].muscles[side]
        for key, value in found.items():
            # a dead volume is the small difference of large ones: better than nothing, no more
            if value > 0.0 and (key != "dead_volume" or f"{muscle}.{key}" in partial.missing):
                start[f"{owner}.{key}"] = value
    return start


def first_plant(
    problem: PredictionProblem, partial: PartialRig, said: Said, rules: CalibrationRules
) -> tuple[tuple[FreeRigNumber, ...], Array]:
    """The free numbers, and the plant with the first numbers of the regressions.

    Parameters
    ----------
    problem : PredictionProblem
        The rig as written, and its recordings.
    partial : PartialRig
        What the rig file says.
    said : Said
        How far plain numbers of it may be off.
    rules : CalibrationRules
        Hand-set constants.

    Returns
    -------
    numbers : tuple of FreeRigNumber
        What a calibration may change.
    vector : ndarray, shape (n_parameters,)
        The plant from which the first stage begins.
    """
    joint = partial.rig.joints[problem.joint]
    start = dict(zip(NAMES, problem.base.values.tolist(), strict=True))
    has = problem.has_commands
    numbers = free_numbers(partial, joint, start, said, rules, has_commands=has)
    lengths = {one.name: one.free.prior for one in numbers if one.stage == STATICS}
    first = first_numbers(problem, partial, lengths)
    start |= {one.name: first[one.name] for one in numbers if one.written is None}
    numbers = free_numbers(partial, joint, start, said, rules, has_commands=has)
    vector = problem.base.values.copy()
    for one in numbers:
        begin = one.free.centre if one.is_ordinary else first[one.name]
        vector[[INDEX[name] for name in one.targets]] = min(max(begin, one.free.low), one.free.high)
    return numbers, vector


@dataclass(frozen=True, slots=True)
class FitStage:
    """One stage: which numbers it finds, from which channels, with which inputs measured."""

    name: str
    numbers: tuple[str, ...]
    channels: tuple[int, ...]
    settings: PredictionSettings


def stages(problem: PredictionProblem) -> tuple[FitStage, ...]:
    """The stages that the recorded channels permit."""
    found = []
    pressures = tuple(range(N_CHANNELS))[BOTH_PRESSURES]
    if problem.has_commands and problem.recorded[POSITION]:
        found.append(FitStage(GAS, (GAS, SENSORS, ORDINARY_VALVE), pressures, GAS_SETTINGS))
    if problem.recorded[POSITION]:
        others = tuple(c for c in range(N_CHANNELS) if c not in pressures)
        found.append(FitStage(BODY, (STATICS, BODY, SENSORS, ORDINARY_BODY), others, BODY_SETTINGS))
    return tuple(found)


def fit_stage(
    problem: PredictionProblem,
    stage: FitStage,
    numbers: Sequence[FreeRigNumber],
    vector: Array,
    rules: CalibrationRules,
) -> tuple[Array, tuple[float, float]]:
    """The plant with the numbers of one stage fitted, and the RMS errors before and after.

    The errors are those of the channels of the stage, in multiples of their noise.

    Parameters
    ----------
    problem : PredictionProblem
        The recordings.
    stage : FitStage
        One of `stages`.
    vector : ndarray, shape (n_parameters,)
        The plant before.
    """
    own = [one for one in numbers if one.stage in stage.numbers]
    compared = [c for c in stage.channels if problem.recorded[c]]
    if not own or not compared:
        return vector, (float("nan"), float("nan"))
    left_out = [c for c in range(N_CHANNELS) if c not in compared]
    places = [np.array([INDEX[name] for name in one.targets]) for one in own]
    problem = ValvePlay.usual(problem).applied(problem)

    def predict(lanes: Array) -> Array:
        full = problem.vectors(vector, places, [False] * len(own), lanes)
        errors = problem.errors(full, stage.settings)
        errors[..., left_out] = np.nan
        return errors

    def rms(lane: Array) -> float:
        error = predict(lane[None])[0, problem.counted]
        return float(np.sqrt(np.nanmean(error[:, compared] ** 2)))

    floor = noise_level(problem, vector, stage.settings)
    start = np.array([vector[INDEX[one.name]] for one in own])
    found = fit(
        predict,
        [rules.weighted(one.free) for one in own],
        start,
        rows=problem.counted,
        floor=floor,
        max_iterations=rules.stage_steps,
    )
    result: Array = problem.vectors(vector, places, [False] * len(own), found.values[None])[0]
    return result, (rms(start), rms(found.values))


@dataclass(frozen=True)
class JointFit:
    """The fit of all numbers together."""

    fitter: HypothesisFitter  # its numbers, and the small errors of valves and sensors beside them
    fitted: Hypothesis  # the result, without effects of the table


def fit_together(
    problem: PredictionProblem,
    numbers: Sequence[FreeRigNumber],
    vector: Array,
    rules: CalibrationRules,
) -> JointFit:
    """All numbers at once, beside the small errors of valves and sensors of a good rig.

    How a regulator controls its outlet is its maker's secret, and two poles with a limited flow
    describe it roughly. The body is therefore fitted along the measured pressures of regulators, as
    in its own stage. Along predicted pressures, it would make up for their errors.

    Parameters
    ----------
    problem, numbers, vector, rules
        As for `fit_stage`.
    """
    if has_regulators(problem):
        problem = problem.with_usual(replace(problem.usual, apart=True))
    floor = noise_level(problem, vector)
    valves = ValvePlay.usual(problem)
    values = np.array([vector[INDEX[one.name]] for one in numbers])
    for turn in range(rules.rounds):
        played = valves.applied(problem)
        fitter = HypothesisFitter(played, floor, [one.nuisance(rules) for one in numbers])
        values = np.concatenate(  # a bag adds the transport time of its messages
            [values, [n.free.centre for n in fitter.nuisances[len(values) :]]]
        )
        at = fitter.vector((), values)
        terms = small_errors(problem, valves, at, rules)
        fitter.parts = fitter.background = Background(("",) * len(terms.free), terms)
        tolerance = rules.tolerance if turn else None
        fitted = fitter.fit((), values, max_iterations=rules.last_steps, tolerance=tolerance)
        values = fitted.result.values
        if turn < rules.rounds - 1:
            valves = valves.moved(fitted.result.amounts)
    return JointFit(fitter, fitted)
