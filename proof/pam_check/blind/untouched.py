"""The share of the gap that the improved rig closes on a recording unknown to the diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pam_gap.diagnosis_files import IMPROVED_RIG
from pam_gap.inference.confidence import pooled_rms
from pam_gap.prediction.gap_figures import noise_level
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.import_recording import import_recording
from pam_model.plant.parameters import PlantParameters
from pam_model.rig import load_rig


def untouched_closed(written: Path, improved: Path, recording: Path, joint: int = 0) -> float:
    """(before - after)/(before - floor) of the pooled RMS prediction error.

    Parameters
    ----------
    written, improved : Path
        Rig files before and after the diagnosis.
    recording : Path
        Recording of the same rig with another motion.
    joint : int
        Index of the joint.

    Raises
    ------
    PamError
        When a file cannot be used.
    """
    problem = PredictionProblem(load_rig(written), joint, [import_recording(recording)])
    before = problem.base.values
    after = PlantParameters.from_rig(load_rig(improved), joint).values
    errors = problem.errors(np.array([before, after]))[:, problem.counted]
    known = np.isfinite(errors)
    sums = np.where(known, errors**2, 0.0).sum(axis=1)
    rms = pooled_rms(sums, known.sum(axis=1).astype(np.float64), problem.present)
    floor = float(np.sqrt(noise_level(problem, before)[problem.present].mean()))
    first, last = float(rms[0]), float(rms[1])
    return (first - max(last, floor)) / max(first - floor, 1e-9)


def with_untouched(
    answer: Mapping[str, Any], folder: Path, case: str, answered: Path
) -> dict[str, Any]:
    """An answer with the share that its improved rig closes on the sealed second recording.

    An answer that closes no gap is returned unchanged.

    Parameters
    ----------
    answer : mapping
        diagnosis.json of the case.
    folder : Path
        Folder of the campaign.
    case : str
        Name of the case.
    answered : Path
        Folder into which the diagnosis wrote its files.
    """
    improved = answered / IMPROVED_RIG
    if not answer.get("closed") or not improved.exists():
        return dict(answer)
    share = untouched_closed(
        folder / "cases" / case / "rig.yaml",
        improved,
        folder / "sealed" / case / "recording.csv.gz",
    )
    return dict(answer) | {"closed": dict(answer["closed"]) | {"untouched": share}}
