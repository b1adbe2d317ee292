"""Pages and messages use the field's terms (docs/glossary.md), not everyday verbs in their place.

Docstrings and comments are not checked: their reader has the code at hand.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from .pages import PAGES, ROOT

WORDS = {
    r"tells?|told|telling": "report, show, distinguish, command",
    r"hears?|heard|hearing": "receive, read",
    r"bears?|borne": "tolerate, withstand, carry",
    r"beside": "in addition to, together with, next to",
    r"com(?:es?|ing) of it|came of it": "follow from",
    r"anew": "again",
    r"nobody (?:foresaw|commanded|has stated|hears)": "unexpected, unstated, without subscriber",
}
"""What must not occur, as a pattern, and what is written in its place."""
_FOUND = re.compile(rf"\b(?:{'|'.join(WORDS)})\b", re.IGNORECASE)
_CODE = re.compile(r"^( *)```.*?^\1```|`[^`]*`|\]\([^)]*\)", re.MULTILINE | re.DOTALL)
SOURCES = sorted(
    path for path in (ROOT / "src").rglob("*.py") if "pam_check" not in path.relative_to(ROOT).parts
)
"""What a robot installs; the proof speaks to those who work on the suite."""


def _prose(page: str) -> str:
    return _CODE.sub("", page)


def _messages(source: str) -> Iterator[tuple[int, str]]:
    """Line and text of every string that is neither a docstring nor a single word."""
    tree = ast.parse(source)
    docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if not isinstance(node, ast.Constant) or id(node) in docs:
            continue
        if isinstance(node.value, str) and " " in node.value.strip():
            yield node.lineno, node.value


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_pages_use_the_terms_of_the_glossary(page: Path) -> None:
    assert _FOUND.findall(_prose(page.read_text(encoding="utf-8"))) == []


def test_messages_use_the_terms_of_the_glossary() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}: {word}"
        for path in SOURCES
        for line, text in _messages(path.read_text(encoding="utf-8"))
        for word in _FOUND.findall(text)
    ]
    assert found == []


@pytest.mark.parametrize(
    "sentence",
    [
        "Two repetitions that look opposite tell so.",
        "An error that is told.",
        "A node that hears people until it ends.",
        "More than the gains bear.",
        "Backlash beside hysteresis.",
        "What came of it.",
        "It is learnt anew.",
        "An opening that nobody commanded.",
    ],
)
def test_everyday_verbs_would_be_found(sentence: str) -> None:
    assert _FOUND.search(_prose(sentence))
