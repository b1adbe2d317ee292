"""No node of the suite hides something that rclpy keeps in its nodes."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

import rclpy
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node

from support.source_tree import modules

SOURCES = [path for path in modules().values() if path.name.endswith("_node.py")]
MEANT = {"__init__", "destroy_node", "set_parameters_atomically"} | {
    f"on_{act}" for act in ("configure", "activate", "deactivate", "cleanup", "shutdown", "error")
}


@pytest.fixture(scope="module")
def taken() -> set[str]:
    """All names of rclpy's nodes, those of their instances included."""
    context = rclpy.Context()
    rclpy.init(context=context)
    try:
        node: Node = LifecycleNode("drawing", context=context)
        names = {name for kind in type(node).__mro__ for name in vars(kind)} | set(vars(node))
        node.destroy_node()
    finally:
        rclpy.shutdown(context=context)
    return names


def node_classes(tree: ast.Module) -> Iterator[ast.ClassDef]:
    for each in ast.walk(tree):
        if isinstance(each, ast.ClassDef) and any("Node" in ast.unparse(b) for b in each.bases):
            yield each


def own_names(node_class: ast.ClassDef) -> Iterator[str]:
    for each in ast.walk(node_class):
        if isinstance(each, ast.FunctionDef):
            yield each.name
        elif isinstance(each, ast.Attribute) and isinstance(each.ctx, ast.Store):
            yield each.attr


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.stem)
def test_a_node_keeps_nothing_under_a_name_that_rclpy_uses(path: Path, taken: set[str]) -> None:
    """`ros2 param list` ended the model node, which kept its own object as `_parameters`."""
    for node_class in node_classes(ast.parse(path.read_text())):
        hidden = set(own_names(node_class)) & taken - MEANT
        assert not hidden, f"{node_class.name} of {path.name} hides {sorted(hidden)} of rclpy"


def test_the_names_of_rclpy_are_known(taken: set[str]) -> None:
    """Without these, the test above could not fail."""
    assert {"_parameters", "_publishers", "get_logger", "on_configure"} <= taken
    assert len(SOURCES) > 8
