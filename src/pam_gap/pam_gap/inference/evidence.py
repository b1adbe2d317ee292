"""Everything that the search of one joint finds, and all that its verdict depends on.

A diagnosis makes one `Evidence`, and `pam_gap.inference.decide` turns it into the verdict. It holds
the held-out scores of every finalist after the search and after the last fit, but no recording.
What `diagnose --keep-evidence` writes is the same object, so that a verdict can be decided again
with other rules in milliseconds.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pam_gap.inference.score import Score
from pam_gap.prediction.fit import Array
from pam_gap.prediction.locate import StageGap
from pam_gap.recordings.array_files import npz_arrays
from pam_model.errors import PamError
from pam_model.reading import reading

FORMAT = 7


@dataclass(frozen=True, slots=True)
class Evidence[S: Score]:
    """What the search of one joint found; in a running diagnosis, scores with their fits."""

    floor: Array  # shape (channels,): mean squared error due to noise alone
    background: Array  # shape (channels,): mean squared error that an ordinary background can leave
    present: np.ndarray  # shape (channels,): channels that are judged
    # shape (channels,): squared range of each channel in units of its whitened errors; with 0,
    # every gap above the noise matters
    motion: Array
    # written, nominal: scores of the plant in the rig file, as written and re-tuned without effects
    written: S
    nominal: S
    tried: tuple[S, ...]  # scores of the finalists after the search
    singles: tuple[str, ...]  # all effects, in the order of their levels as single effects
    stages: tuple[StageGap, ...]  # the gap of each stage
    unlisted: tuple[S, ...] = ()  # scores of causes outside the table of effects
    # score of a flexible law of the signals, which contains no physics; None where it was not made
    flexible: S | None = None
    # index in `tried` -> score after the last fit, for the hypotheses that had one
    settled: Mapping[int, S] = field(default_factory=dict)
    # score of the fit that the improved rig file holds; None without such a file
    improved: S | None = None
    improved_for: str = ""  # label of the hypothesis that was named and fitted for that file

    @property
    def finalists(self) -> tuple[S, ...]:
        """Scores of the finalists, each after the last fit that it had."""
        return tuple(self.settled.get(place, score) for place, score in enumerate(self.tried))

    def save(self, path: Path) -> None:
        """Write the evidence to one NPZ file (arrays and one JSON text, no pickled objects)."""
        places = sorted(self.settled)
        scores: list[Score] = [self.written, self.nominal, *self.tried]
        scores += [self.settled[k] for k in places]
        scores += self.unlisted
        scores += [one for one in (self.flexible, self.improved) if one is not None]
        about = {
            "format": FORMAT,
            "scores": [
                [
                    list(s.effects),
                    s.label,
                    s.free_numbers,
                    list(s.ordinary),
                    s.unlisted,
                    list(s.cut_off),
                ]
                for s in scores
            ],
            "tried": len(self.tried),
            "settled": places,
            "unlisted": len(self.unlisted),
            "flexible": int(self.flexible is not None),
            "improved_for": self.improved_for,
            "singles": list(self.singles),
            "stages": [[s.stage, s.inputs, s.gap_over_floor, s.note] for s in self.stages],
        }
        np.savez_compressed(
            path,
            about=np.array(json.dumps(about)),
            floor=self.floor,
            background=self.background,
            present=self.present,
            motion=self.motion,
            sums=np.array([s.sums for s in scores]),
            simulated_sums=np.array([s.simulated.sums for s in scores]),
            counts=np.array([s.counts for s in scores]),
        )


def load_evidence(path: Path) -> Evidence[Score]:
    """Read evidence that `Evidence.save` wrote.

    Raises
    ------
    PamError
        When the file cannot be read or is of another format.
    """
    with reading(path, "the evidence of a diagnosis"):
        return _of(path, dict(npz_arrays(path)))


def _of(path: Path, file: Mapping[str, Any]) -> Evidence[Score]:
    about = json.loads(str(file["about"]))
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
            cut_off=tuple(*cut_off),
        )
        for k, (effects, label, free, ordinary, unlisted, *cut_off) in enumerate(about["scores"])
    ]
    end = 2 + about["tried"]
    settled_end = end + len(about["settled"])
    last = settled_end + about["unlisted"]
    flexible_end = last + about["flexible"]
    return Evidence(
        floor=file["floor"],
        background=file["background"],
        present=file["present"],
        motion=file["motion"],
        written=scores[0],
        nominal=scores[1],
        tried=tuple(scores[2:end]),
        singles=tuple(about["singles"]),
        stages=tuple(StageGap(*entry) for entry in about["stages"]),
        unlisted=tuple(scores[settled_end:last]),
        flexible=next(iter(scores[last:flexible_end]), None),
        settled=dict(zip(about["settled"], scores[end:settled_end], strict=True)),
        improved=next(iter(scores[flexible_end:]), None),
        improved_for=about["improved_for"],
    )
