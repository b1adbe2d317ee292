"""A node subscribes through `pam_ros.subscriptions` alone, and bytes are decoded in one place."""

from __future__ import annotations

import ast

import pytest

from support.source_tree import ALL_PACKAGES, ROOT, python_files

ONLY_IN = {
    "create_subscription": "src/pam_ros/pam_ros/subscriptions.py",
    "deserialize_message": "src/pam_ros/pam_ros/message_decoder.py",
    # rclpy's other ways to a subscription
    "wait_for_message": "",
    "ParameterEventHandler": "",
    "on_parameter_event": "",
    "message_filters": "",
    "Subscription": "",
}


def used(source: str) -> set[str]:
    """The names of ONLY_IN in a file: called, imported, or as an attribute."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Attribute):
            found.add(node.attr)
        elif isinstance(node, ast.Name):
            found.add(node.id)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.add(node.value)  # getattr(node, "create_subscription")
        elif isinstance(node, ast.Import | ast.ImportFrom):
            found |= {part for alias in node.names for part in alias.name.split(".")}
            found |= set((getattr(node, "module", None) or "").split("."))
    return found & set(ONLY_IN)


FILES = [path for package in ALL_PACKAGES for path in python_files(package)]


def test_no_file_has_a_subscription_or_a_decoder_of_its_own() -> None:
    found = {
        (str(path.relative_to(ROOT)), name)
        for path in FILES
        for name in used(path.read_text(encoding="utf-8"))
    }
    assert found == {(path, name) for name, path in ONLY_IN.items() if path}


@pytest.mark.parametrize(
    "line",
    [
        "self.create_subscription(JointState, 'a', print, 1)",
        "make = node.create_subscription",
        "getattr(node, 'create_subscription')(1)",
        "from rclpy.serialization import deserialize_message as read",
        "from rclpy.wait_for_message import wait_for_message",
        "import message_filters",
    ],
)
def test_the_rule_sees_every_way(line: str) -> None:
    assert used(line)
