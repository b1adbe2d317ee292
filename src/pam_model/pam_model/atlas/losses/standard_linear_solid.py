"""Creep of the bladder as a standard linear solid: a spring and a Kelvin-Voigt element in series.

Standard form (not in the review): strain(t) = sigma/E1 + sigma/E2 (1 - exp(-t E2/eta)).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pam_model.domain import plain, require


class StandardLinearSolid:
    """Strain after a step of stress.

    Parameters
    ----------
    instant_modulus : float
        E1 [Pa].
    delayed_modulus : float
        E2 [Pa].
    viscosity : float
        eta [Pa s].

    Raises
    ------
    DomainError
        For a parameter not above 0, or a time below 0.
    """

    def __init__(self, instant_modulus: float, delayed_modulus: float, viscosity: float) -> None:
        require("instant_modulus [Pa]", instant_modulus, 0.0, open_low=True)
        require("delayed_modulus [Pa]", delayed_modulus, 0.0, open_low=True)
        require("viscosity [Pa s]", viscosity, 0.0, open_low=True)
        self.instant_modulus = instant_modulus
        self.delayed_modulus = delayed_modulus
        self.viscosity = viscosity

    @property
    def time_constant(self) -> float:
        """Time constant of the creep, eta/E2 [s]."""
        return self.viscosity / self.delayed_modulus

    def strain(self, stress: Any, time: Any) -> Any:
        """Strain [-] at a time [s] after a constant stress [Pa] is applied."""
        require("time [s]", time, 0.0)
        delayed = -np.expm1(-np.asarray(time, dtype=float) / self.time_constant)
        return plain(stress / self.instant_modulus + stress / self.delayed_modulus * delayed)
