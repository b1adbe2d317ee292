"""The ideal cylinder: inextensible threads, no wall energy, equations (1), (2), (4)-(6), (23).

Source: equations (1)-(6) of "A Review of Design and Modeling of Pneumatic Artificial Muscle";
derived from virtual work, F = -P dV/dL.
Erratum: (1) is printed with D, "diameter of the sheath"; it holds only for D90 = b/(n pi), the
diameter the braid would have at a thread angle of 90 degrees.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from pam_model.muscles.braid import ThinCylinder
from pam_model.muscles.force_model import ModelParameter, register


@register(equations="(1)-(2), (4)-(6), (23)", status="derived", summary="ideal cylindrical braid")
class Gaylord(ThinCylinder):
    """Ideal cylinder: F = P (3 L^2 - b^2)/(4 pi n^2), K = 3 P L/(2 pi n^2), affine with B = 0."""

    name: ClassVar[str] = "gaylord"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {}
