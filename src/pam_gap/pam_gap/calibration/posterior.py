"""What a log says of all numbers together: values and covariance, and robots drawn from them.

A log fixes combinations of numbers much better than each of them. Robots whose numbers are drawn
one by one from their intervals would differ far more than the log permits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pam_gap.calibration.free_numbers import FreeRigNumber
from pam_gap.prediction.fit import Array


@dataclass(frozen=True, slots=True)
class Posterior:
    """The numbers of one joint after a calibration."""

    # all that were free, sensors and small effects of a good rig included
    numbers: tuple[FreeRigNumber, ...]
    values: Array  # shape (n,): in their own units
    # shape (n, n): of the values, or of the logarithms of those that are fitted by their logarithms
    covariance: Array

    @property
    def small(self) -> dict[str, float]:
        """Sizes of the small effects that every good rig has, by key."""
        found = zip(self.numbers, self.values.tolist(), strict=True)
        return {one.key: value for one, value in found if one.is_ordinary}

    @property
    def identified(self) -> dict[str, float]:
        """The robot that is exactly as identified, as changes of plant parameters."""
        return self._robot(self.values)

    def _robot(self, values: Array) -> dict[str, float]:
        return {
            name: value
            for one, value in zip(self.numbers, values.tolist(), strict=True)
            for name in one.targets
        }

    def robots(self, count: int, random: np.random.Generator) -> list[dict[str, float]]:
        """Robots as the log permits them, as changes of plant parameters.

        Parameters
        ----------
        count : int
            Number of robots.
        random : numpy.random.Generator
            Source of the draws.
        """
        logs = np.array([one.free.is_logarithmic for one in self.numbers])
        low = np.array([one.free.low for one in self.numbers])
        high = np.array([one.free.high for one in self.numbers])
        size, axes = np.linalg.eigh(self.covariance)
        root = axes * np.sqrt(np.maximum(size, 0.0))
        found = []
        for _ in range(count):
            change = root @ random.normal(size=self.values.size)
            grown = self.values * np.exp(np.where(logs, change, 0.0))
            drawn = np.clip(np.where(logs, grown, self.values + change), low, high)
            found.append(self._robot(drawn))
        return found
