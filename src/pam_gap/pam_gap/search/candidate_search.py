"""The search for the effects that explain a recording: single effects first, then one more each.

Every candidate gets a few Gauss-Newton steps. The worst are dropped, and the fits of the best are
completed. Then a further effect is sought in addition to the best hypothesis. The strongest single
effect need not belong to the best pair. Therefore each effect that was chosen before is removed in
turn, and the others are tried in its place.
Forward selection with backward checks: Miller, Subset Selection in Regression (2002), chapter 3.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from pam_gap.inference.candidates import NESTED, Candidate, richer_starts
from pam_gap.inference.hypothesis import FitTask, Hypothesis, HypothesisFitter
from pam_gap.inference.score import level
from pam_gap.prediction.fit import Array, Slopes
from pam_gap.rules.search_rules import SearchRules

Progress = Callable[[str, float], None]
"""Called with the current task and the completed share of the whole work."""


def silent(task: str, share: float) -> None:
    """Progress function that reports nothing."""


@dataclass(slots=True)
class SearchResult:
    """All hypotheses that were tried."""

    nominal: Hypothesis  # the plant re-tuned without effects
    # entry k holds the hypotheses of k + 1 effects, best first
    by_size: list[list[Hypothesis]] = field(default_factory=list)
    singles: tuple[str, ...] = ()  # all effects, in the order of their levels as single effects
    causes: frozenset[str] = frozenset()  # effects that are causes although their size is ordinary

    def leading(self, rules: SearchRules) -> list[list[Hypothesis]]:
        """The best hypotheses of each size, which get a held-out score."""
        shares = (rules.finalists_one, rules.finalists_two, rules.finalists_three)
        return [found[: shares[min(size, 2)]] for size, found in enumerate(self.by_size)]


def _twin_starts(twin: Candidate, member: Candidate, values: Array) -> tuple[Array, ...]:
    """Starts of the simpler or richer law of a fitted effect; none for any other effect."""
    if (member.effect, twin.effect) in NESTED:
        return richer_starts(twin, member, values)
    if (twin.effect, member.effect) in NESTED:
        known = {p.name: v for p, v in zip(member.free, values, strict=True)}
        start = zip(twin.free, twin.starts[0], strict=True)
        return (np.array([known.get(p.name, v) for p, v in start]),)
    return ()


class CandidateSearch:
    """One search over candidates."""

    def __init__(
        self,
        fitter: HypothesisFitter,
        candidates: Sequence[Candidate],
        progress: Progress = silent,
    ) -> None:
        self.fitter = fitter
        self.rules = fitter.rules.search
        self.candidates = tuple(candidates)
        self.progress = progress
        self.present = fitter.problem.present
        self._last: dict[str, tuple[Array, ...]] = {}

    def level(self, hypothesis: Hypothesis) -> float:
        """Level of a hypothesis."""
        return level(hypothesis.mean_square, self.fitter.floor, self.present)

    def _leaders(self, found: list[Hypothesis], count: int, behind: float) -> list[Hypothesis]:
        """The best `count` hypotheses within `behind` of the best, one per set of effects."""
        best: dict[str, Hypothesis] = {}
        for h in found:
            if h.label not in best or self.level(h) < self.level(best[h.label]):
                best[h.label] = h
        ranked = sorted(best.values(), key=self.level)
        limit = self.level(ranked[0]) + behind if ranked else 0.0
        return [h for h in ranked[:count] if self.level(h) <= limit]

    def refine(
        self, found: Sequence[Hypothesis], iterations: int, *, reuse: Slopes | None = None
    ) -> list[Hypothesis]:
        """Continue the fits of hypotheses; a result is kept only if it has a lower level."""
        again = self.fitter.fit_all([FitTask.further(h, iterations, cached=reuse) for h in found])
        return [
            new if self.level(new) <= self.level(h) else h
            for h, new in zip(found, again, strict=True)
        ]

    def anew(self, found: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Fit again from the rig file's nominal numbers; a result is kept if its level is lower."""
        again = self.fitter.fit_all(
            [
                FitTask(
                    h.members,
                    self.fitter.from_the_rig_file(h.result.values),
                    self.rules.finish_steps,
                    guess=h.result.jacobian,
                )
                for h in found
            ]
        )
        return [
            new if self.level(new) < self.level(h) else h
            for h, new in zip(found, again, strict=True)
        ]

    def extend(
        self,
        base: Hypothesis,
        *,
        screened: int,
        finished: int,
        task: str,
        shares: tuple[float, float],
        warm: bool = False,
        among: Sequence[Candidate] | None = None,
    ) -> list[Hypothesis]:
        """Every hypothesis with one more effect than `base`; the fits of the best are completed.

        With `warm`, the fit of an effect starts from the values of its last trial. The effect is
        one of `among`, by default any.
        """
        reuse = base.result.jacobian
        values = base.result.values
        names = {m.label for m in base.members} | {m.effect for m in base.members}
        rivals = [c for c in among or self.candidates if c.effect not in names]
        low, high = shares
        self.progress(f"{task}: {len(rivals)} candidates", low)
        tasks = [
            FitTask(
                (*base.members, candidate),
                np.concatenate([values, start]),
                self.rules.screening_steps,
                cached=reuse,
            )
            for candidate in rivals
            for start in self._starts(candidate, warm)
        ]
        best: dict[str, Hypothesis] = {}
        for h in self.fitter.fit_all(tasks):
            label = h.members[-1].label
            if label not in best or self.level(h) < self.level(best[label]):
                best[label] = h
        found = list(best.values())
        for label, h in best.items():
            self._last[label] = (h.result.values[values.size :],)
        leaders = self._leaders(found, screened, 2 * self.rules.behind)
        self.progress(f"{task}: the best {len(leaders)}", low + (high - low) * 0.6)
        refined = self.refine(
            leaders, self.rules.refine_steps, reuse=reuse if reuse.shape[-1] else None
        )
        done = [*refined, *self._richer(refined)]
        leaders = self._leaders(done, finished, self.rules.behind)
        self.progress(f"{task}: the best {len(leaders)}", low + (high - low) * 0.8)
        ends = self.anew(self.refine(leaders, self.rules.finish_steps))
        best_of: dict[str, Hypothesis] = {}
        for h in (*found, *done, *ends):
            if h.label not in best_of or self.level(h) < self.level(best_of[h.label]):
                best_of[h.label] = h
        return sorted(best_of.values(), key=self.level)

    def _starts(self, candidate: Candidate, warm: bool) -> tuple[Array, ...]:
        """Starting points of a candidate: with `warm` the values of its last trial."""
        return self._last.get(candidate.label, candidate.starts) if warm else candidate.starts

    def _richer(self, found: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Richer laws of the newest effects, fitted from the results of the simpler laws."""
        tasks: list[FitTask] = []
        for h in found:
            newest, others = h.members[-1], h.members[:-1]
            at = len(h.result.values) - len(newest.free)
            for candidate in self.candidates:
                if (newest.effect, candidate.effect) in NESTED:
                    tasks += [
                        FitTask(
                            (*others, candidate),
                            np.concatenate([h.result.values[:at], start]),
                            self.rules.settled_steps,
                            cached=h.result.jacobian[..., :at],
                        )
                        for start in richer_starts(candidate, newest, h.result.values[at:])
                    ]
        return self.fitter.fit_all(tasks)

    def _twins(self, found: Sequence[Hypothesis]) -> list[Hypothesis]:
        """The best hypotheses with the simpler law in place of a richer one, and the other way."""
        tasks: list[FitTask] = []
        for h in found[: self.rules.twins_of]:
            at = len(self.fitter.nuisances)
            slopes = h.result.jacobian[..., :at]
            for k, member in enumerate(h.members):
                first, own, last = np.split(h.result.values, [at, at + len(member.free)])
                for twin in self.candidates:
                    tasks += [
                        FitTask(
                            (*h.members[:k], twin, *h.members[k + 1 :]),
                            np.concatenate([first, start, last]),
                            self.rules.settled_steps,
                            guess=slopes,
                        )
                        for start in _twin_starts(twin, member, own)
                    ]
                at += len(member.free)
        return self.fitter.fit_all(tasks)

    def singles(self) -> SearchResult:
        """The re-tuned nominal plant and every single effect."""
        self.progress("re-tuning nominal parameters", 0.0)
        nominal = self.fitter.fit_nominal()
        found = self.extend(
            nominal,
            screened=self.rules.first_screened,
            finished=self.rules.first_finished,
            task="one effect",
            shares=(0.05, 0.4),
        )
        return SearchResult(nominal, [found])

    def again(self, result: SearchResult) -> SearchResult:
        """Every single effect after the fitter has changed, beginning with the size found before.

        Parameters
        ----------
        result : SearchResult
            What `singles` found.
        """
        nominal = self.fitter.fit_nominal()
        at = nominal.result.values.size
        for h in result.by_size[0]:
            self._last[h.label] = (h.result.values[at:],)
        found = self.extend(
            nominal,
            screened=self.rules.first_screened,
            finished=self.rules.first_finished,
            task="one effect, no background",
            shares=(0.37, 0.4),
            warm=True,
        )
        return SearchResult(nominal, [found])

    def grow(self, result: SearchResult, shares: tuple[float, float]) -> None:
        """Add the hypotheses with one more effect, and try others for each effect of the best one.

        Parameters
        ----------
        result : SearchResult
            The result so far; its largest hypotheses are extended.
        shares : tuple of float
            Completed share before and after.
        """
        low, high = shares
        middle = 0.5 * (low + high)
        # An improvement by a longer fit of the base must not be credited to the added effect.
        base = self.refine(result.by_size[-1][:1], self.rules.settled_steps)[0]
        result.by_size[-1][0] = base
        size = len(base.members) + 1
        found = self.extend(
            base,
            screened=self.rules.further_screened,
            finished=self.rules.further_finished,
            task=f"{size} effects",
            shares=(low, middle),
            warm=size > 2,
        )
        best = found[0]
        if self.level(base) - self.level(best) > self.rules.challenge_gain:
            # The newest effect was chosen given the others, but the others were chosen without it.
            for member in range(size - 1):
                found += self.extend(
                    best.without(member),
                    screened=self.rules.challenge_screened,
                    finished=self.rules.challenge_finished,
                    task=f"in place of {best.members[member].effect}",
                    shares=(middle, high),
                    warm=True,
                )
        found += self._twins(sorted(found, key=self.level))
        result.by_size.append(self._distinct(found))
        self._check_backwards(result)

    def pair_up(self, result: SearchResult, share: float) -> None:
        """Add every pair of the leading single effects.

        Of two large causes, the best explanation of one effect need not hold either.

        Parameters
        ----------
        result : SearchResult
            The result so far, with pairs.
        share : float
            Completed share.
        """
        leaders = result.by_size[0][: self.rules.finalists_one]
        found = [*result.by_size[1]]
        for place, base in enumerate(leaders[:-1], start=1):
            found += self.extend(
                base,
                screened=self.rules.challenge_screened,
                finished=self.rules.challenge_finished,
                task="pairs of the leading effects",
                shares=(share, share),
                among=[member for h in leaders[place:] for member in h.members],
            )
        result.by_size[1] = self._distinct(found)
        self._check_backwards(result)

    def _distinct(self, found: Sequence[Hypothesis]) -> list[Hypothesis]:
        """The best hypothesis of each set of candidates, best first."""
        distinct: dict[frozenset[str], Hypothesis] = {}
        for h in sorted(found, key=self.level):
            distinct.setdefault(frozenset(m.label for m in h.members), h)
        return list(distinct.values())

    def _check_backwards(self, result: SearchResult) -> None:
        """Fit the best hypothesis without each of its effects, which may be unnecessary now."""
        best, smaller = result.by_size[-1][0], result.by_size[-2]
        starts = [best.without(member) for member in range(len(best.members))]
        tasks = [FitTask.further(h, self.rules.settled_steps) for h in starts]
        for rest in self.fitter.fit_all(tasks):
            known = next((h for h in smaller if h.label == rest.label), None)
            if known is None or self.level(rest) < self.level(known):
                result.by_size[-2] = smaller = [
                    rest, *(h for h in smaller if h.label != rest.label)
                ]  # fmt: skip
        result.by_size[-2] = sorted(smaller, key=self.level)
