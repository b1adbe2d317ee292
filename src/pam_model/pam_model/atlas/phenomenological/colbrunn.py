"""Colbrunn's muscle: spring, viscous damper and Coulomb friction in parallel.

The structure is stated without a formula in "A Review of Design and Modeling of Pneumatic
Artificial Muscle"; F = k x + B x' + F_c sgn(x') is derived from it here.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pam_model.domain import plain, require


class ColbrunnMuscle:
    """The force that stretches the muscle, at one pressure.

    Parameters
    ----------
    stiffness : float
        k [N/m].
    damping : float
        B [N s/m].
    coulomb_force : float
        F_c [N].

    Raises
    ------
    DomainError
        For a parameter below 0.
    """

    def __init__(self, stiffness: float, damping: float, coulomb_force: float) -> None:
        require("stiffness [N/m]", stiffness, 0.0)
        require("damping [N s/m]", damping, 0.0)
        require("coulomb_force [N]", coulomb_force, 0.0)
        self.stiffness = stiffness
        self.damping = damping
        self.coulomb_force = coulomb_force

    def force(self, stretch: Any, speed: Any = 0.0) -> Any:
        """Force [N] at a stretch [m] and stretching speed [m/s]; the friction is 0 at rest."""
        friction = self.coulomb_force * np.sign(speed)
        return plain(self.stiffness * stretch + self.damping * speed + friction)
