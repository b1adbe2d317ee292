"""Where the gap arises: in which stage, with which delays, and in which regimes of the motion.

Each stage is simulated from its measured inputs. The valve stage maps commands and measured motion
to pressures, the muscle stage maps measured pressures to pulls (where load cells were recorded),
and the joint stage maps measured pulls or pressures to the position. A channel's delay is the slope
of its errors over its own rate. The measured inputs contain noise, so that each stage has its own
noise floor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from operator import itemgetter

import numpy as np

from pam_gap.prediction.channel_order import (
    AGONIST_FORCE,
    AGONIST_PRESSURE,
    ANTAGONIST_FORCE,
    ANTAGONIST_PRESSURE,
    BOTH_PRESSURES,
    POSITION,
)
from pam_gap.prediction.fit import Array, mean_squares
from pam_gap.prediction.gap_figures import noise_level
from pam_gap.prediction.problem import PredictionProblem, PredictionSettings
from pam_gap.rules import DEFAULT
from pam_model.robot import compose
from pam_model.views.torque_balance import free_acceleration


@dataclass(frozen=True, slots=True)
class StageGap:
    """RMS error of one stage with measured inputs, over its floor; None if it was not measured."""

    stage: str
    inputs: str
    gap_over_floor: float | None
    note: str = ""


@dataclass(frozen=True, slots=True)
class Location:
    """Where the gap arises."""

    stages: tuple[StageGap, ...]  # the gap of each stage with measured inputs
    delays: tuple[tuple[str, float], ...]  # channel, and its delay behind the prediction [s]
    # regime of the motion, and its share of the squared error over its share of the time
    regimes: tuple[tuple[str, float], ...]
    # RMS over floor above which a stage counts as having a gap
    stage_from: float = DEFAULT.prediction.stage_from

    @property
    def worst(self) -> str | None:
        """The stage with the largest gap over its floor, None when none exceeds `stage_from`."""
        return worst_stage(self.stages, self.stage_from)


def worst_stage(stages: Sequence[StageGap], stage_from: float) -> str | None:
    """The stage with the largest gap over its floor, None when none exceeds `stage_from`."""
    gaps = [(s.gap_over_floor, s.stage) for s in stages if s.gap_over_floor is not None]
    gap, stage = max(gaps, key=itemgetter(0), default=(0.0, None))
    return stage if gap > stage_from else None


def _ratio(
    problem: PredictionProblem, values: Array, channels: Sequence[int], settings: PredictionSettings
) -> float | None:
    use = [c for c in channels if problem.present[c]]
    if not use:
        return None
    errors = problem.errors(values[None], settings)[0]
    floor = noise_level(problem, values, settings)
    return float(np.sqrt(np.max((mean_squares(errors, problem.counted) / floor)[use])))


def motion_from_pulls(problem: PredictionProblem) -> float | None:
    """Gap over floor of the position predicted from measured pulls; None if it diverges."""
    if not problem.present[POSITION:].all():
        return None
    joint = compose(problem.rig).joints[problem.joint]
    first, second = (arm.length for arm in joint.arms)
    pull = problem.rules.prediction.force_bandwidth
    worst = 0.0
    for data in problem.data:
        h = data.recording.sample_time
        results = []
        for extra in (0.0, 1.0):
            generator = np.random.default_rng(7)
            noise = extra * data.deviation * generator.standard_normal(data.measured.shape)
            seen = data.measured + noise
            torque = first * seen[:, AGONIST_FORCE] + second * seen[:, ANTAGONIST_FORCE]
            measured = seen[:, POSITION].tolist()
            q, w = measured[0], 0.0
            error = np.empty(len(measured))
            for k, (t, m) in enumerate(zip(torque.tolist(), measured, strict=True)):
                e = m - q
                error[k] = e
                w += pull**2 * h * e
                w += h * free_acceleration(joint, t, q, w)
                q += h * w + 2.0 * pull * h * e
                if not abs(q) < 100.0:
                    return None
            results.append(error[round(0.5 / h) :])
        rms = float(np.sqrt(np.mean(results[0] ** 2)))
        floor = float(np.sqrt(np.mean((results[1] - results[0]) ** 2)))
        worst = max(worst, rms / max(floor, 1e-12))
    return worst


def late_channels(problem: PredictionProblem, errors: Array) -> tuple[tuple[str, float], ...]:
    """Delay of each measured channel behind its prediction [s], by least squares on its rate."""
    found = []
    for c in (AGONIST_PRESSURE, ANTAGONIST_PRESSURE, POSITION):
        if not problem.present[c]:
            continue
        top = bottom = 0.0
        for data, start, end in zip(
            problem.data, problem.offsets[:-1], problem.offsets[1:], strict=True
        ):
            mean = data.rows(data.measured[:, c])
            rate = np.gradient(mean, data.row_time)
            e = errors[start:end, c] * data.block_deviation[c]
            known = np.isfinite(e) & problem.counted[start:end]
            top -= float(e[known] @ rate[known])
            bottom += float(rate[known] @ rate[known])
        found.append((problem.names[c], top / max(bottom, 1e-300)))
    return tuple(found)


POSITIONS = (
    "flexed towards the antagonist",
    "middle positions",
    "flexed towards the agonist",
    "moving up",
    "moving down",
)
LENGTHS = ("long muscle", "medium lengths", "short muscle", "shortening", "lengthening")
"""The same regimes of a muscle on a bench, whose invented joint turns as it shortens."""


def regimes(problem: PredictionProblem, errors: Array) -> tuple[tuple[str, float], ...]:
    """Share of the squared error in each regime over its share of the time, largest first.

    The regimes are low and high mean pressure, thirds of the position range, direction of motion,
    rest, fast motion, and the two halves of the time. The errors of each channel are divided by
    their mean square.
    """
    mean = np.maximum(mean_squares(errors, problem.counted), 1e-9)
    weight = np.nansum((errors**2 / mean)[:, problem.present], axis=1)
    weight = np.where(problem.counted, weight, 0.0)
    pressure, position, speed = np.zeros((3, problem.n_rows))
    for data, start, end in zip(
        problem.data, problem.offsets[:-1], problem.offsets[1:], strict=True
    ):
        mean_of = data.rows(data.measured)
        pressure[start:end] = mean_of[:, BOTH_PRESSURES][:, : len(problem.sides)].mean(axis=1)
        position[start:end] = mean_of[:, POSITION]
        step = data.row_time
        wide = max(1, round(0.04 / step))
        smooth = np.convolve(mean_of[:, POSITION], np.ones(wide) / wide, mode="same")
        speed[start:end] = np.gradient(smooth, step)
    cuts = np.quantile(position, [1 / 3, 2 / 3])
    middle = float(np.median(pressure))
    quick = float(np.quantile(np.abs(speed), 0.75))
    rest = 0.1 * quick
    time = np.arange(problem.n_rows) / problem.n_rows
    far, middle_part, near, up, down = LENGTHS if problem.is_bench else POSITIONS
    masks = {
        "low pressure": pressure < middle,
        "high pressure": pressure >= middle,
        far: position < cuts[0],
        middle_part: (position >= cuts[0]) & (position < cuts[1]),
        near: position >= cuts[1],
        up: speed > rest,
        down: speed < -rest,
        "at rest": np.abs(speed) <= rest,
        "fast motion": np.abs(speed) > quick,
        "first half of the time": time < 0.5,
        "second half of the time": time >= 0.5,
    }
    total = max(float(weight.sum()), 1e-300)
    result = []
    for name, mask in masks.items():
        share = float((mask & problem.counted).sum()) / max(int(problem.counted.sum()), 1)
        if share > 0.02:
            result.append((name, float(weight[mask].sum()) / total / share))
    return tuple(sorted(result, key=lambda item: -item[1]))


def locate(problem: PredictionProblem, values: Array, errors: Array) -> Location:
    """Find where the predictions of a plant differ from its recordings.

    Parameters
    ----------
    problem : PredictionProblem
        Rig and recordings.
    values : ndarray, shape (n_parameters,)
        Parameters of the plant: those of the rig file, re-tuned.
    errors : ndarray, shape (n_rows, channels)
        Whitened prediction errors of this plant.
    """
    stages: list[StageGap] = []
    if problem.has_commands:
        stages.append(
            StageGap(
                "valve",
                "commands and measured motion -> pressures",
                _ratio(
                    problem,
                    values,
                    (AGONIST_PRESSURE, ANTAGONIST_PRESSURE),
                    PredictionSettings(
                        follow_motion=problem.is_bench or bool(problem.present[POSITION])
                    ),
                ),
            )
        )
    else:
        stages.append(
            StageGap("valve", "commands -> pressures", None, "no valve commands in the recording")
        )
    pulls = _ratio(
        problem,
        values,
        (AGONIST_FORCE, ANTAGONIST_FORCE),
        PredictionSettings(follow_pressures=True, follow_motion=True),
    )
    stages.append(
        StageGap(
            "muscle",
            "measured pressures and motion -> pulls",
            pulls,
            "" if pulls is not None else "no load cells: muscle and joint are judged together",
        )
    )
    moved = None if problem.is_bench else motion_from_pulls(problem)
    if problem.is_bench:
        stages.append(StageGap("joint", "", None, "a bench without a joint"))
    elif moved is not None:
        stages.append(StageGap("joint", "measured pulls -> position", moved))
    else:
        stages.append(
            StageGap(
                "joint",
                "measured pressures -> position",
                _ratio(problem, values, (POSITION,), PredictionSettings(follow_pressures=True)),
                "" if problem.present[POSITION] else "no joint position in the recording",
            )
        )
    delays = late_channels(problem, errors)
    stage_from = problem.rules.prediction.stage_from
    return Location(tuple(stages), delays, regimes(problem, errors), stage_from)
