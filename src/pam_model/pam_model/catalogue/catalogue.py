"""Every model of the package in one table: description, code, domain, and when to use it.

Length-force models register themselves (`force_model.register`) with equation numbers and status;
a row here names them and adds the information that a reader needs to choose between them. Rows of
other kinds contain all their data. A registered model that no row names gets a row of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from pam_model.catalogue.other_rows import ROWS
from pam_model.catalogue.types import FAMILIES, CatalogueRow
from pam_model.errors import PamError
from pam_model.muscles.force_model import RegisteredModel, registered_models

__all__ = ["FAMILIES", "CatalogueRow", "catalogue", "find_row"]


def catalogue() -> list[CatalogueRow]:
    """All rows in the order of the families, with equations and status from the register."""
    models = registered_models()
    named = {name for row in ROWS for name in row.models}
    rows = [_completed(row, models) for row in ROWS]
    for name, entry in models.items():
        if name not in named:
            rows.append(
                CatalogueRow(
                    name,
                    "contraction and extension",
                    entry.summary,
                    equations=entry.equations,
                    status=entry.status,
                    models=(name,),
                )
            )
    return sorted(rows, key=lambda row: FAMILIES.index(row.family))


def _completed(row: CatalogueRow, models: Mapping[str, RegisteredModel]) -> CatalogueRow:
    entries = [models[name] for name in row.models if name in models]
    if not entries:
        return row
    equations = dict.fromkeys(e.equations for e in entries if e.equations not in ("", "-"))
    status = dict.fromkeys(e.status for e in entries)
    return replace(
        row,
        equations=row.equations or ", ".join(equations) or "-",
        status=row.status or ", ".join(status),
    )


def find_row(key: str) -> CatalogueRow:
    """The row that has this key or names this model.

    Raises
    ------
    PamError
        For a name that is neither a key nor a model.
    """
    rows = catalogue()
    for row in rows:
        if key == row.key or key in row.models:
            return row
    raise PamError(f"unknown model {key!r}; known: {', '.join(dict.fromkeys(_names(rows)))}")


def _names(rows: list[CatalogueRow]) -> list[str]:
    return [name for row in rows for name in (row.key, *row.models)]
