"""The project's pages taken apart: code blocks, commands within sentences, links, headings."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")])

_FENCE = re.compile(r"^( *)```(\w*)\n(.*?)^\1```", re.MULTILINE | re.DOTALL)
_INLINE = re.compile(r"`([^`\n]+)`")
_LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
_COMMAND_START = re.compile(r"^(?:\w+=\S+ )*(?:\./pam |\S*python3? |ros2 |make |tools/\S+|colcon )")


@dataclass(frozen=True)
class Block:
    """One fenced code block.

    Attributes
    ----------
    language : str
        What stands behind the fence.
    text : str
        What is in it, without indentation.
    line : int
        Of the page, where it begins.
    """

    language: str
    text: str
    line: int


def blocks(text: str) -> Iterator[Block]:
    """Every fenced block of a page."""
    for found in _FENCE.finditer(text):
        indentation = len(found[1])
        lines = [line[indentation:] for line in found[3].splitlines()]
        yield Block(found[2], "\n".join(lines), text[: found.start()].count("\n") + 1)


def shell_lines(script: str) -> Iterator[str]:
    """The commands of a shell script: continued lines joined, comments and loops left out."""
    for line in re.sub(r"\\\n\s*", " ", script).splitlines():
        command = re.sub(r"(^|\s)#.*$", "", line).strip()
        command = re.sub(r"\s>+\s*\S+$", "", command)
        for part in re.split(r"\s+&&\s+", command):
            if part and not re.match(r"(for|do|done|if|then|fi)\b", part):
                yield part


def commands_in_sentences(text: str) -> Iterator[str]:
    """Commands in backquotes outside the fenced blocks."""
    for found in _INLINE.finditer(_FENCE.sub("", text)):
        if _COMMAND_START.match(found[1] + " "):
            yield found[1].replace("\\|", "|")


def commands_in_blocks(text: str) -> Iterator[str]:
    """Every command in the shell blocks of a page."""
    for block in blocks(text):
        if block.language == "bash":
            yield from shell_lines(block.text)


def links(text: str) -> Iterator[str]:
    """Targets of links and pictures that stay within the project."""
    for found in _LINK.finditer(_FENCE.sub("", text)):
        if "://" not in found[1]:
            yield found[1]


def anchors(text: str) -> set[str]:
    """What a link to a heading of this page may say, as GitHub makes it."""
    headings = re.findall(r"^#+ +(.+)$", _FENCE.sub("", text), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
