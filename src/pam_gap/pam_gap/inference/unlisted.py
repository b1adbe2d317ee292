"""Causes outside the table of effects: parts of a background far beyond their ordinary size.

An ordinary background has parts that no effect of the table describes: spools with hysteresis,
pressure sensors that are not linear or drift, and eccentric encoders. They can be as large on a bad
rig as any effect of the table. Some known effect then often imitates them: an eccentric encoder
looks almost like an offset, and a spool with hysteresis like a dead zone and a delay. Each part is
therefore fitted once without its ordinary bounds, as an explanation that competes with the effects
of the table, and so is an end stop that the balance of torques shows
(`pam_gap.prediction.end_stop`). What fits best need not be in the table (fault isolation with a
class for unknown faults: Isermann, Fault-Diagnosis Systems, Springer 2006, chapter 16).

The amounts change the recordings instead of the plant. They are found by Gauss-Newton steps, whose
columns are the slopes of the errors over the amounts (`pam_gap.prediction.linear_terms`).
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from pam_gap.inference.background import Background, SensorPart, encoder_part, sensor_parts
from pam_gap.inference.held_out import Folds, HeldOut, score_all
from pam_gap.inference.hypothesis import FitTask, Hypothesis, HypothesisFitter
from pam_gap.prediction.channel_order import POSITION
from pam_gap.prediction.channels import Channels
from pam_gap.prediction.end_stop import EndStop, end_stop
from pam_gap.prediction.fit import Array
from pam_gap.prediction.linear_terms import LinearTerms
from pam_gap.prediction.problem import PredictionProblem

LARGEST = 1000.0
"""Bound of an amount, in the largest ordinary sizes."""
FIRST_STEP = 4.0
"""Amount over which the first slope is taken, in the largest ordinary sizes."""

ARM_UNIT = 0.02
"""Unit of the amounts of an arm that changes, in arms per radian and per square radian.

