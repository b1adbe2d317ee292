"""Removes channels that look measured but were computed by a node from pressure and position.

The model node publishes `muscle_states` too. A force that equals the nominal force at the measured
pressure and position in every sample carries no information, but would count as a load cell.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pam_gap.recordings.noise_floor import channel_noise
from pam_gap.recordings.recording import JOINTS, MUSCLES, PRESSURES, Recording
from pam_gap.rules import DEFAULT
from pam_gap.rules.recording_rules import RecordingRules
from pam_model.errors import PamError
from pam_model.physics.pressure_sensor import true_pressure
from pam_model.rig import Rig
from pam_model.robot import Robot, RobotMuscle, compose
from pam_model.views.muscle_path import path_length


def without_computed(
    recording: Recording, rig: Rig, rules: RecordingRules = DEFAULT.recording
) -> Recording:
    """The recording without forces that a model computed, with the rig's effects or without."""
    robots = [compose(rig)]
    if robots[0] != compose(rig.without_effects()):
        robots.append(compose(rig.without_effects()))
    computed = [
        f"{MUSCLES}{muscle.name}.effort"
        for muscle in robots[0].muscles
        if any(
            _is_computed(recording, robot, robot.muscles[muscle.place], rules) for robot in robots
        )
    ]
    if not computed:
        return recording
    note = f"{', '.join(computed)}: computed from pressure and position, not measured; not used"
    return replace(
        recording,
        values={k: v for k, v in recording.values.items() if k not in computed},
        valid={k: v for k, v in recording.valid.items() if k not in computed},
        repairs=(*recording.repairs, note),
    )


def _is_computed(
    recording: Recording, robot: Robot, muscle: RobotMuscle, rules: RecordingRules
) -> bool:
    """Whether the recorded pull of a muscle is its static force at the recorded readings."""
    channel, pressure_name = f"{MUSCLES}{muscle.name}.effort", f"{PRESSURES}{muscle.name}"
    shown = {arm.joint: f"{JOINTS}{robot.joint_names[arm.joint]}.position" for arm in muscle.arms}
    if not (shown and all(recording.has(c) for c in (channel, pressure_name, *shown.values()))):
        return False
    pressure = true_pressure(
        recording.values[pressure_name], muscle.pressure_gain, muscle.pressure_bias
    )
    positions = {
        joint: recording.values[name] - robot.joints[joint].position_offset
        for joint, name in shown.items()
    }
    try:
        force = np.vectorize(muscle.force_model.force, otypes=[float])(
            pressure, path_length(muscle, positions)
        )
    except PamError:
        return False
    pull = recording.values[channel]
    span = float(np.ptp(pull))
    off = np.maximum(force, 0.0) - pull
    # A load cell has its own noise; a computed force only has the noise of its inputs.
    own_noise = channel_noise(off, rules=rules).deviation
    noise = channel_noise(pull, rules=rules).deviation
    is_equal = float(np.median(np.abs(off))) < rules.computed_difference * span
    return is_equal and not own_noise > rules.computed_noise * noise
