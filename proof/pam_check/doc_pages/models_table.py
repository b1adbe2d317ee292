"""The models of docs/models.md, generated from the catalogue, and their pictures."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

from pam_check.doc_pages.model_pictures import PICTURES
from pam_model.catalogue.catalogue import FAMILIES, CatalogueRow, catalogue
from pam_model.catalogue.default_model import default_model
from pam_model.errors import PamError
from pam_model.identify.show import draw_force_model, save_figure
from pam_model.muscles.force_model import create_force_model, registered_models

_DOTS_PER_INCH = 72
_COLOURS = 64


def draw_row(row: CatalogueRow) -> Figure:
    """The picture of a row.

    Raises
    ------
    PamError
        If there is none.
    """
    if row.key in PICTURES:
        return PICTURES[row.key]()
    for name in row.models:
        if name in registered_models():
            model, geometry = default_model(name)
            ideal = create_force_model("gaylord", geometry)
            title = f"{name} (dotted: ideal braid)" if name != "gaylord" else name
            return draw_force_model(model, geometry.rest_length, title=title, reference=ideal)
    raise PamError(f"{row.key} has no picture")


def draw_models(folder: Path) -> None:
    """Write the picture of every row."""
    for row in catalogue():
        path = folder / f"{row.key}.png"
        save_figure(draw_row(row), path, _DOTS_PER_INCH)
        _shrink(path)


def models_table() -> str:
    """Every row of the catalogue, by family."""
    parts = []
    rows = catalogue()
    for family in FAMILIES:
        of_family = [row for row in rows if row.family == family]
        if not of_family:
            continue
        parts.append(f"## {family.capitalize()}\n")
        for row in of_family:
            names = ", ".join(f"`{name}`" for name in row.models if name in registered_models())
            code = ", ".join(f"`{path.replace(':', '.')}`" for path in row.objects)
            what = "; ".join(part for part in (f"model {names}" if names else "", code) if part)
            parts.append(
                f"### {row.title}\n\n"
                f"Equations {row.equations or '-'}, {row.status}; {what}.\n\n"
                f"| | |\n|---|---|\n"
                f"| domain | {row.domain} |\n| suited for | {row.use} |\n"
                f"| not suited for | {row.avoid} |\n\n"
                f"![{row.title}](gallery/{row.key}.png)\n"
            )
    return "\n".join(parts).rstrip()


def _shrink(path: Path) -> None:
    """Reduce the colours of a picture: a fifth of the file size, without a visible difference."""
    with Image.open(path) as image:
        small = image.convert("RGB").quantize(_COLOURS)
    small.save(path, optimize=True)
