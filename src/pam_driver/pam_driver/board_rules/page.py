"""The result of the conformance test as a page, and as text for a terminal."""

from __future__ import annotations

import html
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from pam_driver.board_rules.rule import RuleResult, RuleVerdict

HEADINGS: Final = ("verdict", "rule", "what the board must do", "what was sent", "what came back")
_COLOURS: Final = {
    RuleVerdict.PASS: "#d9f2d9",
    RuleVerdict.FAIL: "#f7caca",
    RuleVerdict.NOT_TRIED: "#eeeeee",
}


def summary(results: Sequence[RuleResult]) -> str:
    """The counts in one line."""
    counts = Counter(result.verdict for result in results)
    return (
        f"{len(results)} rules: {counts[RuleVerdict.PASS]} pass, {counts[RuleVerdict.FAIL]} fail, "
        f"{counts[RuleVerdict.NOT_TRIED]} not tried"
    )


def as_text(result: RuleResult) -> str:
    """One rule for the terminal; a failed one with the requirement and where to look."""
    rule = result.rule
    text = f"{result.verdict.value:9}  {rule.name}: {result.came_back}"
    if result.verdict is RuleVerdict.FAIL:
        indent = "\n" + 11 * " "
        text += f"{indent}must: {rule.requirement}{indent}sent: {rule.sent}"
        text += f"{indent}hint: {rule.hint} (rule {rule.section})"
    return text


def write_page(path: Path, title: str, results: Sequence[RuleResult]) -> None:
    """Write the page as HTML, or as Markdown if the file is called .md.

    Parameters
    ----------
    path : Path
        The file; its folder is made.
    title : str
        Which board on which bus, and when.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    as_page = _as_markdown if path.suffix == ".md" else _as_html
    path.write_text(as_page(title, results), encoding="utf-8")


def _cells(result: RuleResult) -> tuple[str, ...]:
    rule = result.rule
    came = result.came_back
    if result.verdict is RuleVerdict.FAIL:
        came += f". Hint: {rule.hint}"
    name = f"{rule.name} (rule {rule.section})"
    return result.verdict.value, name, rule.requirement, rule.sent, came


def _as_markdown(title: str, results: Sequence[RuleResult]) -> str:
    lines = [f"# {title}", "", f"{summary(results)}.", "", "| " + " | ".join(HEADINGS) + " |"]
    lines.append("|---" * len(HEADINGS) + "|")
    for result in results:
        cells = (cell.replace("|", "\\|") for cell in _cells(result))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _as_html(title: str, results: Sequence[RuleResult]) -> str:
    rows = "".join(
        f"<tr style='background:{_COLOURS[result.verdict]}'>"
        + "".join(f"<td>{html.escape(cell)}</td>" for cell in _cells(result))
        + "</tr>\n"
        for result in results
    )
    heads = "".join(f"<th>{html.escape(head)}</th>" for head in HEADINGS)
    return (
        "<!doctype html><html lang='en'><meta charset='utf-8'>"
        f"<title>{html.escape(title)}</title>"
        "<style>body{font:14px sans-serif;margin:2em}td,th{padding:.3em .6em;text-align:left;"
        "vertical-align:top;border-bottom:1px solid #ccc}</style>"
        f"<h1>{html.escape(title)}</h1><p>{html.escape(summary(results))}.</p>"
        f"<table><tr>{heads}</tr>\n{rows}</table></html>\n"
    )
