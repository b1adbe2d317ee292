"""Sections of the parameter files of a process, and which of them are not for its node.

ROS applies a section by the full name of a node, with its namespace, and ignores every other
section silently. Whoever writes `pam_controller:` for a node that runs as `/left/pam_controller`,
or `pam_controler:`, drives the robot with the defaults. Such a section is refused here. Sections
that clearly belong to other nodes are ignored.
"""

from __future__ import annotations

import difflib
import re
import sys
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import yaml

from pam_ros.errors import ParameterError
from pam_ros.foreign_text import shown

ALIKE: Final = 0.8
"""Similarity from which two names count as one name with a slip."""
_LARGEST: Final = 1 << 20  # bytes of a file that are searched for sections
_DEEPEST: Final = 16  # levels of namespaces
_ANY: Final = ("*", "**")
_given: list[str] = []


@dataclass(frozen=True, slots=True)
class FileSection:
    """One section of a parameter file."""

    file: Path  # the file
    line: int  # where its name stands, counted from 1
    name: str  # the name of the node as written, with namespaces, such as "/**/pam_controller"
    doubled: tuple[tuple[int, str], ...] = ()  # keys that appear twice in it, with their lines

    @property
    def parts(self) -> list[str]:
        """Namespaces and name."""
        return [part for part in self.name.split("/") if part]

    def fits(self, node: str) -> bool:
        """Whether ROS applies the section to the node with this full name."""
        pattern = "".join(
            r"(/\w+)*" if part == "**" else r"/\w+" if part == "*" else "/" + re.escape(part)
            for part in self.parts
        )
        return re.fullmatch(pattern, node) is not None

    def __str__(self) -> str:
        """File, line and name for a message."""
        return f"{self.file}, line {self.line}: the section {shown(self.name)}"


def remember_arguments(words: Sequence[str]) -> None:
    """Take the command line with which ROS was initialised in this process."""
    _given[:] = words


def given_files() -> list[Path]:
    """The parameter files of this process, in their order."""
    words = _given or sys.argv
    return [Path(after) for word, after in pairwise(words) if word == "--params-file"]


def sections_of(file: Path) -> list[FileSection]:
    """The sections of a file; none of a file that ROS cannot read either."""
    try:
        with file.open("rb") as stream:
            tree = yaml.compose(stream.read(_LARGEST), yaml.SafeLoader)
    except (OSError, ValueError, RecursionError, yaml.YAMLError):
        return []
    return _found(file, tree, "", 0)


def _found(file: Path, tree: Any, before: str, depth: int) -> list[FileSection]:
    if not isinstance(tree, yaml.MappingNode) or depth > _DEEPEST:
        return []
    sections = []
    for key, below in tree.value:
        if not isinstance(key, yaml.ScalarNode) or not isinstance(below, yaml.MappingNode):
            continue
        name = f"{before}/{key.value.strip('/')}" if before else key.value
        within = [v for k, v in below.value if getattr(k, "value", "") == "ros__parameters"]
        if within:
            doubled = tuple(each for tree in within for each in _doubled(tree, "", 0))
            sections.append(FileSection(file, key.start_mark.line + 1, name, doubled))
        else:
            sections += _found(file, below, name, depth + 1)
    return sections


def _doubled(tree: Any, before: str, depth: int) -> Iterator[tuple[int, str]]:
    """Keys that appear twice in one mapping, each with its line."""
    if not isinstance(tree, yaml.MappingNode) or depth > _DEEPEST:
        return
    seen = set()
    for key, below in tree.value:
        name = f"{before}{getattr(key, 'value', '')}"
        if name in seen:
            yield key.start_mark.line + 1, name
        seen.add(name)
        yield from _doubled(below, f"{name}.", depth + 1)


def refuse_doubled_keys(node: str, files: Collection[Path]) -> None:
    """Refuse a parameter that a file states twice, of which ROS takes the last one.

    Parameters
    ----------
    node : str
        Full name of the node, with its namespace.
    files : collection of Path
        Parameter files of the process.

    Raises
    ------
    ParameterError
        For a key that appears twice in a section that ROS applies to the node.
    """
    for file in files:
        for section in sections_of(file):
            for line, name in section.doubled if section.fits(node) else ():
                raise ParameterError(
                    f"{file}, line {line}: {shown(name)} appears twice; ROS would take the last "
                    "one silently"
                )


def refuse_lost_sections(node: str, usual_name: str, files: Collection[Path]) -> list[str]:
    """Refuse a section that was meant for a node and that ROS does not apply to it.

    A file that names this very node in another section is not judged: it describes several nodes.

    Parameters
    ----------
    node : str
        Full name of the node, with its namespace.
    usual_name : str
        The name that the node has unless it is renamed.
    files : collection of Path
        Parameter files of the process.

    Returns
    -------
    list of str
        Warnings: sections for a node of this name in another namespace.

    Raises
    ------
    ParameterError
        For a section without a namespace that has the name of this node, and for one whose name or
        namespace has a slip. The text names the line to write.
    """
    warnings = []
    for file in files:
        sections = sections_of(file)
        if any(each.fits(node) and each.parts[-1] not in _ANY for each in sections if each.parts):
            continue
        for section in sections:
            if section.fits(node) or not section.parts or section.parts[-1] in _ANY:
                continue
            *spaces, name = section.parts
            mine = [part for part in node.split("/") if part]
            if name in (mine[-1], usual_name) and not spaces:
                problem = f"is for the node /{name}"
            elif any(_one_slip(section.parts, [*mine[:-1], own]) for own in (mine[-1], usual_name)):
                problem = "resembles the name of this node"
            elif name == mine[-1]:
                warnings.append(f"{section} is not applied, because this node is {node}")
                continue
            else:
                continue
            raise ParameterError(
                f"{section} {problem}, and this node is {node}: ROS would ignore the section "
                f"silently. Write /**/{mine[-1]}: in its place, which fits in every namespace"
            )
    return warnings


def _one_slip(parts: Sequence[str], mine: Sequence[str]) -> bool:
    """Whether a name, with or without its namespaces, differs from mine by one slip."""
    named = [part for part in parts if part not in _ANY]
    if len(named) < len(mine):
        mine = mine[-len(named) :]  # the namespace is left out or a wildcard
    if len(named) != len(mine):
        return False
    differing = [pair for pair in zip(named, mine, strict=True) if pair[0] != pair[1]]
    return len(differing) == 1 and _alike(*differing[0])


def _alike(name: str, mine: str) -> bool:
    """Whether a name is probably another one with a slip.

    Names that differ by a number or by one part more, as arm1 and arm2, are different on purpose,
    and so are names of other families, as arm_controller and pam_controller.
    """
    name, mine = name.lower().replace("-", "_"), mine.lower()
    if name != mine and re.sub(r"\d+", "", name) == re.sub(r"\d+", "", mine):
        return False
    other_family = "_" in mine and name.split("_")[0] != mine.split("_")[0]
    if other_family or name.startswith(f"{mine}_"):
        return False
    return difflib.SequenceMatcher(None, name, mine).ratio() >= ALIKE
