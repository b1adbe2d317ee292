"""The packages as text: their modules, what these import, and the words in them."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
SOURCE = ROOT / "src"
PROOF = ROOT / "proof"
PACKAGES = tuple(sorted(path.parent.name for path in SOURCE.glob("*/package.xml")))
"""What a robot installs."""
ALL_PACKAGES = (*PACKAGES, "pam_check")
"""Those, and the checks in proof/, which nobody installs."""


def folder_of(package: str) -> Path:
    """The folder in which a package's own folder and its setup.py are."""
    return SOURCE / package if package in PACKAGES else PROOF


def python_files(package: str, *, launch_files: bool = True) -> Iterator[Path]:
    """Every Python file of a package; without setup.py, which only installs."""
    yield from sorted((folder_of(package) / package).rglob("*.py"))
    if launch_files:
        yield from sorted((folder_of(package) / "launch").glob("*.py"))


def module_name(path: Path) -> str:
    """The name a file is imported by, such as `pam_model.rig.file`."""
    inside = path.relative_to(ROOT).with_suffix("").parts
    parts = list(inside[2:] if inside[0] == "src" else inside[1:])
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def modules() -> dict[str, Path]:
    """Every module of ours and its file."""
    return {
        module_name(path): path
        for package in ALL_PACKAGES
        for path in python_files(package, launch_files=False)
    }


def syntax(path: Path) -> ast.Module:
    """The syntax tree of a file."""
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


@cache
def imported_names(path: Path) -> frozenset[str]:
    """First parts of what a file imports anywhere in it, such as `numpy`."""
    found: set[str] = set()
    for node in ast.walk(syntax(path)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
            found.add(node.module.split(".")[0])
    return frozenset(found)


def foreign_imports(package: str) -> dict[str, list[str]]:
    """What a package imports beside itself and Python's own library, and in which files."""
    found: dict[str, list[str]] = {}
    for path in python_files(package):
        for name in imported_names(path) - set(sys.stdlib_module_names) - {package}:
            found.setdefault(name, []).append(str(path.relative_to(ROOT)))
    return found
