"""Causes outside the table of effects: parts of a background far beyond their ordinary size.

An ordinary background has parts that no effect of the table describes: spools with hysteresis,
pressure sensors that are not linear or drift, and eccentric encoders. They can be as large on a bad
rig as any effect of the table. Some known effect then often imitates them: an eccentric encoder
looks almost like an offset, and a spool with hysteresis like a dead zone and a delay. Each part is
therefore fitted once without its ordinary bounds, as an explanation that competes with the effects
of the table, and so is an end stop that the balance of torques shows
(`pam_gap.prediction.end_stop`). What fits best need not be in the table (fault isolation with a
class for unknown faults: Isermann, Fault-Diagnosis Systems, Springer 2006, chapter 16).

Most amounts change the recordings instead of the plant; those of an eccentric pulley change its
lever arm, and with it the volumes of the muscles. They are found by Gauss-Newton steps, whose
columns are the slopes of the errors over the amounts (`pam_gap.prediction.linear_terms`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from pam_gap.inference.background import Background, SensorPart, encoder_part, sensor_parts
from pam_gap.inference.held_out import Folds, HeldOut, score_all
from pam_gap.inference.hypothesis import FitTask, Hypothesis, HypothesisFitter
from pam_gap.inference.score import level
from pam_gap.prediction.channel_order import POSITION
from pam_gap.prediction.channels import Channels
from pam_gap.prediction.end_stop import EndStop, end_stop
from pam_gap.prediction.fit import Array
from pam_gap.prediction.linear_terms import LinearTerms
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.rules import Rules
from pam_model.plant.uneven_pulley import UnevenPulley

LARGEST = 1000.0
"""Bound of an amount, in the largest ordinary sizes."""
FIRST_STEP = 4.0
"""Amount over which the first slope is taken, in the largest ordinary sizes."""

STOP_UNIT = 0.05
"""Unit of the amount of an end stop, of the stiffness that the balance of torques gives."""


@dataclass(frozen=True, slots=True)
class Unlisted:
    """A cause that is no effect of the table."""

    name: str  # in words, for the answer
    places: tuple[int, ...]  # columns of the background that its amounts replace
    # (problem, channels, amounts) -> channels with these amounts
    change: Callable[[PredictionProblem, Channels, Array], Channels]
    is_one_way: bool  # whether the amounts cannot be negative
    largest: float = LARGEST  # bound of the amounts
    # effect of the table that the cause is when only its first amount is not zero; its fit begins
    # with what was found of this effect
    contains: str = ""
    first: Callable[[float], float] = float  # first amount for a size of that effect


def _of_part(part: SensorPart, place: int) -> Unlisted:
    def change(problem: PredictionProblem, data: Channels, amounts: Array) -> Channels:
        return part.change(problem, data, float(amounts[0]))

    return Unlisted(part.name, (place,), change, part.is_one_way)


def _arm(problem: PredictionProblem, data: Channels, amounts: Array) -> Channels:
    size = problem.rules.decision.ordinary_arm
    more, slope, bend, zero = (size * amounts).tolist()
    return replace(data, arm=UnevenPulley(1.0 + more, slope, bend, zero))


def _eccentric_pulley(place: int, rules: Rules) -> Unlisted:
    size = rules.decision.ordinary_arm
    return Unlisted(
        "a lever arm that changes with the angle (an eccentric pulley)",
        tuple(range(place, place + 4)),
        _arm,
        is_one_way=False,
        largest=rules.search.largest_arm / size,
        contains="pulley_radius",
        first=lambda scale: (scale - 1.0) / size,
    )


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
        self._amounts: dict[str, Array] = {}

    def scores(
        self,
        nominal: Hypothesis,
        singles: Sequence[Hypothesis] = (),
        beside: Hypothesis | None = None,
    ) -> list[HeldOut]:
        """Held-out scores of all causes outside the table that are larger than ordinary.

        Parameters
        ----------
        nominal : Hypothesis
            The re-tuned plant without effects.
        singles : sequence of Hypothesis
            Fits of single effects of the table, of which some are special cases of these causes.
        beside : Hypothesis, optional
            Effects that every good rig has. They are fitted together with the best of these causes,
            if it explains at least half of what the best single effect does.
        """
        parts = self.fitter.parts
        if parts is None:
            return []
        causes, background = self._causes(parts)
        known = [self._level(single) for single in singles]
        most = min(known, default=np.inf) + 2.0 * self.rules.behind
        found = []
        for one in causes:
            score = self._score(one, self._start(one, nominal, singles), background, most)
            if score is not None:
                found.append((score, one))
        if found and singles and beside is not None and beside.members:
            left = [self._level(score.hypothesis) for score, _ in found]
            k = int(np.argmin(left))
            score, one = found[k]
            if left[k] < 0.5 * (self._level(nominal) + self._level(singles[0])):
                again = self._score(one, (self._amounts[one.name], beside), background)
                if again is not None and self._level(again.hypothesis) < left[k]:
                    found[k] = (again, one)
        return [score for score, _ in found]

    def _level(self, hypothesis: Hypothesis) -> float:
        return level(hypothesis.mean_square, self.fitter.floor, self.fitter.problem.present)

    def _causes(self, parts: Background) -> tuple[list[Unlisted], Background]:
        """All causes that are sought, and a background with places for their columns."""
        columns, free = parts.terms.columns, parts.terms.free
        if self.fitter.background is None:  # the cause gets none, either
            columns = np.zeros_like(columns)
        causes = unlisted_causes(self.fitter.problem, parts)
        effects = parts.effects
        # What follows is no part of an ordinary background, and has no column yet.
        first, more = columns.shape[-1], 0
        if self.fitter.problem.present[POSITION]:
            causes.append(_eccentric_pulley(first, self.fitter.rules))
            more += 4
        stop = end_stop(self.fitter.problem)
        if stop is not None:
            causes.append(_of_stop(stop, first + more))
            more += 1
        columns = np.concatenate([columns, np.zeros((*columns.shape[:-1], more))], axis=-1)
        free, effects = (*free, *[free[-1]] * more), (*effects, *[""] * more)
        return causes, Background(effects, LinearTerms(columns, free))

    def _score(
        self,
        one: Unlisted,
        start: tuple[Array, Hypothesis],
        background: Background,
        most: float = np.inf,
    ) -> HeldOut | None:
        """Held-out score of one cause; None if its size is ordinary or its level above `most`.

        `start` holds the amounts and the hypothesis with which the fit begins; the effects of the
        latter are fitted together with the cause.
        """
        amounts, at = start
        guess = at.result.jacobian
        best: tuple[float, HypothesisFitter, Hypothesis] | None = None
        for _ in range(self.rules.unlisted_rounds):
            own = self._fitter_at(one, amounts, at, background)
            values, steps = at.result.values, self.rules.settled_steps
            at = own.fit_all([FitTask(at.members, values, steps, guess=guess)])[0]
            moved = at.result.amounts[list(one.places)]
            amounts = amounts + moved
            if np.abs(amounts).max() <= 1.0:
                return None
            left = self._level(at)
            if left > most:  # further rounds change its columns, and do not bring it so far
                return None
            if best is None or left < best[0]:
                best = (left, own, at)
                self._amounts[one.name] = amounts
            if np.abs(moved).max() <= self.rules.unlisted_moved * np.abs(amounts).max():
                break
        assert best is not None
        score = score_all(best[1], self.folds, [best[2]])[0]
        numbers = score.free_numbers + len(one.places)
        return replace(score, unlisted=one.name, free_numbers=numbers)

    def _start(
        self, one: Unlisted, nominal: Hypothesis, singles: Sequence[Hypothesis]
    ) -> tuple[Array, Hypothesis]:
        """Amounts with which the fit of a cause begins, and the rig's numbers."""
        amounts = np.zeros(len(one.places))
        like = next((h for h in singles if h.effects == (one.contains,)), None)
        if like is None:
            return amounts, nominal
        amounts[0] = one.first(float(like.result.values[-1]))
        return amounts, like.without(0)

    def _fitter_at(
        self, one: Unlisted, amounts: Array, at: Hypothesis, background: Background
    ) -> HypothesisFitter:
        """A fitter for the recordings with these amounts, which fits further ones as well."""
        problem = self.fitter.problem

        def changed(more: Array) -> PredictionProblem:
            return problem.with_data(lambda data: one.change(problem, data, amounts + more))

        own = copy(self.fitter)
        own.problem = changed(np.zeros_like(amounts))
        vector = self.fitter.vector(at.members, at.result.values)[None]
        base = own.problem.errors(vector)[0]
        columns, free = background.terms.columns.copy(), list(background.terms.free)
        for k, place in enumerate(one.places):
            step = np.zeros_like(amounts)
            step[k] = max(FIRST_STEP, 0.25 * abs(float(amounts[k])))
            columns[..., place] = (changed(step).errors(vector)[0] - base) / step[k]
            so_far = float(amounts[k])
            low = -so_far if one.is_one_way else -one.largest - so_far
            free[place] = replace(free[place], low=low, high=one.largest - so_far, prior=0.0)
        own.background = Background(background.effects, LinearTerms(columns, tuple(free)))
        return own
