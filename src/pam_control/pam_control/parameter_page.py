"""The controller's parameters as a parameter file with comments, and as a table for the docs.

Both are made from the declarations, with those of installed control laws. `config/controller.yaml`
and the table in docs/controller.md are made by `pam control parameters --write FOLDER`.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Final

from pam_control.declared import Declared, Value
from pam_control.node_parameters import declared_parameters
from pam_model.errors import PamError

WIDTH: Final = 100
EACH_JOINT: Final = "<joint>"
OF_HOST: Final = ("loop.realtime_priority", "loop.align", "loop.command_delay")
"""Set for a host, often on the command line; a section of a file would have precedence over it."""
PAGE: Final = Path("docs/controller.md")
FILE: Final = Path("config/controller.yaml")
_PLACE: Final = re.compile(
    r"(?P<begin><!-- parameters -->\n).*?(?P<end><!-- end of parameters -->)", re.DOTALL
)
_HEAD: Final = """\
# The controller's parameters with their defaults; give it to the node together with a rig file.
# Made by `./pam control parameters`. Changeable while running (ros2 param set /pam_controller ...),
# unless marked "start".
/**/pam_controller:
  ros__parameters:
"""


def _text(value: Value) -> str:
    """A value in YAML."""
    if isinstance(value, bool):
        return str(value).lower()
    return '""' if value == "" else str(value)


def _lines(parameters: Sequence[Declared], depth: int, indent: str) -> Iterator[str]:
    """The lines of parameters whose names agree in their first `depth` parts."""
    for part, members in groupby(parameters, lambda each: each.key.split(".")[depth]):
        group = list(members)
        first = group[0]
        if first.key.count(".") == depth:
            unit = f"{first.unit}, " if first.unit != "-" else ""
            start = "start; " if first.fixed else ""
            width = WIDTH - len(indent) - 2
            for line in textwrap.wrap(f"{unit}{start}{first.description}", width):
                yield f"{indent}# {line}"
            off = "# " if first.key in OF_HOST else ""
            yield f"{indent}{off}{part}: {_text(first.default)}"
        else:
            yield f"{indent}{part}:"
            yield from _lines(group, depth + 1, indent + "  ")


def yaml_text() -> str:
    """A parameter file with all defaults; the parameters of single joints are comments."""
    parameters = declared_parameters((EACH_JOINT,))
    common = [each for each in parameters if EACH_JOINT not in each.key]
    single = [each for each in parameters if EACH_JOINT in each.key]
    lines = list(_lines(common, 0, "    "))
    lines += ["    # Of single joints, by name; those of one group belong together:"]
    lines += [f"    # {line}" for line in _lines(single, 0, "")]
    return _HEAD + "\n".join(lines) + "\n"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def table() -> str:
    """All parameters as a table in Markdown."""
    lines = ["| parameter | default | unit; from, to | meaning |", "|---|---|---|---|"]
    for each in declared_parameters((EACH_JOINT,)):
        is_number = type(each.default) in (int, float)
        bounds = f"{each.unit}; {each.low:g}, {each.high:g}" if is_number else each.unit
        start = "read at the start: " if each.fixed else ""
        cells = (
            f"`{each.key}`",
            f"`{_text(each.default)}`",
            bounds,
            start + each.description.replace(EACH_JOINT, "a joint"),
        )
        lines.append("| " + " | ".join(map(_cell, cells)) + " |")
    return "\n".join(lines) + "\n"


def with_table(page: str) -> str:
    """The text of a page with an updated table.

    Raises
    ------
    PamError
        If it has no place for the table.
    """
    if not _PLACE.search(page):
        raise PamError("the page contains no table of parameters")
    return _PLACE.sub(lambda found: f"{found['begin']}\n{table()}\n{found['end']}", page)


def write_pages(folder: Path) -> list[Path]:
    """Update parameter file and page in a clone of this project.

    Parameters
    ----------
    folder : Path
        The clone.

    Returns
    -------
    list of Path
        The files that changed.

    Raises
    ------
    PamError
        If a file does not exist or has no place for the table.
    """
    changed = []
    for name in (FILE, PAGE):
        path = folder / name
        if not path.is_file():
            raise PamError(f"{path}: no such file")
        old = path.read_text(encoding="utf-8")
        new = yaml_text() if name == FILE else with_table(old)
        if new != old:
            path.write_text(new, encoding="utf-8")
            changed.append(path)
    return changed
