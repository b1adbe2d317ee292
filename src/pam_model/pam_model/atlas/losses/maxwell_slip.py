"""Maxwell-slip hysteresis: parallel springs, each of which slips at its own force.

Standard form (not in the review). Exact on each monotone part of the motion, so the step size
does not matter; minor loops close, and the state contains the turning points.
"""

from __future__ import annotations

from collections.abc import Sequence

from pam_model.domain import require
from pam_model.errors import DomainError


class MaxwellSlip:
    """Friction force from displacement; the state is the force of each element.

    Parameters
    ----------
    stiffnesses : sequence of float
        k_i [N/m]; their sum is the stiffness immediately after a reversal.
    slip_forces : sequence of float
        W_i [N]; their sum is the largest force.

    Raises
    ------
    DomainError
        For sequences of unequal length, none at all, or values not above 0.
    """

    def __init__(self, stiffnesses: Sequence[float], slip_forces: Sequence[float]) -> None:
        if len(stiffnesses) != len(slip_forces) or not stiffnesses:
            raise DomainError(
                f"{len(stiffnesses)} stiffnesses and {len(slip_forces)} slip_forces: "
                "each element needs one of each"
            )
        require("stiffnesses [N/m]", stiffnesses, 0.0, open_low=True)
        require("slip_forces [N]", slip_forces, 0.0, open_low=True)
        self.stiffnesses = tuple(float(k) for k in stiffnesses)
        self.slip_forces = tuple(float(w) for w in slip_forces)
        self.forces = [0.0] * len(self.stiffnesses)
        self.displacement = 0.0

    def update(self, displacement: float) -> float:
        """Move to a displacement [m] and return the force against the motion [N]."""
        require("displacement [m]", displacement)
        step = displacement - self.displacement
        self.displacement = displacement
        self.forces = [
            max(-limit, min(limit, force + stiffness * step))
            for force, stiffness, limit in zip(
                self.forces, self.stiffnesses, self.slip_forces, strict=True
            )
        ]
        return sum(self.forces)
