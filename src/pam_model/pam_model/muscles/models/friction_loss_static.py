"""Static model with ends, bladder and friction losses in one energy balance.

Named without an equation in "A Review of Design and Modeling of Pneumatic Artificial Muscle" (a
static model with friction losses); the source's form was not found. Derived composite:
F = -P dV/dL + dU_b/dL + sgn(dL/dt) F_thread, with the gas volume of a braid that tapers to its
fittings, and with a Mooney-Rivlin bladder and thread friction along the cylindrical part, all as
functions of the length of the whole muscle.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from pam_model.muscles.elementary import direction
from pam_model.muscles.force_model import ModelParameter, MuscleGeometry, register
from pam_model.muscles.rubber_wall import RUBBER_PARAMETERS, RubberWall, tube_volume
from pam_model.muscles.tapered_braid import END_PARAMETERS, TaperedBraid, cylindrical_part
from pam_model.muscles.thread_friction import FRICTION_PARAMETERS, ThreadFriction


@register(
    equations="(20)-(22)",
    status="stand-in",
    summary="tapered braid, bladder and thread friction from one energy balance",
    row="friction_loss",
)
class FrictionLossStatic(TaperedBraid):
    """Affine in pressure at rest; friction acts only in motion.

    Parameters
    ----------
    thread_length : float
        b of the cylindrical part [m].
    turns : float
        n of the cylindrical part [-].
    cone_slant : float
        L_z [m].
    fitting_diameter : float
        d [m].
    bladder : RubberWall
        The bladder along the cylindrical part.
    friction : ThreadFriction
        The friction along the cylindrical part.

    Raises
    ------
    DomainError
        As `TaperedBraid` and `RubberWall`.
    """

    name: ClassVar[str] = "friction_loss_static"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        **END_PARAMETERS,
        **RUBBER_PARAMETERS,
        **FRICTION_PARAMETERS,
    }

    def __init__(
        self,
        thread_length: float,
        turns: float,
        cone_slant: float,
        fitting_diameter: float,
        *,
        bladder: RubberWall,
        friction: ThreadFriction,
    ) -> None:
        super().__init__(thread_length, turns, cone_slant, fitting_diameter)
        self.bladder = bladder
        self.friction = friction
        self._keep_room_for(bladder.volume)

    @classmethod
    def from_geometry(
        cls, geometry: MuscleGeometry, constants: Mapping[str, float]
    ) -> FrictionLossStatic:
        """The model of a muscle in a rig file."""
        ends = {key: constants[key] for key in END_PARAMETERS}
        size = cylindrical_part(geometry, **ends)
        volume = tube_volume(*size, geometry.wall_thickness)
        rubber = {key: constants[key] for key in RUBBER_PARAMETERS}
        friction = {key: constants[key] for key in FRICTION_PARAMETERS}
        return cls(
            size[0],
            size[1],
            **ends,
            bladder=RubberWall.thin(*size, **rubber, volume=volume),
            friction=ThreadFriction(size[1], **friction),
        )

    def coefficients(self, length: Any) -> tuple[Any, Any]:
        """A = -dV/dL [m^2] and the bladder's pull B [N]."""
        middle = self.middle_length(length)
        state = self._state(middle)
        return -state.volume1 / state.length1, self.bladder.force(middle) / state.length1

    def coefficient_slopes(self, length: Any) -> tuple[Any, Any]:
        """dA/dL [m] and dB/dL [N/m]."""
        middle = self.middle_length(length)
        state = self._state(middle)
        turn = state.volume2 * state.length1 - state.volume1 * state.length2
        pull, rise = self.bladder.force(middle), self.bladder.stiffness(middle)
        passive = (rise * state.length1 - pull * state.length2) / state.length1**3
        return -turn / state.length1**3, passive

    def energy(self, length: Any) -> Any:
        """Strain energy of the bladder [J]."""
        return self.bladder.energy(self.middle_length(length))

    def friction_loss(self, pressure: Any, length: Any) -> Any:
        """F_thread [N]."""
        middle = self.middle_length(length)
        return pressure * self.friction.per_pressure(middle) / self._state(middle).length1

    def force(self, pressure: Any, length: Any, velocity: Any = 0.0) -> Any:
        """Pull [N]; friction adds to it in lengthening [m/s], reduces it in shortening."""
        static = super().force(pressure, length)
        if isinstance(velocity, (float, int)) and velocity == 0.0:
            return static
        return static + direction(velocity) * self.friction_loss(pressure, length)

    def volume(self, length: Any) -> Any:
        """Volume of the cylinder and the cones minus that of the rubber [m^3]."""
        return super().volume(length) - self.bladder.volume
