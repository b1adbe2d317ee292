"""The tables of effects in the pages of docs/, generated from the registry.

A page holds a table between two comments; `pam model effect-tables` rewrites it:

    <!-- effects: muscle -->
    <!-- end of effects -->

The kinds of table `muscle`, `joint` and `rig` list the keys that a rig file may have at that place.
`control` and `plausibility` describe what controller and plausibility check do about each effect.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from pam_model.effects import EFFECTS, Effect, EffectParameter
from pam_model.errors import PamError

PAGES: Final = ("rig_file.md", "controller.md")
"""Pages of docs/ that hold tables of effects."""
_PLACE: Final = re.compile(
    r"(?P<begin><!-- effects: (?P<kind>\w+) -->\n).*?(?P<end><!-- end of effects -->)", re.DOTALL
)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _row(*cells: str) -> str:
    return "| " + " | ".join(_cell(cell) for cell in cells) + " |"


def _parameter(key: str, entry: EffectParameter) -> str:
    numbers = f"{entry.unit}, {entry.neutral:g}, {entry.low:g}, {entry.high:g}"
    return f"`{key}` ({entry.symbol}): {numbers}; {entry.description}"


def _keys(effect: Effect) -> str:
    parameters = "<br>".join(_parameter(key, entry) for key, entry in effect.parameters.items())
    law = f"{effect.description}: {effect.law}"
    return _row(f"`{effect.name}`", effect.stage, law, parameters)


def table(kind: str) -> str:
    """One table in Markdown.

    Parameters
    ----------
    kind : str
        "muscle", "joint", "rig", "control" or "plausibility".

    Raises
    ------
    PamError
        If the kind is unknown.
    """
    if kind == "control":
        lines = [_row("effect", "what the controller does"), "|---|---|"]
        lines += [_row(f"`{e.name}`", e.control.how) for e in EFFECTS.values()]
    elif kind == "plausibility":
        lines = [_row("effect", "what the plausibility check does"), "|---|---|"]
        lines += [_row(f"`{e.name}`", e.plausibility.how) for e in EFFECTS.values()]
    elif kind in ("muscle", "joint", "rig"):
        head = _row("effect", "stage", "what it is", "parameters: unit, neutral, from, to; meaning")
        lines = [head, "|---|---|---|---|"]
        lines += [_keys(effect) for effect in EFFECTS.values() if effect.scope == kind]
    else:
        raise PamError(f"unknown table of effects {kind!r}")
    return "\n".join(lines) + "\n"


def with_tables(page: str) -> str:
    """The text of a page with updated tables of effects.

    Raises
    ------
    PamError
        If a table has an unknown kind.
    """
    return _PLACE.sub(
        lambda found: found["begin"] + "\n" + table(found["kind"]) + "\n" + found["end"], page
    )


def write_tables(folder: Path) -> list[Path]:
    """Update the tables in the pages of a docs folder.

    Parameters
    ----------
    folder : Path
        Folder with the PAGES.

    Returns
    -------
    list of Path
        The pages that changed.

    Raises
    ------
    PamError
        If a page does not exist or holds no table.
    """
    changed = []
    for name in PAGES:
        path = folder / name
        if not path.is_file():
            raise PamError(f"{path}: no such page")
        old = path.read_text(encoding="utf-8")
        if not _PLACE.search(old):
            raise PamError(f"{path}: contains no table of effects")
        new = with_tables(old)
        if new != old:
            path.write_text(new, encoding="utf-8")
            changed.append(path)
    return changed
