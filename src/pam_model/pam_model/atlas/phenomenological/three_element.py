"""The three-element muscle, (38): contractile force, spring and damper in parallel.

M y'' + B y' + K y = F_ce - F_load, where y is the shortening from the rest length.
Source: equation (38) of "A Review of Design and Modeling of Pneumatic Artificial Muscle", correct
as printed except for its symbols (K in the text is k in the formula, L is the load, and F_ce is a
force, not a coefficient). Serres' coefficients are from a public simulator's description of the
model (empirical; the original was not checked): pressure in kPa, 150-550 kPa.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from pam_model.domain import plain, require


@dataclass(frozen=True, slots=True)
class Coefficients:
    """K [N/m], B [N s/m] and F_ce [N] at one pressure."""

    stiffness: Any
    damping: Any
    contractile_force: Any


def serres_coefficients(pressure: Any, *, contracting: bool) -> Coefficients:
    """Serres' fit at gauge pressure [Pa], 150-550 kPa.

    The damping is larger while contracting than while relaxing, and jumps by 1.6 N s/m at 372 kPa.

    Raises
    ------
    DomainError
        Outside the range of the fit.
    """
    require("pressure [Pa]", pressure, 150e3, 550e3, why="the range of Serres' fit")
    p = np.asarray(pressure, dtype=float) / 1e3
    stiffness = np.where(p <= 314.0, 32.7 - 0.0321 * p, 17.0 + 0.0179 * p)
    if contracting:
        damping = np.full_like(p, 2.90)
    else:
        damping = np.where(p <= 372.0, 1.57, 0.311 + 0.00338 * p)
    return Coefficients(plain(1e3 * stiffness), plain(1e3 * damping), plain(2.91 * p + 44.6))


class ThreeElementMuscle:
    """(38) with constant coefficients, solved in closed form.

    Parameters
    ----------
    mass : float
        M, the mass that the muscle moves [kg].
    damping : float
        B [N s/m].
    stiffness : float
        K of the parallel spring [N/m]; it resists shortening.
    contractile_force : float
        F_ce, the pull at y = 0 [N].

    Raises
    ------
    DomainError
        For a mass or stiffness not above 0, a damping below 0, or a time below 0.
    """

    def __init__(
        self, mass: float, damping: float, stiffness: float, contractile_force: float
    ) -> None:
        require("mass [kg]", mass, 0.0, open_low=True)
        require("damping [N s/m]", damping, 0.0)
        require("stiffness [N/m]", stiffness, 0.0, open_low=True)
        require("contractile_force [N]", contractile_force)
        self.mass = mass
        self.damping = damping
        self.stiffness = stiffness
        self.contractile_force = contractile_force

    @classmethod
    def at_pressure(cls, mass: float, pressure: float, *, contracting: bool) -> ThreeElementMuscle:
        """The muscle with Serres' coefficients at a gauge pressure [Pa]."""
        fit = serres_coefficients(pressure, contracting=contracting)
        return cls(mass, fit.damping, fit.stiffness, fit.contractile_force)

    @property
    def natural_frequency(self) -> float:
        """Undamped natural frequency sqrt(K/M) [rad/s]."""
        return math.sqrt(self.stiffness / self.mass)

    @property
    def damping_ratio(self) -> float:
        """Damping ratio B/(2 sqrt(K M)) [-]."""
        return self.damping / (2.0 * math.sqrt(self.stiffness * self.mass))

    def force(self, shortening: Any, speed: Any = 0.0) -> Any:
        """Pull [N] at a shortening [m] and shortening speed [m/s]."""
        return self.contractile_force - self.stiffness * shortening - self.damping * speed

    def final_shortening(self, load: float) -> float:
        """y_ss = (F_ce - F_load)/K [m]."""
        return (self.contractile_force - load) / self.stiffness

    def step_response(self, load: float, time: float) -> tuple[float, float]:
        """Shortening [m] and its speed [m/s] at a time [s] after pressure and load [N] are applied.

        The muscle starts at rest at y = 0. Underdamped, critically damped and overdamped motion
        have separate branches, so that none divides by zero.
        """
        require("time [s]", time, 0.0)
        final = self.final_shortening(load)
        zeta, omega = self.damping_ratio, self.natural_frequency
        decay = 0.5 * self.damping / self.mass
        # Computed from the coefficients: 1 - zeta^2 would lose the digits that decide the branch.
        squared = self.stiffness / self.mass - decay * decay
        if abs(squared) <= 1e-12 * omega * omega:
            fading = math.exp(-decay * time)
            return (
                final * (1.0 - fading * (1.0 + decay * time)),
                final * decay * decay * time * fading,
            )
        if zeta < 1.0:
            ringing = math.sqrt(squared)
            fading = math.exp(-decay * time)
            sine, cosine = math.sin(ringing * time), math.cos(ringing * time)
            return (
                final * (1.0 - fading * (cosine + decay / ringing * sine)),
                final * fading * omega * omega / ringing * sine,
            )
        fast = decay + math.sqrt(-squared)
        slow = omega * omega / fast
        slow_part, fast_part = math.exp(-slow * time), math.exp(-fast * time)
        gap = fast - slow
        return (
            final * (1.0 - (fast * slow_part - slow * fast_part) / gap),
            final * omega * omega * (slow_part - fast_part) / gap,
        )
