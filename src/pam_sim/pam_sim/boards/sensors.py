"""The readings of a board's converters: signal plus noise, rounded to the resolution."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pam_model.errors import PamError


@dataclass(frozen=True, slots=True)
class SensorQuality:
    """Noise and resolution of a board's inputs; 0 switches the noise or the rounding off."""

    pressure_noise: float = 200.0  # standard deviation of the noise [Pa]
    position_noise: float = 1e-4  # standard deviation of the noise [rad]
    # resolution of the converter [Pa]; default 12 bits for 10 bar
    pressure_quantum: float = 1e6 / 4096.0
    # resolution of the encoder [rad]; default 14 bits per turn
    position_quantum: float = 6.283185307179586 / 16384.0

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if not 0.0 <= value < 1e6:
                raise PamError(f"{name} = {value} must be 0 or above")


class BoardSensors:
    """The analogue inputs of one board."""

    BLOCK = 1024

    def __init__(self, quality: SensorQuality, seed: tuple[int, ...]) -> None:
        import numpy as np  # noqa: PLC0415  (the node's --help needs the defaults above alone)

        self._quality = quality
        self._random = np.random.default_rng(seed)
        self._noise: list[float] = []

    def pressure(self, pressure: float) -> float:
        """Reading of a gauge pressure [Pa]."""
        quality = self._quality
        return _rounded(pressure + quality.pressure_noise * self._draw(), quality.pressure_quantum)

    def position(self, position: float) -> float:
        """Reading of an angle [rad]."""
        quality = self._quality
        return _rounded(position + quality.position_noise * self._draw(), quality.position_quantum)

    def _draw(self) -> float:
        if not self._noise:
            # Noise is drawn in blocks: a single draw takes twenty times as long.
            self._noise = self._random.standard_normal(self.BLOCK).tolist()
        return self._noise.pop()


def _rounded(value: float, quantum: float) -> float:
    return round(value / quantum) * quantum if quantum > 0.0 and math.isfinite(value) else value
