"""A contractor and an extensor side by side: bending with adjustable stiffness.

Named without a formula in "A Review of Design and Modeling of Pneumatic Artificial Muscle";
derived here with a simplification: both muscles lie at distance r from a middle line of constant
length, so that the contractor is shorter by r angle and the extensor is longer by r angle. The
torque is r (F_c - F_e), where an extensor's F_e is negative, and the stiffnesses add up to
r^2 (K_c + K_e). With two pressures, torque and stiffness can be chosen at a fixed angle.
"""

from __future__ import annotations

from typing import Any

from pam_model.domain import require
from pam_model.errors import DomainError
from pam_model.muscles.force_model import AffineForceModel, ForceModel


class ExtensorContractorBending:
    """Two length-force muscles bending one limb.

    Parameters
    ----------
    contractor, extensor : ForceModel
        Any registered models; the extensor's braid angle is above 54.7356 deg.
    contractor_length, extensor_length : float
        Lengths of the straight limb's muscles [m].
    radius : float
        r, distance of either muscle from the middle line [m].

    Raises
    ------
    DomainError
        For lengths or a radius not above 0; by the methods if a muscle leaves its domain.
    """

    def __init__(
        self,
        contractor: ForceModel,
        extensor: ForceModel,
        contractor_length: float,
        extensor_length: float,
        radius: float,
    ) -> None:
        require("contractor_length [m]", contractor_length, 0.0, open_low=True)
        require("extensor_length [m]", extensor_length, 0.0, open_low=True)
        require("radius [m]", radius, 0.0, open_low=True)
        self.contractor = contractor
        self.extensor = extensor
        self.contractor_length = contractor_length
        self.extensor_length = extensor_length
        self.radius = radius

    def lengths(self, angle: Any) -> tuple[Any, Any]:
        """Contractor's and extensor's length [m] at a bend angle [rad]."""
        shift = self.radius * angle
        return self.contractor_length - shift, self.extensor_length + shift

    def moment(self, contractor_pressure: Any, extensor_pressure: Any, angle: Any) -> Any:
        """Torque [N m] towards the contractor at gauge pressures [Pa] and bend angle [rad]."""
        short, long = self.lengths(angle)
        pull = self.contractor.force(contractor_pressure, short)
        return self.radius * (pull - self.extensor.force(extensor_pressure, long))

    def stiffness(self, contractor_pressure: Any, extensor_pressure: Any, angle: Any) -> Any:
        """-dM/d(angle) [N m/rad] at constant pressures."""
        short, long = self.lengths(angle)
        added = self.contractor.stiffness(contractor_pressure, short)
        return self.radius**2 * (added + self.extensor.stiffness(extensor_pressure, long))

    def pressures_for(self, moment: float, stiffness: float, angle: float) -> tuple[float, float]:
        """Gauge pressures [Pa] of contractor and extensor for a given moment and stiffness.

        Parameters
        ----------
        moment : float
            Torque wanted [N m].
        stiffness : float
            -dM/d(angle) wanted [N m/rad].
        angle : float
            Bend angle [rad].

        Raises
        ------
        DomainError
            If a muscle is not affine in pressure, or if a pressure would have to be below 0; the
            message then gives the pressures.
        """
        for name, muscle in (("contractor", self.contractor), ("extensor", self.extensor)):
            if not isinstance(muscle, AffineForceModel):
                raise DomainError(f"{name}: model {muscle.name} is not affine in pressure")
        assert isinstance(self.contractor, AffineForceModel)
        assert isinstance(self.extensor, AffineForceModel)
        short, long = self.lengths(angle)
        pull, passive_pull = self.contractor.coefficients(short)
        push, passive_push = self.extensor.coefficients(long)
        rise, passive_rise = self.contractor.coefficient_slopes(short)
        fall, passive_fall = self.extensor.coefficient_slopes(long)
        torque = moment / self.radius - passive_pull + passive_push
        spring = stiffness / self.radius**2 - passive_rise - passive_fall
        determinant = pull * fall + push * rise
        if determinant == 0.0:
            raise DomainError(f"angle = {angle:g} rad: torque and stiffness depend on each other")
        contractor = (torque * fall + push * spring) / determinant
        extensor = (pull * spring - rise * torque) / determinant
        if min(contractor, extensor) < 0.0:
            raise DomainError(
                f"moment = {moment:g} N m with stiffness = {stiffness:g} N m/rad needs pressures "
                f"{contractor:g} Pa and {extensor:g} Pa: both must be at least 0"
            )
        return contractor, extensor
