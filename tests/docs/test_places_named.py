"""The page of the architecture answers where things are: every place that it names exists."""

from __future__ import annotations

import re

import pytest

from support.source_tree import ROOT

PAGE = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
FOLDERS = ("src", "proof", "tests", "benchmarks", "tools", "config")
FILES = FOLDERS + tuple(
    path.relative_to(ROOT).as_posix()
    for folder in FOLDERS
    for path in (ROOT / folder).rglob("*")
    if "__pycache__" not in path.parts
)
NAMED = sorted(set(re.findall(r"`((?:[\w.]+/)+[\w.]*|\w+\.py|pam_\w+(?:\.\w+)+)`", PAGE)))


def exists(place: str) -> bool:
    """Whether a path, the end of one, or a dotted name of a module or of what is in it, exists."""
    ends = [place.rstrip("/")]
    if "/" not in place and not place.endswith(".py"):
        module = place.replace(".", "/")
        around = module.rpartition("/")[0]
        ends = [module, f"{module}.py", around, f"{around}.py"]
    return any(f"/{file}".endswith(f"/{end}") for end in ends for file in FILES)


@pytest.mark.parametrize("place", NAMED)
def test_a_place_that_the_page_names_exists(place: str) -> None:
    assert exists(place), f"docs/architecture.md names {place}, which does not exist"


def test_a_place_that_does_not_exist_would_be_found() -> None:
    assert len(NAMED) > 80 and not any(
        map(exists, ("pam_model/plant/lever_arm.py", "lever_arm.py"))
    )
