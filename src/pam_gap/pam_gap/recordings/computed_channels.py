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
from pam_model.physics.joint_geometry import SIGNS, muscle_length
from pam_model.rig import Rig


def without_computed(
    recording: Recording, rig: Rig, rules: RecordingRules = DEFAULT.recording
) -> Recording:
    """The recording without forces that the nominal model computed."""
    computed = []
    for joint in rig.joints:
        position_name = f"{JOINTS}{joint.name}.position"
        for name, sign in zip(joint.muscles, SIGNS, strict=True):
            channel = f"{MUSCLES}{name}.effort"
            pressure_name = f"{PRESSURES}{name}"
            if not all(recording.has(c) for c in (channel, pressure_name, position_name)):
                continue
            muscle = rig.muscle(name)
            position = recording.values[position_name]
            length = muscle_length(muscle.neutral_length, sign, joint.pulley_radius, position)
            try:
                force = rig.force_model(name).force(recording.values[pressure_name], length)
            except PamError:
                continue
            pull = recording.values[channel]
            span = float(np.ptp(pull))
            off = np.maximum(np.asarray(force, dtype=np.float64), 0.0) - pull
            # A load cell has its own noise; a computed force only has the noise of its inputs.
            own_noise = channel_noise(off, rules=rules).deviation
            noise = channel_noise(pull, rules=rules).deviation
            is_equal = float(np.median(np.abs(off))) < rules.computed_difference * span
            if is_equal and not own_noise > rules.computed_noise * noise:
                computed.append(channel)
    if not computed:
        return recording
    note = f"{', '.join(computed)}: computed from pressure and position, not measured; not used"
    return replace(
        recording,
        values={k: v for k, v in recording.values.items() if k not in computed},
        valid={k: v for k, v in recording.valid.items() if k not in computed},
        repairs=(*recording.repairs, note),
    )
