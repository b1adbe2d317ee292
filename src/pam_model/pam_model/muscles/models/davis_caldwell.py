"""The ideal cylinder between the lengths at which its strands jam: (1), (15)-(19).

Source: equations (15)-(19) of "A Review of Design and Modeling of Pneumatic Artificial Muscle",
after Davis and Caldwell; errata in `pam_model.muscles.braid_limits`. Between the limits the force
is that of the ideal cylinder, with D90 in (1).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from pam_model.muscles.braid import ThinCylinder, diameter_at_90_degrees, require_length
from pam_model.muscles.braid_limits import BraidLimits
from pam_model.muscles.force_model import ModelParameter, register


@register(
    equations="(15)-(19)",
    status="derived",
    summary="ideal cylinder between the lengths at which the braid's strands jam",
    row="braid_limits",
)
class DavisCaldwell(ThinCylinder):
    """The ideal cylinder, valid only between the jam limits of its strands.

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].
    strand_width : float
        D_s [m].
    strands : float
        N, strands of both families [-].

    Raises
    ------
    DomainError
        For b or n not above zero, or a braid that cannot exist; by the methods for a length at
        which it is jammed.
    """

    name: ClassVar[str] = "davis_caldwell"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        "strand_width": ModelParameter(2e-4, "m", 1e-6, 0.02, "width D_s of a strand or bundle"),
        "strands": ModelParameter(96.0, "-", 2.0, 10000.0, "number of strands, both families"),
    }

    def __init__(
        self, thread_length: float, turns: float, strand_width: float, strands: float
    ) -> None:
        super().__init__(thread_length, turns)
        diameter = diameter_at_90_degrees(thread_length, turns)
        self.limits = BraidLimits(strand_width, strands, diameter, thread_length)

    @property
    def length_bounds(self) -> tuple[float, float]:
        """Lengths between the two jam limits: b cos(lock angle) and b cos of (18) [m]."""
        return self.limits.shortest_length, self.limits.longest_length

    def _check(self, length: Any) -> Any:
        low, high = self.length_bounds
        return require_length(length, low, high, "where the braid's strands jam")
