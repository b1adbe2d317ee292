"""Tests that a page of the documentation names as evidence exist under that name."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
NAMED = re.compile(r"`(?:(?:[\w/]*/)?(test_\w+\.py))?::(test_\w+)`")
PAGES = {"canopen_standard.md": "test_canopen_conformance.py"}
"""With the file that is meant where the page names none."""


@pytest.mark.parametrize("page", PAGES)
def test_a_test_that_a_page_names_exists(page: str) -> None:
    files = {path.name: path.read_text() for path in (ROOT / "tests").rglob("test_*.py")}
    found = NAMED.findall((ROOT / "docs" / page).read_text())
    assert len(found) > 20
    missing = [
        f"{file}::{name}"
        for file, name in found
        if f"def {name}(" not in files[file or PAGES[page]]
    ]
    assert missing == []
