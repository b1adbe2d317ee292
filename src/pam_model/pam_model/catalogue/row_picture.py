"""Draws a row of the catalogue."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pam_model.catalogue.catalogue import CatalogueRow
from pam_model.errors import DomainError, PamError
from pam_model.identify.show import CONTRACTOR, EXTENSOR, draw_force_model
from pam_model.muscles.force_model import (
    ForceModel,
    MuscleGeometry,
    create_force_model,
    registered_models,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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


def draw_row(row: CatalogueRow) -> Figure:
    """The picture of a row.

    Raises
    ------
    PamError
        If there is none.
    """
    from pam_model.catalogue.pictures import PICTURES  # noqa: PLC0415  (loads every model)

    if row.key in PICTURES:
        return PICTURES[row.key]()
    for name in row.models:
        if name in registered_models():
            model, geometry = default_model(name)
            ideal = create_force_model("gaylord", geometry)
            title = f"{name} (dotted: ideal braid)" if name != "gaylord" else name
            return draw_force_model(model, geometry.rest_length, title=title, reference=ideal)
    raise PamError(f"{row.key} has no picture")
