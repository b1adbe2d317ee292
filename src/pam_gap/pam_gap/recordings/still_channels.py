"""Finds channels that never change, which say nothing about a model, and joints that are locked.

A constant column has no noise of its own. With a noise floor near zero, rounding errors of the
simulation would count as a large gap in it, and the most flexible effect would be named for them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pam_gap.recordings.noise_floor import channel_noise, is_still
from pam_gap.recordings.recording import (
    JOINTS,
    LOCKED,
    MUSCLES,
    PRESSURES,
    Array,
    Recording,
)
from pam_gap.rules import DEFAULT
from pam_gap.rules.recording_rules import RecordingRules
from pam_model.rig import Rig


def full_scales(rig: Rig, joint: int) -> Array:
    """Largest values that the sensors of one joint have to show, shape (5,).

    Both pressures: the supply pressure [Pa gauge]. Position: one turn [rad]. Both forces: the force
    of the nominal braid at rest length and supply pressure [N], at least that of 1 cm^2.
    """
    entry = rig.joints[joint]
    supply = max(rig.supply_pressure - rig.gas.ambient_pressure, 1.0)
    areas = []
    for name in entry.muscles:
        muscle = rig.muscle(name)
        square = 3.0 * muscle.rest_length**2 - muscle.thread_length**2
        areas.append(max(abs(square) / (4.0 * np.pi * muscle.turns**2), 1e-4))
    return np.array([supply, supply, 2.0 * np.pi, *(supply * area for area in areas)])


def finest_deviations(rig: Rig, joint: int, rules: RecordingRules = DEFAULT.recording) -> Array:
    """Noise below which no channel of a joint falls, in the order of the channels, shape (5,)."""
    finest: Array = full_scales(rig, joint) * rules.finest_share / np.sqrt(12.0)
    return finest


def without_still(
    recording: Recording, rig: Rig, joint: int, rules: RecordingRules = DEFAULT.recording
) -> Recording:
    """The recording with its constant channels marked as silent, and a still joint as locked.

    A joint whose position never changes by more than its noise is treated as locked, unless an
    external torque was recorded, against which dry friction can hold it.
    """
    entry = rig.joints[joint]
    position = f"{JOINTS}{entry.name}.position"
    torque = f"{JOINTS}{entry.name}.effort"
    names = (
        *(f"{PRESSURES}{m}" for m in entry.muscles),
        position,
        *(f"{MUSCLES}{m}.effort" for m in entry.muscles),
    )
    finest = finest_deviations(rig, joint, rules)
    notes: list[str] = []
    silent: set[str] = set(recording.silent)
    mounting = recording.mounting
    found_still = False
    for name, least in zip(names, finest.tolist(), strict=True):
        if not recording.has(name):
            continue
        values = recording.values[name][recording.valid[name]]
        if not values.size:
            continue
        noise = channel_noise(
            recording.samples.get(name, values), rules=rules
        ).at_least(least)  # fmt: skip
        if name == position and not recording.has(torque) and is_still(values, noise, rules):
            silent.add(name)
            if not mounting:
                mounting, found_still = LOCKED, True
            notes.append(
                f"{name}: stays at {float(np.median(values)):.4g} rad within its noise, so the "
                "joint is treated as locked there; if it was free to move, nothing about the joint "
                "can be judged"
            )
        elif float(np.ptp(values)) <= least:
            silent.add(name)
            notes.append(
                f"{name}: is {float(values[0]):.6g} throughout, without any noise, so it is not "
                "compared"
            )
    if not notes:
        return recording
    return replace(
        recording,
        silent=frozenset(silent),
        mounting=mounting,
        is_found_still=found_still,
        repairs=(*recording.repairs, *notes),
    )
