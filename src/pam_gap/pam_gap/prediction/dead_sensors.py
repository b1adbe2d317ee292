"""Sensors that show one value throughout, although what they measure must have changed.

A joint whose position never changes may be locked, or its encoder may be dead or not connected. The
pressures tell which: the volumes of the muscles change with the angle. The recording is simulated
with a locked joint and with a free one, and what both leave in the pressures is compared.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pam_gap.prediction.channel_order import AGONIST_PRESSURE, POSITION
from pam_gap.prediction.channels import Channels
from pam_gap.prediction.fit import mean_squares
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import SHUT


def _with_free_joint(data: Channels) -> Channels:
    """The recording as if the joint were free and its position not recorded."""
    if not data.recording.is_found_still:
        return data
    known = data.known.copy()
    known[:, POSITION] = False
    return replace(data, known=known, recording=replace(data.recording, mounting=""))


def dead_encoder(problem: PredictionProblem) -> tuple[str, ...]:
    """What is missing, if a position that stays the same belongs to a joint that moves."""
    still = [data for data in problem.data if data.recording.is_found_still]
    if not still or not problem.has_commands or not problem.present.any():
        return ()
    rows = problem.counted.copy()
    for data, start, end in zip(
        problem.data, problem.offsets[:-1], problem.offsets[1:], strict=True
    ):
        rows[start:end] &= data.recording.is_found_still
    base = problem.base.values[None]
    locked = mean_squares(problem.errors(base)[0], rows)[problem.present]
    free = mean_squares(problem.with_data(_with_free_joint).errors(base)[0], rows)[problem.present]
    ratio = float(np.exp(np.mean(np.log(np.maximum(free, 1e-9) / np.maximum(locked, 1e-9)))))
    if ratio >= problem.rules.recording.dead_encoder:
        return ()
    names = ", ".join(data.recording.source.name for data in still)
    return (
        f"Dead encoder: {problem.names[POSITION]} never changes in {names}, but the pressures "
        "change as those of a joint that moves. Check the encoder and its cable, and record again; "
        "if the joint was locked, give --locked.",
    )


def dead_pressure_sensors(problem: PredictionProblem) -> tuple[str, ...]:
    """What is missing, if a pressure stays the same although its valve fills the muscle."""
    rules = problem.rules.recording
    missing = []
    for data in problem.data:
        if not data.has_commands or data.recording.mounting == SHUT:
            continue
        for i, muscle in enumerate(problem.muscles):
            name = problem.names[AGONIST_PRESSURE + i]
            supply = problem.rig.supply_pressure - problem.rig.gas.ambient_pressure
            is_flow = problem.rig.muscle(muscle).valve.kind == "flow"
            opening = data.commands[:, i] if is_flow else data.commands[:, i] / supply
            seconds = float((opening > rules.dead_opening).sum()) * data.recording.sample_time
            value = float(data.measured[0, AGONIST_PRESSURE + i])
            if (
                name in data.recording.silent
                and seconds > rules.dead_seconds
                and value < 0.5 * supply
            ):
                missing.append(
                    f"Dead sensor: {name} is {value:.4g} Pa throughout "
                    f"{data.recording.source.name}, although its valve was commanded to fill "
                    f"the muscle for {seconds:.3g} s. Check the sensor and its cable, and record "
                    "again."
                )
    return tuple(missing)
