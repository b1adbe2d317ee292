"""Imports run downhill only, ROS stays in the nodes, nothing is imported by a name in a string.

The rules are contracts of import-linter in pyproject.toml; `make lint` checks them as well.
"""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
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


PLANTED = [
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
]  # fmt: skip
"""A module, a line at its end, and the rule that it breaks."""


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The packages in a tree where a rule may be broken."""
    root = tmp_path_factory.mktemp("tree")
    shutil.copy(ROOT / "pyproject.toml", root)
    for name in ("src", "proof", "tools"):
        shutil.copytree(
            ROOT / name, root / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info")
        )
    return root


def plant(tree: Path, module: str, line: str) -> None:
    path = tree / modules()[module].relative_to(ROOT)
    path.write_text(f"{path.read_text()}\n{line}\n")


@pytest.fixture(scope="module")
def broken(tree: Path) -> dict[str, str]:
    """By rule, what import-linter says when all these lines are there at once.

    First, in the same tree, with a line that breaks no rule.
    """
    plant(tree, "pam_sim.rig", "import pam_driver.can_bus.bus")
    assert lint(tree).returncode == 0
    for module, line, _ in PLANTED:
        plant(tree, module, line)
    done = lint(tree)
    assert done.returncode != 0
    told = done.stdout[done.stdout.index("Broken contracts") :]
    _, *parts = re.split(r"^(\w.+)\n-{5,}\n", told, flags=re.MULTILINE)
    return dict(zip(parts[::2], parts[1::2], strict=True))


@pytest.mark.parametrize(("module", "line", "rule"), PLANTED)
def test_a_planted_import_breaks_its_rule(
    broken: dict[str, str], module: str, line: str, rule: str
) -> None:
    (said,) = (text for name, text in broken.items() if name.startswith(rule))
    assert module in said or f".{module.split('.')[1]}" in said


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
