"""Cylinder with conical ends: equations (20)-(22), after Doumit and Fahim.

Source: equations (20)-(22) of "A Review of Design and Modeling of Pneumatic Artificial Muscle";
geometry correct as printed; b in (20) belongs to the cylindrical part, in (23) to the whole
muscle. The published model balances forces in the threads and bladder, but the review does not
give this law; the force here is derived from virtual work instead, see
`pam_model.muscles.tapered_braid`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from pam_model.muscles.force_model import ModelParameter, MuscleGeometry, register
from pam_model.muscles.tapered_braid import END_PARAMETERS, TaperedBraid, cylindrical_part


@register(
    equations="(20)-(22)",
    status="derived",
    summary="braid that tapers to its fittings as cones of constant slant",
)
class DoumitFahim(TaperedBraid):
    """`TaperedBraid` as a registered model; lengths are those of the whole muscle."""

    name: ClassVar[str] = "doumit_fahim"
    parameters: ClassVar[Mapping[str, ModelParameter]] = END_PARAMETERS

    @classmethod
    def from_geometry(cls, geometry: MuscleGeometry, constants: Mapping[str, float]) -> DoumitFahim:
        """The model of a muscle in a rig file, with its thread divided into cylinder and cones."""
        thread, turns, _ = cylindrical_part(geometry, **constants)
        return cls(thread, turns, constants["cone_slant"], constants["fitting_diameter"])
