"""Runs the code of a notebook as Jupyter does, without Jupyter."""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from .source_tree import ROOT

NOTEBOOKS = sorted((ROOT / "examples/notebooks").glob("*.ipynb"))


def code_cells(document: dict[str, Any]) -> list[dict[str, Any]]:
    """The cells with code, in order."""
    return [cell for cell in document["cells"] if cell["cell_type"] == "code"]


def shown(value: Any) -> dict[str, Any]:
    """What a notebook shows of the last value of a cell, by its MIME type."""
    if isinstance(value, Figure):
        picture = io.BytesIO()
        value.savefig(picture, format="png", dpi=80)
        return {"image/png": base64.b64encode(picture.getvalue()).decode()}
    as_html = getattr(value, "_repr_html_", None)
    if as_html is not None:
        return {"text/html": as_html()}
    return {"text/plain": repr(value)}


def run_notebook(path: Path) -> dict[str, Any]:
    """The notebook with the outputs of its cells; an exception of a cell is passed on."""
    mpl.use("Agg")
    document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    names: dict[str, Any] = {"__name__": "__main__"}
    for count, cell in enumerate(code_cells(document), 1):
        tree = ast.parse("".join(cell["source"]), f"{path.name}, cell {count}")
        last = None
        if isinstance(tree.body[-1], ast.Expr):  # its value is shown, unless it is None
            last = ast.Expression(tree.body[-1].value)
            tree.body.pop()
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            exec(compile(tree, path.name, "exec"), names)
            value = None if last is None else eval(compile(last, path.name, "eval"), names)
        cell["execution_count"], cell["outputs"] = count, []
        if said.getvalue():
            text = said.getvalue().splitlines(keepends=True)
            cell["outputs"].append({"output_type": "stream", "name": "stdout", "text": text})
        if value is not None:
            cell["outputs"].append(
                {"output_type": "execute_result", "execution_count": count, "metadata": {},
                 "data": shown(value)}
            )  # fmt: skip
    return document
