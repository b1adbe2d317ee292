"""The notebooks run, show what they have stored, and are on the pages."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pam_model.plant.compiled import HAVE_NUMBA
from support.notebooks import NOTEBOOKS, code_cells, run_notebook
from support.source_tree import ROOT

SIMULATION, VERDICT = (
    ROOT / f"examples/notebooks/from_a_{name}.ipynb"
    for name in ("rig_to_a_simulation", "log_to_a_verdict")
)


@pytest.fixture
def at_home(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


def kinds(document: dict) -> list[list[str]]:
    """Of each cell, which kinds of output it has."""
    return [
        [kind for output in cell["outputs"] for kind in output.get("data", {output["output_type"]})]
        for cell in code_cells(document)
    ]


def texts(document: dict) -> str:
    return json.dumps([cell["outputs"] for cell in code_cells(document)])


def check(path: Path) -> str:
    stored = json.loads(path.read_text())
    found = run_notebook(path)
    assert kinds(found) == kinds(stored), "run tools/run_notebooks.py"
    assert any(kinds(found))
    return texts(found)


def test_every_notebook_is_tested_here_and_on_the_page() -> None:
    assert {*NOTEBOOKS} == {SIMULATION, VERDICT}
    page = (ROOT / "docs/python.md").read_text()
    for path in NOTEBOOKS:
        assert f"examples/notebooks/{path.name})" in page


@pytest.mark.usefixtures("at_home")
def test_from_a_rig_to_a_simulation() -> None:
    said = check(SIMULATION)
    assert "N m/rad" in said
    assert "image/png" in said


@pytest.mark.long("test_diagnosis finds the same friction through the same functions")
@pytest.mark.skipif(not HAVE_NUMBA, reason="a whole search needs the compiled plant")
@pytest.mark.usefixtures("at_home")
def test_from_a_log_to_a_verdict() -> None:
    said = check(VERDICT)
    assert "Coulomb friction" in said
    assert "text/html" in said
