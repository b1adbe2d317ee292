"""Static model with ends, rubber and friction, similar to that of Li.

Named without an equation in "A Review of Design and Modeling of Pneumatic Artificial Muscle"; the
source was not found. Composite: F = F_ideal(L_m) - F_rubber(L_m) - F_friction(L_m), with the ideal
force, bladder and thread friction of the cylindrical part alone. The cones of (20)-(22) only serve
to convert the muscle's length into the cylinder's. In `friction_loss_static` the cones also
contribute to the force.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, ClassVar

from pam_model.muscles.braid import ThinCylinder
from pam_model.muscles.force_model import ModelParameter, register
from pam_model.muscles.models.friction_loss_static import FrictionLossStatic


@register(
    equations="(1), (20)-(22)",
    status="stand-in",
    summary="ideal force, rubber and friction of the cylinder between tapered ends (after Li)",
)
class LiStatic(FrictionLossStatic):
    """Force of the cylindrical part; the gas volume includes the cones (not one energy).

    Its parameters and errors are those of `FrictionLossStatic`.
    """

    name: ClassVar[str] = "li_static"
    parameters: ClassVar[Mapping[str, ModelParameter]] = FrictionLossStatic.parameters

    @cached_property
    def _cylinder(self) -> ThinCylinder:
        return ThinCylinder(self.thread_length, self.turns)

    def coefficients(self, length: Any) -> tuple[Any, Any]:
        """A of the ideal cylinder [m^2] and the bladder's pull B [N], both at L_m."""
        middle = self.middle_length(length)
        return self._cylinder.coefficients(middle)[0], self.bladder.force(middle)

    def coefficient_slopes(self, length: Any) -> tuple[Any, Any]:
        """dA/dL [m] and dB/dL [N/m]."""
        middle = self.middle_length(length)
        rate = self._state(middle).length1
        return (
            self._cylinder.coefficient_slopes(middle)[0] / rate,
            self.bladder.stiffness(middle) / rate,
        )

    def friction_loss(self, pressure: Any, length: Any) -> Any:
        """F_friction [N] of the cylindrical part."""
        return pressure * self.friction.per_pressure(self.middle_length(length))
