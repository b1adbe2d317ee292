"""pam_ros is the lowest package: it knows ROS, and nothing of the packages above it."""

import ast
from pathlib import Path

import pam_ros

FOLDER = Path(pam_ros.__file__).parent


def imported(path: Path) -> set[str]:
    """The top-level packages that a module imports, wherever in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module.split(".")[0])
    return found


def test_pam_ros_imports_no_other_package_of_the_suite() -> None:
    modules = sorted(FOLDER.rglob("*.py"))
    assert len(modules) > 3
    uphill = {
        path.name: others
        for path in modules
        if (others := {name for name in imported(path) if name.startswith("pam_")} - {"pam_ros"})
    }
    assert not uphill