A turned pulley runs true to a few hundredths of a millimetre, and an ordinary cable lies on it to a
tenth of a millimetre. On a radius of 20 to 40 mm this is less than one percent.
"""

STOP_UNIT = 0.05
"""Unit of the amount of an end stop, of the stiffness that the balance of torques gives."""


@dataclass(frozen=True, slots=True)
class Unlisted:
    """A cause that is no effect of the table.

    Attributes
    ----------
    name : str
        In words, for the answer.
    places : tuple of int
        Columns of the background that its amounts replace.
    change : callable
        (problem, channels, amounts) -> channels with these amounts.
    is_one_way : bool
        Whether the amounts cannot be negative.
    """

    name: str
    places: tuple[int, ...]
    change: Callable[[PredictionProblem, Channels, Array], Channels]
    is_one_way: bool


def _of_part(part: SensorPart, place: int) -> Unlisted:
    def change(problem: PredictionProblem, data: Channels, amounts: Array) -> Channels:
        return part.change(problem, data, float(amounts[0]))

    return Unlisted(part.name, (place,), change, part.is_one_way)


def _arm(problem: PredictionProblem, data: Channels, amounts: Array) -> Channels:
    more, slope, bend = (ARM_UNIT * amounts).tolist()
    return replace(data, arm=(1.0 + more, slope, bend))


def _of_stop(stop: EndStop, place: int) -> Unlisted:
    def change(problem: PredictionProblem, data: Channels, amounts: Array) -> Channels:
        size = STOP_UNIT * float(amounts[0])
        torque = size * stop.torque(data.measured[:, POSITION])
        return replace(data, external=torque if data.external is None else data.external + torque)

    return Unlisted(stop.name, (place,), change, is_one_way=True)


def unlisted_causes(problem: PredictionProblem, background: Background) -> list[Unlisted]:
    """The causes outside the table that are sought in the recordings of a problem."""
    parts = sensor_parts(problem)
    has_encoder = bool(problem.present[POSITION])
    first = len(background.effects) - len(parts) - 3 * has_encoder
    found = [_of_part(part, first + k) for k, part in enumerate(parts)]
    if has_encoder:
        place = first + len(parts)
        name = "an eccentricity of the encoder"
        found.append(Unlisted(name, (place, place + 1), encoder_part, is_one_way=False))
    return found


class UnlistedFitter:
    """Fits causes outside the table to the recordings of one problem.

    Parameters
    ----------
    fitter : HypothesisFitter
        Fitter of the effects of the table, with its background.
    folds : Folds
        Folds for the scores.
    """

    def __init__(self, fitter: HypothesisFitter, folds: Folds) -> None:
        self.fitter = fitter
        self.folds = folds
        self.rules = fitter.rules.search

    def scores(self, nominal: Hypothesis) -> list[HeldOut]:
        """Held-out scores of all causes outside the table that are larger than ordinary."""
        parts = self.fitter.parts
        if parts is None:
            return []
        columns, free = parts.terms.columns, parts.terms.free
        if self.fitter.background is None:  # a rig without a background has none beside the cause
            columns = np.zeros_like(columns)
        causes = unlisted_causes(self.fitter.problem, parts)
        effects = parts.effects
        # What follows is no part of an ordinary background, and has no column yet.
        first, more = columns.shape[-1], 0
        if self.fitter.problem.present[POSITION]:
            name = "a lever arm that changes with the angle (an eccentric pulley)"
            causes.append(Unlisted(name, (first, first + 1, first + 2), _arm, is_one_way=False))
            more += 3
        stop = end_stop(self.fitter.problem)
        if stop is not None:
            causes.append(_of_stop(stop, first + more))
            more += 1
        columns = np.concatenate([columns, np.zeros((*columns.shape[:-1], more))], axis=-1)
        free, effects = (*free, *[free[-1]] * more), (*effects, *[""] * more)
        background = Background(effects, LinearTerms(columns, free))
        found = []
        for one in causes:
            score = self._score(one, nominal, background)
            if score is not None:
                found.append(score)
        return found

    def _score(self, one: Unlisted, nominal: Hypothesis, background: Background) -> HeldOut | None:
        """Held-out score of one cause; None if its size is ordinary."""
        amounts = np.zeros(len(one.places))
        best = nominal
        own = self.fitter
        for _ in range(self.rules.unlisted_rounds):
            own = self._fitter_at(one, amounts, best, background)
            task = FitTask(
                (), best.result.values, self.rules.settled_steps, guess=nominal.result.jacobian
            )
            best = own.fit_all([task])[0]
            moved = best.result.amounts[list(one.places)]
            amounts = amounts + moved
            if np.abs(amounts).max() <= 1.0:
                return None
            if np.abs(moved).max() <= self.rules.unlisted_moved * np.abs(amounts).max():
                break
        score = score_all(own, self.folds, [best])[0]
        return replace(score, unlisted=one.name, free_numbers=len(one.places))

    def _fitter_at(
        self, one: Unlisted, amounts: Array, at: Hypothesis, background: Background
    ) -> HypothesisFitter:
        """A fitter for the recordings with these amounts, which fits further ones beside."""
        problem = self.fitter.problem

        def changed(more: Array) -> PredictionProblem:
            return problem.with_data(lambda data: one.change(problem, data, amounts + more))

        own = copy(self.fitter)
        own.problem = changed(np.zeros_like(amounts))
        vector = self.fitter.vector((), at.result.values)[None]
        base = own.problem.errors(vector)[0]
        columns, free = background.terms.columns.copy(), list(background.terms.free)
        for k, place in enumerate(one.places):
            step = np.zeros_like(amounts)
            step[k] = max(FIRST_STEP, 0.25 * abs(float(amounts[k])))
            columns[..., place] = (changed(step).errors(vector)[0] - base) / step[k]
            low = -float(amounts[k]) if one.is_one_way else -LARGEST
            free[place] = replace(free[place], low=low, high=LARGEST, prior=0.0)
        own.background = Background(background.effects, LinearTerms(columns, tuple(free)))
        return own
