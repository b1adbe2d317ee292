"""Dry friction between the crossing threads of a braid under pressure.

F_f = (4/3) mu eta P pi D L a/(b sin theta) = (4/3) mu eta P a L/n: every crossing carries its
share of the wall's pressure and turns, as a friction disc of radius a, by twice the change of the
thread angle. Idealised derivation after an idea of Davis and Caldwell; not verified against data.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pam_model.errors import DomainError
from pam_model.muscles.braid import require_positive
from pam_model.muscles.force_model import ModelParameter

FRICTION_PARAMETERS = {
    "friction": ModelParameter(0.15, "-", 0.0, 2.0, "friction coefficient mu of thread on thread"),
    "contact_radius": ModelParameter(
        3e-4, "m", 0.0, 0.01, "radius a of the contact between threads"
    ),
    "contact_share": ModelParameter(
        0.8, "-", 0.0, 1.0, "share eta of the pressure on the wall that the crossings carry"
    ),
}
"""Constants of every model with thread friction, as rig files name them."""


@dataclass(frozen=True, slots=True)
class ThreadFriction:
    """Friction of a braid's crossings.

    Raises
    ------
    DomainError
        For turns not above zero or another constant below it.
    """

    turns: float  # n of one thread [-]
    friction: float  # mu [-]
    contact_radius: float  # a [m]
    contact_share: float = 1.0  # eta [-]

    def __post_init__(self) -> None:
        require_positive(turns=self.turns)
        for quantity in ("friction", "contact_radius", "contact_share"):
            if not getattr(self, quantity) >= 0.0:
                raise DomainError(f"{quantity} = {getattr(self, quantity):g} must be 0 or above")

    def per_pressure(self, length: Any) -> Any:
        """Friction over pressure [m^2] of a braid of this length [m]."""
        torque = self.friction * self.contact_share * self.contact_radius
        return 4.0 / 3.0 * torque / self.turns * length
