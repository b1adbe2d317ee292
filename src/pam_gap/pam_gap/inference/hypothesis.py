"""A hypothesis: the nominal plant re-tuned within tolerance, with effects added, and its fit."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from pam_gap.inference.background import Background, discrepancy, ordinary_background
from pam_gap.inference.candidates import (
    Candidate,
    Nuisance,
    nuisances_for,
    transport_time,
)
from pam_gap.prediction.channel_order import N_CHANNELS
from pam_gap.prediction.fit import (
    Array,
    FitSteps,
    FreeParameter,
    PlantFit,
    Scaling,
    Slopes,
    fit_steps,
    fit_together,
    mean_squares,
)
from pam_gap.prediction.linear_terms import fit_steps_with_terms
from pam_gap.prediction.problem import PredictionProblem
from pam_model.effects import EFFECTS
from pam_model.plant.parameters import INDEX

Rows = npt.NDArray[np.bool_]
SIDE_BY_SIDE = 50_000_000
"""Bytes that the Jacobians of fits that run side by side may take."""
AT_THE_END = 0.005
"""Distance from the end of the range of a size, in ranges, within which it is at the end."""
FEWEST_SIDE_BY_SIDE = 6
"""Number of fits that always run side by side, because single lanes are simulated slowly."""


@dataclass(slots=True)
class Hypothesis:
    """Effects that are fitted together, and the result of the fit."""

    members: tuple[Candidate, ...]  # the effects; empty for the re-tuned nominal plant
    result: PlantFit  # nuisance parameters first, then the parameters of each effect in order
    mean_square: Array  # shape (channels,): J_c over all counted rows

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(member.effect for member in self.members)

    @property
    def ordinary(self) -> tuple[str, ...]:
        """Those of the effects that are no larger than on an ordinary good rig."""
        at = len(self.result.values) - sum(len(member.free) for member in self.members)
        found = []
        for member in self.members:
            values = self.result.values[at : at + len(member.free)]
            at += len(member.free)
            if member.is_ordinary(values):
                found.append(member.effect)
        return tuple(found)

    @property
    def at_the_end(self) -> tuple[tuple[str, str, float, str], ...]:
        """Effect, parameter, value and unit of each size at the far end of its range.

        A size at the end that stands for no effect is not among them.
        """
        at = len(self.result.values) - sum(len(member.free) for member in self.members)
        found = []
        for member in self.members:
            for free, (neutral, _) in zip(member.free, member.ordinary, strict=True):
                value = float(self.result.values[at])
                at += 1
                parameter = EFFECTS[member.effect].parameters[free.name.split(".")[0]]
                near = AT_THE_END * (free.high - free.low)
                end = free.high if value > neutral else free.low
                if not parameter.is_shape and end != neutral and abs(value - end) <= near:
                    found.append((member.effect, free.name, value, parameter.unit))
        return tuple(found)

    def without(self, member: int) -> Hypothesis:
        """The hypothesis with one effect removed and all other values kept, without a new fit."""
        sizes = [len(one.free) for one in self.members]
        start = len(self.result.values) - sum(sizes[member:])
        cut = np.arange(start, start + sizes[member])
        result = replace(
            self.result,
            values=np.delete(self.result.values, cut),
            columns=np.delete(self.result.jacobian, cut, axis=-1),
            reused=None,
            simulated=None,
        )
        members = self.members[:member] + self.members[member + 1 :]
        return Hypothesis(members, result, self.mean_square)

    def only(self, effects: Collection[str]) -> Hypothesis:
        """The hypothesis with no other effects than these, without a new fit."""
        for k, effect in enumerate(self.effects):
            if effect not in effects:
                return self.without(k).only(effects)
        return self

    @property
    def simulated(self) -> Array:
        """Errors without the linear amounts of a background, shape (blocks, channels)."""
        known = self.result.simulated
        return self.result.errors if known is None else known

    @property
    def label(self) -> str:
        """Names of the effects with their sides."""
        return " + ".join(member.label for member in self.members) or "re-tuned nominal"


@dataclass(frozen=True, slots=True)
class FitTask:
    """One fit of one hypothesis from one start."""

    members: tuple[Candidate, ...]  # the effects
    start: Array  # nuisance parameters first, then those of the effects
    max_iterations: int  # largest number of steps
    rows: Rows | None = None  # rows that are fitted; by default all counted ones
    cached: Slopes | None = None  # Jacobian of the first parameters, which is reused
    guess: Slopes | None = None  # Jacobian of the parameters after these at a point near the start
    tolerance: float | None = None  # as for `fit_steps`
    # amounts of the ordinary background that are kept; by default they are fitted
    amounts: Array | None = None
    is_bare: bool = False  # whether the fit is without an ordinary background
    # whether the numbers of the effects stay near the start where the rows say little of them
    stays: bool = False
    errors: Array | None = None  # errors of the simulation alone at the start, where they are known

    @classmethod
    def further(
        cls,
        h: Hypothesis,
        max_iterations: int,
        *,
        rows: Rows | None = None,
        cached: Slopes | None = None,
        amounts: Array | None = None,
        is_bare: bool = False,
        stays: bool = False,
    ) -> FitTask:
        """The fit of a hypothesis, continued from its result; nothing is simulated again."""
        first = 0 if cached is None else cached.shape[-1]
        return cls(
            h.members, h.result.values, max_iterations, rows, cached,
            h.result.jacobian[..., first:], amounts=amounts, is_bare=is_bare,
            stays=stays, errors=h.result.simulated,
        )  # fmt: skip


class HypothesisFitter:
    """Fits the hypotheses of one problem, which share nuisance parameters and data.

    Parameters
    ----------
    problem : PredictionProblem
        The rig and its recordings.
    floor : ndarray, shape (channels,)
        Mean squared error due to noise alone.
    nuisances : sequence of Nuisance, optional
        Numbers of the rig that every hypothesis may change; by default those of the rig file, each
        within its tolerance.
    """

    def __init__(
        self,
        problem: PredictionProblem,
        floor: Array,
        nuisances: Sequence[Nuisance] | None = None,
    ) -> None:
        self.problem = problem
        self.floor = floor
        self.rules = problem.rules
        self.nuisances = (
            nuisances_for(
                problem.rig, problem.rig.joints[problem.joint], self.rules.search, problem.sides
            )
            if nuisances is None
            else tuple(nuisances)
        )
        stamped = [d.recording.sample_time for d in problem.data if not d.recording.one_clock]
        written = {problem.base[f"{side}.command_delay.delay"] for side in problem.sides}
        # Different delays in the rig file must be measured ones, which include the transport time.
        if stamped and problem.has_commands and len(written) == 1:
            self.nuisances += (
                transport_time(max(stamped), written.pop(), self.rules.search, problem.sides),
            )
        self.nominal: Hypothesis | None = None
        self.bare: Hypothesis | None = None
        self.background: Background | None = None
        self.parts: Background | None = None
        self.whole_background: Array = np.zeros_like(floor)
        self.discrepancy: Array = np.zeros_like(floor)

    def problem_parts(
        self, members: Sequence[Candidate]
    ) -> tuple[list[FreeParameter], list[tuple[str, ...]], list[bool]]:
        """Free parameters of a hypothesis, their targets, and whether each is a factor."""
        free = [nuisance.free for nuisance in self.nuisances]
        targets = [nuisance.targets for nuisance in self.nuisances]
        factor = [nuisance.is_factor for nuisance in self.nuisances]
        for member in members:
            free += member.free
            targets += member.targets
            factor += [False] * len(member.free)
        return free, targets, factor

    def from_the_rig_file(self, values: Array) -> Array:
        """A start with the nominal numbers of the rig file, and with these values of the effects.

        A search starts from the nominal plant re-tuned without effects. Its numbers may be at the
        ends of their tolerance, where they imitate the effect, and a fit from there can be trapped.
        """
        centres = [nuisance.free.centre for nuisance in self.nuisances]
        return np.concatenate([centres, values[len(centres) :]])

    def vector(self, members: Sequence[Candidate], values: Array) -> Array:
        """The plant's full parameter vector of a fitted hypothesis."""
        _, targets, factor = self.problem_parts(members)
        places = [np.array([INDEX[name] for name in group]) for group in targets]
        full: Array = self.problem.vectors(self.problem.base.values, places, factor, values[None])[
            0
        ]
        return full

    def fit(
        self,
        members: Sequence[Candidate],
        start: Array,
        *,
        rows: Rows | None = None,
        cached: Slopes | None = None,
        guess: Slopes | None = None,
        max_iterations: int,
        tolerance: float | None = None,
    ) -> Hypothesis:
        """Fit one hypothesis from one start; nuisance parameters come first in `start`."""
        task = FitTask(tuple(members), start, max_iterations, rows, cached, guess, tolerance)
        return self.fit_all([task])[0]

    def fit_all(self, tasks: Sequence[FitTask]) -> list[Hypothesis]:
        """Fit several hypotheses; their simulations run side by side as lanes of one batch.

        No more run at a time than fit into `SIDE_BY_SIDE` bytes; the results do not depend on it.
        """
        problem = self.problem
        own = max((len(self.problem_parts(task.members)[0]) for task in tasks), default=0)
        shared = tasks[0].cached if tasks else None
        if shared is not None and all(task.cached is shared for task in tasks):
            own -= shared.shape[-1]
        size = 8 * problem.n_rows * N_CHANNELS * max(own, 1)  # bytes of one Jacobian
        count = max(SIDE_BY_SIDE // size, FEWEST_SIDE_BY_SIDE)
        hypotheses = []
        for first in range(0, len(tasks), count):
            some = tasks[first : first + count]
            fits = [self._fit_steps(task) for task in some]
            results = fit_together([one for one in fits if one is not None], problem.errors)
            found = iter(results)
            for task, one in zip(some, fits, strict=True):
                result = self._without_fit() if one is None else next(found)
                mean = mean_squares(result.errors, problem.counted)
                hypotheses.append(Hypothesis(task.members, result, mean))
        return hypotheses

    def _without_fit(self) -> PlantFit:
        """The rig as written, for a hypothesis without free parameters."""
        errors = self.problem.errors(self.problem.base.values[None])[0]
        return PlantFit(np.zeros(0), errors, 0.0, np.zeros((*errors.shape, 0)), 0)

    def _fit_steps(self, task: FitTask) -> tuple[Callable[[Array], Array], FitSteps] | None:
        """The fit of a hypothesis and its lanes' full vectors; None without free parameters."""
        free, targets, factor = self.problem_parts(task.members)
        background = None if task.is_bare else self.background
        if not free and background is None:
            return None
        rows = self.problem.counted if task.rows is None else task.rows
        if task.stays:
            free = self._near(free, task.start, int(rows.sum()))
        places = [np.array([INDEX[name] for name in group]) for group in targets]
        fit = fit_steps
        if background is not None:
            terms = background.beside([member.effect for member in task.members])
            fit = partial(fit_steps_with_terms, terms=terms, amounts=task.amounts)
        steps = fit(
            free,
            task.start,
            rows=rows,
            floor=self.floor,
            cached=task.cached,
            guess=task.guess,
            max_iterations=task.max_iterations,
            tolerance=task.tolerance,
            errors=task.errors,
            rules=self.rules.prediction,
        )
        return partial(self.problem.vectors, self.problem.base.values, places, factor), steps

    def _near(self, free: list[FreeParameter], start: Array, rows: int) -> list[FreeParameter]:
        """The numbers of the effects with a prior of their typical size around the start.

        The rows of a channel are worth a few independent errors, and the prior is one of these.
        """
        own = len(self.nuisances)
        worth = (self.rules.statement.independent_errors / max(rows, 1)) ** 0.5
        return free[:own] + [
            replace(one, prior=worth * one.size, centre=float(value))
            for one, value in zip(free[own:], start[own:], strict=True)
        ]

    def fit_nominal(self) -> Hypothesis:
        """Fit the re-tuned plant without effects; every other fit starts from the result.

        The first fit is without a background, which is then simulated with its result.
        """
        if self.nominal is None:
            steps = self.rules.search.nominal_steps
            start = np.array([nuisance.free.centre for nuisance in self.nuisances])
            bare = self.fit((), start, max_iterations=steps)
            values, jacobian = bare.result.values, bare.result.jacobian
            self.parts = ordinary_background(self.problem, self.vector((), values))
            self.background = self.parts
            free, _, _ = self.problem_parts(())
            weights = 1.0 / np.maximum(bare.mean_square, self.floor)
            self.bare = bare
            self.whole_background, self.discrepancy = discrepancy(
                self.problem, self.parts, jacobian, Scaling(free), weights
            )
            self.nominal = self.fit((), values, cached=jacobian, max_iterations=steps)
        return self.nominal

    def drop_background(self) -> None:
        """Fit every hypothesis without an ordinary background from now on; `parts` remains."""
        self.background, self.nominal = None, self.bare
        self.discrepancy = self.whole_background
