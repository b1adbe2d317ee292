"""Correction of the static sensor errors that the rig file names.

A reading is gain times pressure plus bias, or position plus offset. Gain, bias and offset come from
the effects of the rig file (`pam_model.effects`).
"""

from __future__ import annotations

from collections.abc import Sequence

from pam_model.effects import adjusted
from pam_model.physics.pressure_sensor import true_pressure
from pam_model.rig.types import Rig


class SensorCorrection:
    """The static sensor errors that a rig file names.

    Parameters
    ----------
    rig : Rig
        As read from a file.
    """

    def __init__(self, rig: Rig) -> None:
        self._offsets = [
            adjusted("position_sensor.offset", None, joint.effects) for joint in rig.joints
        ]
        self._gains = [
            adjusted("pressure_sensor.gain", None, muscle.effects) for muscle in rig.muscles
        ]
        self._biases = [
            adjusted("pressure_sensor.bias", None, muscle.effects) for muscle in rig.muscles
        ]
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
