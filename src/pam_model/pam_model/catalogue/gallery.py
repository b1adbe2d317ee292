"""Draw every row of the catalogue and write the table of models into the documentation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pam_model.catalogue.catalogue import FAMILIES, CatalogueRow, catalogue
from pam_model.errors import DomainError, PamError
from pam_model.identify.show import CONTRACTOR, EXTENSOR, draw_force_model, save_figure
from pam_model.muscles.force_model import (
    ForceModel,
    MuscleGeometry,
    create_force_model,
    registered_models,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BEGIN = "<!-- models: written by `./pam model gallery`; edit the catalogue instead -->"
END = "<!-- models: end -->"
_EXTENDING = ("al_ibadi", "variable_thread_angle")
_CONSTANTS: dict[str, dict[str, float]] = {
    "tondu_lopez": {"k": 1.2},
    "al_fahaam": {"extensor_pressure": 1e5},
}
"""Constants for drawing a model whose defaults make it equal to the ideal braid."""
_DOTS_PER_INCH = 72
_COLOURS = 64


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


def write_gallery(folder: str | Path) -> list[Path]:
    """Write pictures to `folder`/gallery, and the rows between the markers of `folder`/models.md.

    Raises
    ------
    PamError
        For a file that cannot be written or a page without the markers.
    """
    folder = Path(folder)
    page = folder / "models.md"
    written = []
    rows = catalogue()
    for row in rows:
        path = folder / "gallery" / f"{row.key}.png"
        save_figure(draw_row(row), path, _DOTS_PER_INCH)
        _shrink(path)
        written.append(path)
    text = page.read_text(encoding="utf-8") if page.exists() else f"# Models\n\n{BEGIN}\n{END}\n"
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise PamError(f"{page}: has no lines {BEGIN!r} and {END!r} to write between")
    page.write_text(f"{before}{BEGIN}\n{_table(rows)}{END}{after}", encoding="utf-8")
    return [*written, page]


def _table(rows: list[CatalogueRow]) -> str:
    parts = []
    for family in FAMILIES:
        of_family = [row for row in rows if row.family == family]
        if not of_family:
            continue
        parts.append(f"\n## {family.capitalize()}\n")
        for row in of_family:
            names = ", ".join(f"`{name}`" for name in row.models if name in registered_models())
            code = ", ".join(f"`{path.replace(':', '.')}`" for path in row.objects)
            what = "; ".join(part for part in (f"model {names}" if names else "", code) if part)
            parts.append(
                f"\n### {row.title}\n\n"
                f"Equations {row.equations or '-'}, {row.status}; {what}.\n\n"
                f"| | |\n|---|---|\n"
                f"| domain | {row.domain} |\n| suited for | {row.use} |\n"
                f"| not suited for | {row.avoid} |\n\n"
                f"![{row.title}](gallery/{row.key}.png)\n"
            )
    return "".join(parts) + "\n"


def _shrink(path: Path) -> None:
    """Reduce the colours of a picture: a fifth of the file size, without a visible difference."""
    from PIL import Image  # noqa: PLC0415  (comes with matplotlib)

    with Image.open(path) as image:
        small = image.convert("RGB").quantize(_COLOURS)
    small.save(path, optimize=True)
