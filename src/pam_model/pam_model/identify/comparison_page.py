"""Write a comparison of models into a page of the documentation, between two markers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pam_model.errors import PamError

BEGIN = "<!-- comparison: written by the command above; do not edit -->"
END = "<!-- comparison: end -->"


def write_comparison(comparisons: Iterable[Mapping[str, Any]], page: str | Path) -> Path:
    """Put one table for each branch between the markers of a page.

    Parameters
    ----------
    comparisons : iterable of mapping
        As `Comparison.as_dict` gives them.
    page : str or Path
        A Markdown file with the lines `BEGIN` and `END`.

    Raises
    ------
    PamError
        For a page that cannot be read or written, or without the markers.
    """
    page = Path(page)
    try:
        text = page.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise PamError(f"{page}: cannot be read: {error}") from error
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise PamError(f"{page}: has no lines {BEGIN!r} and {END!r} to write between")
    tables = "\n".join(_table(comparison) for comparison in comparisons)
    try:
        page.write_text(f"{before}{BEGIN}\n\n{tables}\n{END}{after}", encoding="utf-8")
    except OSError as error:
        raise PamError(f"{page}: cannot be written: {error}") from error
    return page


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


def _table(comparison: Mapping[str, Any]) -> str:
    unit = "mm" if comparison["unit"] == "m" else comparison["unit"]
    title = (comparison["branch"] or comparison["data"]).capitalize()
    lines = [
        f"{title}, {comparison['points']} points:",
        "",
        f"| model | numbers fitted | training [{unit}] | held out [{unit}] | 95 % interval "
        f"[{unit}] | not distinguishable from the best |",
        "|---|---|---|---|---|---|",
    ]
    for model, cells in rows_of(comparison).items():
        lines.append(f"| `{model}` | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"
