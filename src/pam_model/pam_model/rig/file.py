"""The rig file: one description of a robot for every node and tool.

It is a ROS 2 parameter file (`/**: ros__parameters:`); docs/rig_file.md describes its keys.
`load_rig` reads a file, `save_rig` writes one. `rig_from_parameters` and `rig_of_node` take the
parameters that a node got from `--params-file`.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Collection, Mapping, Sequence
from functools import reduce
from itertools import pairwise
from operator import getitem
from pathlib import Path
from typing import Any

import yaml

from pam_model.errors import PamError, RigError
from pam_model.plain_yaml import PlainLoader
from pam_model.rig.bus_keys import DEVICE_FILES
from pam_model.rig.effects_as_numbers import effects_as_numbers
from pam_model.rig.keys import BETWEEN
from pam_model.rig.parser import parse_rig, unflatten
from pam_model.rig.ros_yaml import refused_by_nodes
from pam_model.rig.types import Rig

MAX_FILE_SIZE = 1 << 20
"""Size limit of a rig file [bytes]."""


class _Loader(PlainLoader):
    """Plain YAML; `refused` has one line for everything that a node would refuse in the file."""

    def __init__(self, text: bytes) -> None:
        super().__init__(text)
        self.refused: list[str] = []

    def compose_node(self, parent: Any, index: Any) -> Any:
        node = super().compose_node(parent, index)
        if node is not None:
            self.refused += refused_by_nodes(node)
        return node


class _Dumper(yaml.SafeDumper):
    """Plain YAML without aliases, which `_Loader` refuses, for values that occur twice."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _read(path: Path) -> Any:
    try:
        with path.open("rb") as stream:
            text = stream.read(MAX_FILE_SIZE + 1)
    except OSError as error:
        raise RigError(f"{path}: cannot be read: {error.strerror or error}") from None
    if len(text) > MAX_FILE_SIZE:
        raise RigError(f"{path}: larger than {MAX_FILE_SIZE} bytes, too large for a rig file")
    try:
        loader = _Loader(text)
        tree = loader.get_single_data()
    except yaml.reader.ReaderError:
        raise RigError(f"{path}: not text in UTF-8; save it as UTF-8") from None
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError, ValueError) as error:
        raise RigError(f"{path}: not YAML: {_why_no_yaml(error)}") from None
    if loader.refused:
        raise RigError("\n".join(f"{path}: {line}" for line in loader.refused[:20]))
    return tree


def _why_no_yaml(error: Exception) -> str:
    """Line, column and cause of a mistake in the YAML, and what it usually is."""
    mark = getattr(error, "problem_mark", None)
    if mark is None:
        return " ".join(str(error).split()) or "nested too deeply"
    begun = getattr(error, "context_mark", None)
    inside = f", in what begins in line {begun.line + 1}" if begun else ""
    problem = " ".join(str(getattr(error, "problem", "") or error).split())
    if problem.startswith("but "):
        problem = f"{getattr(error, 'context', '')}, {problem}"
    if r"'\t'" in problem:
        remedy = "; a tab: use spaces to indent"
    elif "':'" in problem:
        remedy = "; a key needs a colon and a blank behind it, as in `inertia: 0.05`"
    elif "block" in problem or "mapping values" in problem:
        remedy = "; the keys of one section begin in the same column, further in than its name"
    else:
        remedy = ""
    return f"line {mark.line + 1}, column {mark.column + 1}{inside}: {problem}{remedy}"


def load_rig(path: str | Path, other_keys: Collection[str] = ()) -> Rig:
    """Read a rig file.

    Parameters
    ----------
    path : str or Path
        A ROS 2 parameter file; the rig is under `/**`, sections of other nodes are ignored.
    other_keys : collection of str, optional
        Keys under `/**` that belong to a node and not to the rig.

    Returns
    -------
    Rig
        Checked for names, units, bounds and wiring, and for muscle models that are valid over the
        whole range of their joint. Effects that only change written numbers are in these numbers.

    Raises
    ------
    RigError
        With one line for every problem: file, key, value, unit, what was expected.
    """
    path = Path(path)
    return rig_from_parameters(
        read_parameters(path), other_keys=other_keys, source=str(path), folders=(path.parent,)
    )


def read_parameters(path: Path) -> Mapping[str, Any]:
    """The content of `ros__parameters` of a rig file, which nothing has checked yet.

    Raises
    ------
    RigError
        For a file that cannot be read or is no rig file.
    """
    tree = _read(path)
    section = tree.get("/**") if isinstance(tree, Mapping) else None
    parameters = section.get("ros__parameters") if isinstance(section, Mapping) else None
    if not isinstance(parameters, Mapping):
        raise RigError(f"{path}: not a rig file; it must begin with /**: and ros__parameters:")
    return parameters


