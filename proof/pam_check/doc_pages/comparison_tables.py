"""The comparison of models in docs/models.md."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from pam_check.doc_pages.markdown import table


def rows_of(comparison: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """For each model, the cells of its table row after the name."""
    scale = 1e3 if comparison["unit"] == "m" else 1.0
    best = comparison["ranking"][0]
    tied = {best["model"], *best["indistinguishable_from"]}
    return {
        row["model"]: (
            str(row["free_numbers"]),
            f"{scale * row['training_error']:.3g}",
            f"{scale * row['held_out_error']:.3g}",
            f"{scale * row['held_out_low']:.3g} to {scale * row['held_out_high']:.3g}",
            "yes" if row["model"] in tied else "",
        )
        for row in comparison["ranking"]
    }


def comparison_tables(comparisons: Iterable[Mapping[str, Any]]) -> str:
    """A table for each branch, of what `pam model compare --json` prints."""
    return "\n\n".join(map(_table, comparisons))


def _table(comparison: Mapping[str, Any]) -> str:
    unit = "mm" if comparison["unit"] == "m" else comparison["unit"]
    title = (comparison["branch"] or comparison["data"]).capitalize()
    head = (
        "model", "numbers fitted", f"training [{unit}]", f"held out [{unit}]",
        f"95 % interval [{unit}]", "not distinguishable from the best",
    )  # fmt: skip
    rows = [(f"`{model}`", *cells) for model, cells in rows_of(comparison).items()]
    return f"{title}, {comparison['points']} points:\n\n{table(head, rows)}"
