"""Sleeve muscle: a rod fills part of the braid, a second chamber pushes; after Zheng and Shen.

Named without an equation in "A Review of Design and Modeling of Pneumatic Artificial Muscle". The
gas volume consists of V1 = pi d_i^2 L/4, which would only push, and the rest V2. A rod of diameter
d_i that fills V1 gives F = F_(1) + P pi d_i^2/4; a second chamber of bore d_ext pushes with
P_ext pi d_ext^2/4. The remaining gas is V2/V = 1 - (d_i/D)^2. Derived; the concept is from the
abstract.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

from pam_model.errors import DomainError
from pam_model.muscles.braid import ThinCylinder, require_length
from pam_model.muscles.elementary import square_root
from pam_model.muscles.force_model import ModelParameter, register


@register(
    equations="-",
    status="derived",
    summary="sleeve muscle: inserted rod saves gas and adds pull, a second chamber pushes",
    row="sleeve",
)
class ZhengShen(ThinCylinder):
    """Affine in the muscle's pressure; the pressure of the second chamber is a constant.

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].
    insert_diameter : float
        d_i of the rod [m].
    chamber_diameter : float
        d_ext, bore of the second chamber [m].
    extension_pressure : float
        P_ext, gauge, in the second chamber [Pa].

    Raises
    ------
    DomainError
        For b or n not above zero, a diameter below zero, or a rod that does not fit; by the
        methods for a length at which the braid would touch the rod.
    """

    name: ClassVar[str] = "zheng_shen"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        "insert_diameter": ModelParameter(5e-3, "m", 0.0, 1.0, "diameter of the rod in the core"),
        "chamber_diameter": ModelParameter(5e-3, "m", 0.0, 1.0, "bore of the second chamber"),
        "extension_pressure": ModelParameter(
            0.0, "Pa", -1.1e5, 2e6, "gauge pressure in the second chamber"
        ),
    }

    def __init__(
        self,
        thread_length: float,
        turns: float,
        insert_diameter: float,
        chamber_diameter: float = 0.0,
        extension_pressure: float = 0.0,
    ) -> None:
        super().__init__(thread_length, turns)
        if not (insert_diameter >= 0.0 and chamber_diameter >= 0.0):
            raise DomainError(
                f"insert_diameter = {insert_diameter:g} m and chamber_diameter = "
                f"{chamber_diameter:g} m must be 0 or above"
            )
        around = insert_diameter * turns * math.pi
        if around >= thread_length:
            raise DomainError(
                f"insert_diameter = {insert_diameter:g} m must be below the braid's largest, "
                f"{thread_length / (turns * math.pi):g} m"
            )
        self.insert_diameter = insert_diameter
        self.chamber_diameter = chamber_diameter
        self.extension_pressure = extension_pressure
        self._longest = square_root(self._square - around * around)
        self._insert = 0.25 * math.pi * insert_diameter**2
        self._chamber = 0.25 * math.pi * chamber_diameter**2

    @property
    def length_bounds(self) -> tuple[float, float]:
        """(0, sqrt(b^2 - (pi n d_i)^2)); at the upper bound the braid touches the rod [m]."""
        return 0.0, self._longest

    def _check(self, length: Any) -> Any:
        return require_length(length, 0.0, self._longest, "where the braid touches the rod")

    def push(self, extension_pressure: Any) -> Any:
        """P_ext pi d_ext^2/4 [N], extension positive, at a gauge pressure [Pa]."""
        return self._chamber * extension_pressure

    def net_force(self, pressure: Any, extension_pressure: Any, length: Any) -> Any:
        """Pull [N] at both gauge pressures [Pa] and length [m]."""
        return pressure * self.coefficients(length)[0] - self.push(extension_pressure)

    def gas_ratio(self, length: Any) -> Any:
        """V2/V = 1 - (d_i/D)^2 [-]: gas volume relative to the same muscle without a rod."""
        return self.volume(length) / super().volume(length)

    def coefficients(self, length: Any) -> tuple[Any, Any]:
        """A(L) [m^2] and the second chamber's push B, negative [N]."""
        scale, zero = super().coefficients(length)
        return scale + self._insert, zero - self.push(self.extension_pressure)

    def volume(self, length: Any) -> Any:
        """Gas volume between rod and braid [m^3]."""
        return super().volume(length) - self._insert * length

    def volume_slope(self, length: Any) -> Any:
        """dV/dL [m^2]."""
        return super().volume_slope(length) - self._insert
