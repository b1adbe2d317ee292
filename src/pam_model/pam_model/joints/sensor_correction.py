"""Correction of the static sensor errors that the rig file names.

A reading is gain times pressure plus bias, or position plus offset. Gain, bias and offset come from
the effects of the rig file (`pam_model.effects`).
"""

from __future__ import annotations

from collections.abc import Sequence

from pam_model.physics.pressure_sensor import true_pressure
from pam_model.robot.robot import Robot


class SensorCorrection:
    """The static sensor errors that a rig file names."""

    def __init__(self, robot: Robot) -> None:
        self._offsets = [joint.position_offset for joint in robot.joints]
        self._gains = [muscle.pressure_gain for muscle in robot.muscles]
        self._biases = [muscle.pressure_bias for muscle in robot.muscles]
        self._reads_true = set(self._gains) <= {1.0} and set(self._biases) <= {0.0}

    def position(self, joint: int, measured: float) -> float:
        """True position [rad] of a joint, by its number in the rig."""
        return measured - self._offsets[joint]

    def pressure(self, muscle: int, measured: float) -> float:
        """True gauge pressure [Pa] of a muscle, by its number in the rig."""
        return float(true_pressure(measured, self._gains[muscle], self._biases[muscle]))

    def positions(self, measured: Sequence[float]) -> list[float]:
        """True positions [rad], in the rig's order."""
        return [
            float(value) - offset for value, offset in zip(measured, self._offsets, strict=True)
        ]

    def pressures(self, measured: Sequence[float]) -> list[float]:
        """True gauge pressures [Pa], in the rig's order."""
        values = [float(value) for value in measured]
        if self._reads_true:
            return values
        return [
            true_pressure(value, gain, bias)
            for value, gain, bias in zip(values, self._gains, self._biases, strict=True)
        ]
