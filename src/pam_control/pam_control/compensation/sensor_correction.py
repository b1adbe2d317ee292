"""What the sensors should have said: encoder zero, gain and zero of pressure sensors taken out."""

from __future__ import annotations

from collections.abc import Sequence

from pam_model.effects import effect_value
from pam_model.rig import Rig


class SensorCorrection:
    """The static sensor errors that a rig file names.

    Parameters
    ----------
    rig : Rig
        As read from a file.
    """

    def __init__(self, rig: Rig) -> None:
        self._offsets = [
            effect_value(joint.effects, "position_offset", "offset") for joint in rig.joints
        ]
        self._gains = [
            effect_value(muscle.effects, "pressure_gain", "gain") for muscle in rig.muscles
        ]
        self._biases = [
            effect_value(muscle.effects, "pressure_bias", "bias") for muscle in rig.muscles
        ]

    def positions(self, measured: Sequence[float]) -> list[float]:
        """True positions [rad], in the rig's order."""
        return [
            float(value) - offset for value, offset in zip(measured, self._offsets, strict=True)
        ]

    def pressures(self, measured: Sequence[float]) -> list[float]:
        """True gauge pressures [Pa], in the rig's order."""
        return [
            (float(value) - bias) / gain
            for value, gain, bias in zip(measured, self._gains, self._biases, strict=True)
        ]
