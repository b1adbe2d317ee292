"""The effects of a joint, fitted again on every recording as one fixed hypothesis.

A verdict says what stands out of one recording. To see a value change over weeks, the same effects
must be fitted everywhere, also where the verdict was another one or `none`. They are those that
the diagnoses of this joint found in several recordings.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pam_gap.diagnose_recordings import joints_to_diagnose, usable_parts
from pam_gap.diagnosis_engine import DiagnosisOptions, JointDiagnosis
from pam_gap.inference.candidates import NESTED, Candidate, candidates_for
from pam_gap.inference.confidence import parameter_intervals
from pam_gap.inference.score import level
from pam_gap.prediction.identifiable import what_is_missing
from pam_gap.recordings.column_map import load_column_map
from pam_gap.recordings.computed_channels import without_computed
from pam_gap.recordings.import_recording import import_recording
from pam_gap.rules import DEFAULT, Rules
from pam_model.effects import EFFECTS
from pam_model.errors import PamError
from pam_model.plant.parameters import RIG_PLACES
from pam_model.rig import load_rig

RULES = DEFAULT.fleet


@dataclass(frozen=True, slots=True)
class TrackTask:
    """One joint of one recording, and the effects to fit."""

    # recording, rig: the recording and its rig file
    recording: Path
    rig: Path
    joint: str  # name of the joint
    # labels of the candidates, such as "leakage" or "pressure_bias (agonist)"
    labels: tuple[str, ...]
    # for each candidate, parameter -> value at which the fit may start; from the diagnoses
    starts: tuple[Mapping[str, float], ...]
    rules: Rules = DEFAULT  # hand-set constants
    map_path: Path | None = None  # map file for tables with other names or units


def labels_found(answer: Mapping[str, Any]) -> tuple[str, ...]:
    """Labels of the effects that a diagnosis found, with the side of one-sided ones.

    Of an ambiguous answer they are those of its best hypothesis, which has parameters.
    """
    effects = set(answer["parameters"])
    if not effects:
        return ()
    for entry in answer.get("ranking", ()):
        if set(entry["effects"]) == effects:
            return tuple(str(entry["label"]).split(" + "))
    return tuple(sorted(effects))


def effects_to_follow(answers: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """Labels of the effects that are fitted on every recording of a joint, most frequent first.

    An effect is not followed together with one that the recordings cannot distinguish from it, nor
    with a richer or simpler law of the same thing.
    """
    votes = Counter(label for answer in answers for label in labels_found(answer))
    rivals: set[frozenset[str]] = {frozenset(pair) for pair in NESTED}
    for answer in answers:
        for group in answer.get("indistinguishable", ()):
            rivals |= {frozenset((a, b)) for a in group for b in group if a != b}
    needed = max(RULES.several, int(np.ceil(RULES.several_share * len(answers))))
    chosen: list[str] = []
    for label, count in sorted(votes.items(), key=lambda item: (-item[1], item[0])):
        effect = label.partition(" (")[0]
        known = [other.partition(" (")[0] for other in chosen]
        if count < needed or len(chosen) == RULES.most_followed:
            break
        if effect not in known and not any(frozenset((effect, k)) in rivals for k in known):
            chosen.append(label)
    return tuple(chosen)


def typical_values(
    answers: Sequence[Mapping[str, Any]], labels: Sequence[str]
) -> tuple[dict[str, float], ...]:
    """Medians of the parameters of each effect over the diagnoses that found it."""
    found: list[dict[str, float]] = []
    for label in labels:
        effect = label.partition(" (")[0]
        values: dict[str, list[float]] = {}
        for answer in answers:
            if label in labels_found(answer):
                for name, entry in answer["parameters"].get(effect, {}).items():
                    values.setdefault(name, []).append(float(entry["value"]))
        found.append({name: float(np.median(all_)) for name, all_ in values.items()})
    return tuple(found)


def _starts(
    members: Sequence[Candidate], typical: Sequence[Mapping[str, float]]
) -> list[np.ndarray]:
    """Starts of the fit: the typical values, and the usual starts of each effect."""
    count = max(len(member.starts) for member in members)
    found = [
        np.concatenate([m.starts[min(k, len(m.starts) - 1)] for m in members]) for k in range(count)
    ]
    known = [
        values.get(name, float(start))
        for member, values in zip(members, typical, strict=True)
        for name, start in zip(member.parameter_names, member.starts[0], strict=True)
    ]
    return [np.array(known), *found]


def follow(task: TrackTask) -> list[dict[str, Any]]:
    """Fit the effects on one recording; one row for each parameter.

    Returns
    -------
    list of dict
        `effect`, `parameter`, `value`, `low`, `high` (90 % interval), `unit`, `is_shape` and
        `improvement`: by how much the effects together lower the level of the error.

    Raises
    ------
    PamError
        When the recording does not hold enough for a fit.
    """
    rig, rules = load_rig(task.rig), task.rules
    column_map = None if task.map_path is None else load_column_map(task.map_path)
    raw = import_recording(task.recording, column_map=column_map)
    read = without_computed(raw, rig, rules.recording)
    number = joints_to_diagnose(rig, [read], task.joint)[0]
    clean = usable_parts(rig, number, [read], rules.recording)
    engine = JointDiagnosis(rig, number, clean, DiagnosisOptions(threads=1, rules=rules))
    missing = what_is_missing(engine.problem)
    if missing:
        raise PamError(" ".join(missing))
    known = {c.label: c for c in candidates_for(rig, rig.joints[number])}
    members = [known[label] for label in task.labels]
    fitter, search = engine.fitter, rules.search

    def left(mean_square: np.ndarray) -> float:
        return level(mean_square, engine.floor, engine.present)

    nominal = fitter.fit_nominal()
    tried = [
        fitter.fit(
            members,
            np.concatenate([nominal.result.values, start]),
            cached=nominal.result.jacobian,
            max_iterations=search.screening_steps,
        )
        for start in _starts(members, task.starts)
    ]
    best = min(tried, key=lambda h: left(h.mean_square))
    centres = [nuisance.free.centre for nuisance in fitter.nuisances]
    # The re-tuned numbers may imitate the effects; the second start has those of the rig file.
    ends = [
        fitter.fit(members, start, max_iterations=search.finish_steps)
        for start in (
            best.result.values,
            np.concatenate([centres, best.result.values[len(centres) :]]),
        )
    ]
    best = min((best, *ends), key=lambda h: h.result.objective)
    intervals = parameter_intervals(fitter, engine.folds, best)[len(centres) :]
    improvement = left(nominal.mean_square) - left(best.mean_square)
    rows: list[dict[str, Any]] = []
    for member in members:
        for name, targets in zip(member.parameter_names, member.targets, strict=True):
            interval = intervals[len(rows)]
            key = RIG_PLACES[targets[0]].key
            parameter = EFFECTS[member.effect].parameters[key]
            rows.append(
                {
                    "effect": member.effect,
                    "parameter": name,
                    "value": interval.value,
                    "low": interval.low,
                    "high": interval.high,
                    "unit": parameter.unit,
                    "is_shape": parameter.is_shape,
                    "improvement": improvement,
                }
            )
    return rows
