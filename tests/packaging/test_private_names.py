"""A private name is used by the module that defines it, and by no other one."""

from __future__ import annotations

import ast

from support.source_tree import ROOT

OF_LIBRARIES = {
    "os": {"_exit"},
    "collections.namedtuple": {"_asdict", "_field_defaults", "_fields", "_make", "_replace"},
    "python-can": {"_multicast", "_recv_internal", "_send_destination"},
    "numba": {"_cache"},
    "scipy.io": {"_fieldnames"},
    "rclpy": {"_callbacks", "_service_change_state", "_subscriptions"},
}
"""Private names of others that are used, as there is no public way."""


def reached(tree: ast.Module) -> list[str]:
    """Private names that a module uses and does not define."""
    own, used = set(), []
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            own.add(node.name)
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            own.add(node.target.id)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("pam_"):
            used += [name.name for name in node.names]
        elif isinstance(node, ast.Attribute):
            is_self = isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")
            own |= {node.attr} if is_self else set()
            used += [] if is_self else [node.attr]
    return [name for name in used if name[0] == "_" and name[:2] != "__" and name not in own]


def test_no_module_reaches_into_another_one() -> None:
    allowed = set().union(*OF_LIBRARIES.values())
    found = {
        path.relative_to(ROOT).as_posix(): names
        for root in ("src", "proof")
        for path in sorted((ROOT / root).glob("**/pam_*/**/*.py"))
        if (names := sorted(set(reached(ast.parse(path.read_text()))) - allowed))
    }
    assert not found, f"ask for what they answer: {found}"


def test_the_rule_sees_attributes_and_imports_of_others() -> None:
    text = "from pam_model.rig import _keys\nclass A:\n    _a: int\nprint(A._a, A._b)"
    assert sorted(reached(ast.parse(text))) == ["_b", "_keys"]
