"""Bouc-Wen hysteresis with exponent 1, in closed form on each monotone part of the motion.

Standard form (not in the review): dz = A dx - beta |dx| z |z|^(m-1) - gamma dx |z|^m with m = 1.
While the signs of dx and z are constant, z approaches its limit exponentially.
"""

from __future__ import annotations

import math

from pam_model.domain import require


class BoucWen:
    """Hysteretic variable z from displacement x; exact for any step.

    Parameters
    ----------
    amplitude : float
        A, slope dz/dx at z = 0.
    beta, gamma : float
        Shape parameters; |z| saturates at A/(beta + gamma).

    Raises
    ------
    DomainError
        For A or beta + gamma not above 0, or beta below |gamma|, since loops then create energy.
    """

    def __init__(self, amplitude: float, beta: float, gamma: float) -> None:
        require("amplitude A", amplitude, 0.0, open_low=True)
        require("beta + gamma", beta + gamma, 0.0, open_low=True)
        require("beta", beta, abs(gamma), why="|gamma|: otherwise loops create energy")
        self.amplitude = amplitude
        self.beta = beta
        self.gamma = gamma
        self.z = 0.0
        self.displacement = 0.0

    def update(self, displacement: float) -> float:
        """Move to a displacement and return z."""
        require("displacement", displacement)
        step = displacement - self.displacement
        self.displacement = displacement
        direction = math.copysign(1.0, step)
        remaining = abs(step)
        # For u = z * direction, du/d|x| = A - (beta + gamma sgn(u)) u; u < 0 first rises to 0.
        u = self.z * direction
        if u < 0.0:
            to_zero = self._travel_to_zero(u)
            if to_zero >= remaining:
                self.z = direction * self._relax(u, self.beta - self.gamma, remaining)
                return self.z
            remaining -= to_zero
            u = 0.0
        self.z = direction * self._relax(u, self.gamma + self.beta, remaining)
        return self.z

    def _travel_to_zero(self, u: float) -> float:
        rate = self.beta - self.gamma
        if rate == 0.0:
            return -u / self.amplitude
        return math.log1p(-rate * u / self.amplitude) / rate

    def _relax(self, u: float, rate: float, travel: float) -> float:
        if rate == 0.0:
            return u + self.amplitude * travel
        end = self.amplitude / rate
        return end + (u - end) * math.exp(-rate * travel)
