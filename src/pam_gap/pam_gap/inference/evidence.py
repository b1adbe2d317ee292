"""The evidence that a diagnosis keeps, from which its verdict can be decided with other rules.

The evidence holds the held-out scores of every finalist after the search and after the last fit,
but no recording. With changed constants that act after the search, the decision can be repeated in
milliseconds. If the repeated decision would need a fit that was never made, it is marked as not
exact.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pam_gap.inference.confidence import Interval, for_another_motion, gap_closed
from pam_gap.inference.decision import Decision, Judge
from pam_gap.inference.named_effects import named_effects
from pam_gap.inference.probabilities import agreed
from pam_gap.inference.score import Score
from pam_gap.inference.search_growth import GrowthStep, grows
from pam_gap.prediction.fit import Array
from pam_gap.prediction.locate import StageGap, worst_stage
from pam_gap.recordings.array_files import npz_arrays
from pam_gap.rules import Rules
from pam_model.effects import EFFECTS
from pam_model.errors import PamError
from pam_model.reading import reading

FORMAT = 6


@dataclass(frozen=True, slots=True)
class KeptEvidence:
    """The evidence of one joint's diagnosis.

    Attributes
    ----------
    floor : ndarray, shape (channels,)
        Mean squared error due to noise alone.
    background : ndarray, shape (channels,)
        Mean squared error that an ordinary background can leave.
    present : ndarray of bool, shape (channels,)
        Channels that are judged.
    written, nominal : Score
        Scores of the plant in the rig file, as written and re-tuned without effects.
    tried : tuple of Score
        Scores of the finalists after the search.
    settled : mapping
        Index in `tried` -> score after the last fit, for the hypotheses that had one.
    singles : tuple of str
        All effects, in the order of their levels as single effects.
    stages : tuple of StageGap
        The gap of each stage.
    growth : tuple of (GrowthStep, bool)
        State at each decision to seek one more effect, and whether it was sought.
    motion : ndarray, shape (channels,), optional
        Squared range of each channel in units of its whitened errors; without it, every gap above
        the noise matters.
    improved : Score, optional
        Score of the fit that the improved rig file holds; None without such a file.
    improved_for : str
        Label of the hypothesis that was named and fitted for that file.
    unlisted : tuple of Score
        Scores of causes outside the table of effects.
    """

    floor: Array
    background: Array
    present: np.ndarray
    written: Score
    nominal: Score
    tried: tuple[Score, ...]
    settled: Mapping[int, Score]
    singles: tuple[str, ...]
    stages: tuple[StageGap, ...]
    growth: tuple[tuple[GrowthStep, bool], ...]
    motion: Array | None = None
    improved: Score | None = None
    improved_for: str = ""
    unlisted: tuple[Score, ...] = ()

    def save(self, path: Path) -> None:
        """Write the evidence to one NPZ file (arrays and one JSON text, no pickled objects)."""
        places = sorted(self.settled)
        scores = [self.written, self.nominal, *self.tried, *(self.settled[k] for k in places)]
        scores += self.unlisted
        if self.improved is not None:
            scores.append(self.improved)
        about = {
            "format": FORMAT,
            "scores": [
                [list(s.effects), s.label, s.free_numbers, list(s.ordinary), s.unlisted]
                for s in scores
            ],
            "tried": len(self.tried),
            "settled": places,
            "unlisted": len(self.unlisted),
            "improved_for": self.improved_for,
            "singles": list(self.singles),
            "stages": [[s.stage, s.inputs, s.gap_over_floor, s.note] for s in self.stages],
            "growth": [[*step.to_list(), went_on] for step, went_on in self.growth],
        }
        np.savez_compressed(
            path,
            about=np.array(json.dumps(about)),
            floor=self.floor,
            background=self.background,
            present=self.present,
            motion=np.zeros_like(self.floor) if self.motion is None else self.motion,
            sums=np.array([s.sums for s in scores]),
            simulated_sums=np.array([s.simulated.sums for s in scores]),
            counts=np.array([s.counts for s in scores]),
        )

    @classmethod
    def load(cls, path: Path) -> KeptEvidence:
        """Read evidence that `save` wrote.

        Raises
        ------
        PamError
            When the file cannot be read or is of another format.
        """
        with reading(path, "the evidence of a diagnosis"):
            return cls._of(path, dict(npz_arrays(path)))

    @classmethod
    def _of(cls, path: Path, file: Mapping[str, Any]) -> KeptEvidence:
        about = json.loads(str(file["about"]))
        floor, present = file["floor"], file["present"]
        motion, background = file.get("motion"), file["background"]
        sums, counts = file["sums"], file["counts"]
        simulated = file["simulated_sums"]
        if about.get("format") != FORMAT:
            raise PamError(
                f"{path}: evidence of format {about.get('format')}; expected {FORMAT}: run the "
                "diagnosis again with --keep-evidence"
            )
        scores = [
            Score(
                tuple(effects),
                label,
                free,
                sums[k],
                counts[k],
                ordinary=tuple(ordinary),
                simulated_sums=simulated[k],
                unlisted=unlisted,
            )
            for k, (effects, label, free, ordinary, unlisted) in enumerate(about["scores"])
        ]
        end = 2 + about["tried"]
        settled_end = end + len(about["settled"])
        last = settled_end + about["unlisted"]
        return cls(
            floor,
            background,
            present,
            scores[0],
            scores[1],
            tuple(scores[2:end]),
            dict(zip(about["settled"], scores[end:settled_end], strict=True)),
            tuple(about["singles"]),
            tuple(StageGap(*entry) for entry in about["stages"]),
            tuple((GrowthStep(*entry[:-1]), bool(entry[-1])) for entry in about["growth"]),
            motion,
            next(iter(scores[last:]), None),
            about["improved_for"],
            tuple(scores[settled_end:last]),
        )


@dataclass(frozen=True, slots=True)
class DecidedAgain:
    """A decision repeated from kept evidence.

    Attributes
    ----------
    answer : mapping
        The part of diagnosis.json that the decision determines.
    is_exact : bool
        Whether a diagnosis with these rules would have used the same scores: the search would have
        stopped at the same size, and the fit of every close hypothesis was completed.
    """

    answer: Mapping[str, Any]
    is_exact: bool


def contract_answer(
    evidence: KeptEvidence, decision: Decision[Score], judge: Judge, rules: Rules
) -> dict[str, Any]:
    """The part of diagnosis.json that a decision determines."""
    effects, groups = named_effects(decision, evidence.singles)
    stage: str | None = EFFECTS[effects[0]].stage if effects else None
    if decision.verdict == "unknown":
        stage = worst_stage(evidence.stages, rules.prediction.stage_from)
    closed: Interval | None = None
    shown = decision.chosen if decision.is_named else None
    if shown is not None and shown.label == evidence.improved_for:
        shown = evidence.improved
    if shown is not None:
        written, floor, present = evidence.written, evidence.floor, evidence.present
        closed = for_another_motion(
            gap_closed(written, shown, floor, present, rules.decision),
            written,
            floor,
            present,
            rules.decision,
            has_background=judge.has_background,
        )
    return {
        "verdict": decision.verdict,
        "stage": stage,
        "effects": list(effects),
        "candidates": [list(pair) for pair in judge.weights(decision, evidence.singles)],
        "indistinguishable": [list(group) for group in groups],
        "closed": None
        if closed is None
        else {"value": closed.value, "low": closed.low, "high": closed.high},
    }


def decide_again(evidence: KeptEvidence, rules: Rules) -> DecidedAgain:
    """Repeat the decision of a diagnosis, with these rules."""
    is_exact = all(
        grows(step, rules.search, rules.decision) == went_on for step, went_on in evidence.growth
    )
    missing: list[Score] = []

    def settle(score: Score) -> Score:
        place = _place(score, evidence.tried)
        if place not in evidence.settled:
            missing.append(score)
            return score
        return evidence.settled[place]

    judge = Judge(
        evidence.floor, evidence.present, rules.decision, evidence.motion, evidence.background
    )
    decision = judge.decide(evidence.nominal, evidence.tried, settle, evidence.unlisted)
    decision = agreed(judge, evidence.nominal, decision)
    answer = contract_answer(evidence, decision, judge, rules)
    return DecidedAgain(answer, is_exact and not missing)


def _place(score: Score, scores: Sequence[Score]) -> int:
    """Index of this score object among the scores."""
    return next(k for k, one in enumerate(scores) if one is score)