def rig_from_parameters(
    parameters: Mapping[str, Any],
    *,
    other_keys: Collection[str] = (),
    source: str = "parameters",
    folders: Sequence[Path] = (),
) -> Rig:
    """Create a rig from parameters with dotted keys, nested mappings or both.

    Parameters
    ----------
    parameters : mapping
        As under `ros__parameters`, or as a node's parameter overrides.
    other_keys : collection of str, optional
        Keys at the top that belong to a node and not to the rig.
    source : str, optional
        Name of the source in messages.
    folders : sequence of Path, optional
        Where a DBC file with a relative path is searched.

    Raises
    ------
    RigError
        With one line for every problem.
    """
    try:
        tree = unflatten(parameters)
    except RigError as error:
        raise RigError(f"{source}: {error}") from None
    written = parse_rig(tree, source, other_keys, folders)
    try:
        return effects_as_numbers(written)
    except RigError as error:
        raise RigError(f"{source}: {error}") from None


def rig_of_node(others: Mapping[str, Any], own_keys: Collection[str]) -> Rig:
    """Create a rig from the parameters with which a ROS node was started.

    Parameters
    ----------
    others : mapping
        The parameter overrides of the node, without the node's own parameters.
    own_keys : collection of str
        The node's own parameters, which the message about an unknown key may suggest.

    Raises
    ------
    PamError
        If they contain no rig, because the node was started without a rig file.
    RigError
        With one line for every problem of the rig, unknown keys included.
    """
    if "joints" not in others and "supply_pressure" not in others:
        raise PamError("no rig: start the node with --ros-args --params-file <rig file>")
    return rig_from_parameters(others, other_keys=own_keys, folders=_parameter_file_folders())


def _parameter_file_folders() -> list[Path]:
    """The folders of the files that this process got with `--params-file`."""
    words = sys.argv
    named = [Path(after) for word, after in pairwise(words) if word == "--params-file"]
    return [path.parent for path in reversed(named)]


def _commented(text: str, comments: Mapping[str, str]) -> str:
    """A dumped rig file with comments behind its keys."""
    path: list[str] = []
    lines = []
    for line in text.splitlines():
        name, colon, _ = line.strip().partition(":")
        comment = ""
        if colon and not name.startswith("-"):
            depth = (len(line) - len(line.lstrip())) // 2
            path[depth:] = [name]
            comment = comments.get(".".join(path[2:]), "")  # below /** and ros__parameters
        lines.append(f"{line}  # {' '.join(comment.split())}" if comment else line)
    return "\n".join(lines) + "\n"


def save_rig(
    rig: Rig,
    path: str | Path,
    notes: Sequence[str] = (),
    comments: Mapping[str, str] | None = None,
    left_open: Mapping[str, tuple[float, float] | None] | None = None,
) -> None:
    """Write a rig file that `load_rig` reads back to an equal rig, if nothing is left open.

    Parameters
    ----------
    rig : Rig
        What is written.
    path : str or Path
        The file.
    notes : sequence of str, optional
        Lines of comment at the beginning of the file, such as where its numbers come from.
    comments : mapping of str to str, optional
        Comments behind single numbers, by key, as `elbow.inertia`.
    left_open : mapping of str to (float, float) or None, optional
        Numbers that are written as a range, or are left out, by key; only `load_partial_rig` reads
        such a file.

    Raises
    ------
    RigError
        If the file cannot be written.
    """
    path = Path(path)
    tree = rig.to_parameters()
    for section in tree.get("boards", {}).values():
        for key in DEVICE_FILES:  # in the rig file's folder they stay named without it
            name = section.get(key)
            if isinstance(name, str) and Path(name).parent == path.parent.resolve():
                section[key] = Path(name).name
    for key, ends in (left_open or {}).items():
        *places, last = key.split(".")
        section = reduce(getitem, places, tree)
        section.pop(last, None)
        if ends is not None:
            section[last] = {BETWEEN: list(ends)}
    text = yaml.dump(
        {"/**": {"ros__parameters": tree}}, Dumper=_Dumper, sort_keys=False, allow_unicode=True
    )
    heading = "# Units: SI; pressures gauge unless named absolute. Keys: docs/rig_file.md\n"
    heading += "".join(f"# {' '.join(note.split())}\n" for note in notes)
    draft = path.with_name(path.name + ".part")
    try:
        with draft.open("w", encoding="utf-8") as file:
            file.write(heading + _commented(text, comments or {}))
            file.flush()
            os.fsync(file.fileno())  # the new content is on the disk before the old one goes
        draft.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            draft.unlink(missing_ok=True)
        raise RigError(f"{path}: cannot be written: {error.strerror or error}") from None
