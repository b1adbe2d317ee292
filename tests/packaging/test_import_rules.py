"""Imports run downhill only, ROS stays in the nodes, nothing is imported by a name in a string.

The rules are contracts of import-linter in pyproject.toml; `make lint` checks them as well.
"""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from support.source_tree import (
    ALL_PACKAGES,
    PACKAGES,
    PROOF,
    ROOT,
    SOURCE,
    folder_of,
    modules,
    syntax,
)

Plant = Callable[[str, str], None]


def lint(root: Path) -> subprocess.CompletedProcess[str]:
    """import-linter on the packages in a tree."""
    path = os.pathsep.join(str(root / folder_of(name).relative_to(ROOT)) for name in ALL_PACKAGES)
    command = "import sys; from importlinter.cli import lint_imports_command as run; run()"
    return subprocess.run(
        [sys.executable, "-c", command, "--no-cache", "--no-logo"],
        cwd=root, env={**os.environ, "PYTHONPATH": path, "COLUMNS": "200"},
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip


def test_the_import_rules_hold():
    done = lint(ROOT)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr
    assert "0 broken" in done.stdout


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The packages in a tree where a rule may be broken."""
    root = tmp_path_factory.mktemp("tree")
    shutil.copy(ROOT / "pyproject.toml", root)
    for name in ("src", "proof", "tools"):
        shutil.copytree(
            ROOT / name, root / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info")
        )
    return root


@pytest.fixture
def plant(copy: Path) -> Iterator[Plant]:
    """Adds a line to the end of a module; takes it back after the test."""
    before: dict[Path, str] = {}

    def add(module: str, line: str) -> None:
        path = copy / modules()[module].relative_to(ROOT)
        before[path] = path.read_text()
        path.write_text(f"{before[path]}\n{line}\n")

    yield add
    for path, text in before.items():
        path.write_text(text)


@pytest.mark.parametrize(
    ("module", "line", "rule"),
    [
        ("pam_model.errors", "import pam_sim.rig", "Imports run downhill only"),
        ("pam_cli.__main__", "import pam_check.programs", "Imports run downhill only"),
        ("pam_ros.periodic", "from pam_model import errors", "Imports run downhill only"),
        ("pam_driver.can_bus.bus", "import pam_control.settings", "Imports run downhill only"),
        ("pam_sim.rig", "import pam_control.settings", "The simulated rig borrows"),
        ("pam_gap.rules", "import pam_driver.can_bus.bus", "The diagnosis needs the models alone"),
        ("pam_model.errors", "import pam_ros.spin", "Of the models only the node knows ROS"),
        ("pam_model.errors", "import pam_model.rig.file", "No circle"),
        ("pam_demo.demo", "import pam_demo.player_node", "Nodes are started, not imported"),
        ("pam_demo.demo", "import rclpy", "ROS stays in the nodes"),
        ("pam_gap.rules", "import importlib", "No module is imported by a name in a string"),
    ],
)  # fmt: skip
def test_a_planted_import_breaks_its_rule(copy: Path, plant: Plant, module, line, rule):
    plant(module, line)
    done = lint(copy)
    assert done.returncode != 0
    broken = done.stdout[done.stdout.index("Broken contracts") :]
    assert rule in broken
    assert module in broken or f".{module.split('.')[1]}" in broken


def test_a_line_that_breaks_no_rule_is_let_through(copy: Path, plant: Plant):
    plant("pam_sim.rig", "import pam_driver.can_bus.bus")
    assert lint(copy).returncode == 0


def test_nothing_is_imported_by_the_builtin_function():
    found = [
        f"{name}: line {node.lineno}"
        for name, path in modules().items()
        for node in ast.walk(syntax(path))
        if isinstance(node, ast.Name) and node.id == "__import__"
    ]
    assert found == []


def test_modules_that_are_started_as_processes_are_named_in_one_place():
    ours = modules()
    packages = {name.split(".")[0] for name in ours}  # programs of others are named where used
    found = {}
    for name, path in ours.items():
        if path.name == "programs.py":
            continue
        tree = syntax(path)
        for node in ast.walk(tree):
            if isinstance(node, ast.List):  # [sys.executable, "-m", "module", ...]
                words = [getattr(word, "value", None) for word in node.elts]
                found |= {
                    word: name
                    for before, word in pairwise(words)
                    if before == "-m" and str(word).split(".")[0] in packages
                }
            if isinstance(node, ast.Constant) and "." in str(node.value) and node.value in ours:
                found[node.value] = name
    assert found == {}, "name the program in programs.py"


def test_a_program_that_is_started_is_a_program():
    ours = modules()
    for path in (path for path in ours.values() if path.name == "programs.py"):
        names = [
            node.value
            for node in ast.walk(syntax(path))
            if isinstance(node, ast.Constant) and node.value in ours
        ]
        assert names, path
        for name in names:
            program = ours.get(f"{name}.__main__", ours[name])
            assert '__name__ == "__main__"' in program.read_text(), name


def test_every_package_is_under_the_rules():
    text = (ROOT / "pyproject.toml").read_text()
    listed = text[text.index("root_packages") :].partition("]")[0]
    assert [name for name in ALL_PACKAGES if f'"{name}"' not in listed] == []
    assert {path.name for path in SOURCE.iterdir() if path.is_dir()} == set(PACKAGES)


def test_the_checks_are_no_package_that_a_robot_installs():
    assert (PROOF / "COLCON_IGNORE").exists()
    assert not list(PROOF.rglob("package.xml"))
    named = [path for path in SOURCE.glob("*/package.xml") if "pam_check" in path.read_text()]
    assert named == []
    assert "pam_check" not in (ROOT / "colcon.meta").read_text()
