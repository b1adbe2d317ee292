"""A force model with the numbers of an example, to be drawn or tried."""

from __future__ import annotations

from pam_model.errors import DomainError, PamError
from pam_model.identify.show import CONTRACTOR, EXTENSOR
from pam_model.muscles.force_model import (
    ForceModel,
    MuscleGeometry,
    create_force_model,
)

_EXTENDING = ("al_ibadi", "variable_thread_angle")
_CONSTANTS: dict[str, dict[str, float]] = {
    "tondu_lopez": {"k": 1.2},
    "al_fahaam": {"extensor_pressure": 1e5},
}
"""Constants for drawing a model whose defaults make it equal to the ideal braid."""


def default_model(name: str) -> tuple[ForceModel, MuscleGeometry]:
    """A force model to draw: on the contractor or, if the model refuses it, on the extensor.

    Raises
    ------
    PamError
        If the model refuses both.
    """
    refused = ""
    for geometry in (EXTENSOR, CONTRACTOR) if name in _EXTENDING else (CONTRACTOR, EXTENSOR):
        try:
            return create_force_model(name, geometry, _CONSTANTS.get(name)), geometry
        except DomainError as error:
            refused = str(error)
    raise PamError(f"model {name} cannot be drawn with default constants: {refused}")
