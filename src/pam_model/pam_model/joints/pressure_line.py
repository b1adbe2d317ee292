"""Pull and stiffness of a muscle at one length as linear functions of pressure.

They are exact for affine models and a local approximation for others.
"""

from __future__ import annotations

from dataclasses import dataclass

Point = tuple[float, float, float]
"""Pressure [Pa gauge], pull [N], dF/dL [N/m]."""


@dataclass(slots=True)
class PressureLine:
    """F = scale p + passive and K = rise p + offset, between the ends of a pressure range.

    Attributes
    ----------
    weakest, strongest : float
        Pulls at the ends of the range, never below 0 [N].
    scale, passive : float
        Coefficients of the pull [m^2], [N]; scale is 0 if the muscle is too short to pull.
    rise, offset : float
        Coefficients of dF/dL at constant pressure [m], [N/m].
    low, high : float
        Limits of the range [Pa gauge].
    """

    weakest: float
    strongest: float
    scale: float
    passive: float
    rise: float
    offset: float
    low: float
    high: float

    def pressure(self, force: float) -> float:
        """Pressure [Pa gauge] for a pull [N], limited to the range."""
        if self.scale <= 0.0:
            return self.low
        pressure = (force - self.passive) / self.scale
        return self.low if pressure < self.low else min(pressure, self.high)

    def stiffness(self, force: float) -> float:
        """dF/dL [N/m] at a pull [N]."""
        if self.scale <= 0.0:
            return self.offset
        return (force - self.passive) / self.scale * self.rise + self.offset

    def through(self, first: Point, second: Point) -> None:
        """Fit the lines to two points of different pressure."""
        run = second[0] - first[0]
        scale = (second[1] - first[1]) / run
        if scale > 0.0:
            self.scale = scale
            self.rise = (second[2] - first[2]) / run
        self.shift(second)

    def shift(self, point: Point) -> None:
        """Move the lines to a point and keep their slopes."""
        if self.scale > 0.0:
            self.passive = point[1] - self.scale * point[0]
            self.offset = point[2] - self.rise * point[0]
