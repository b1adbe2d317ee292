"""No two classes share a name, and no module of the product is named as a test is."""

from __future__ import annotations

import ast
from collections import defaultdict

from support.source_tree import ROOT

SHARED = {"Measurement"}
"""A message of the board has the name that the DBC file gives it; the other is the public input of
a control step."""


def trees() -> dict[str, ast.Module]:
    """The modules of src/ and proof/, by their path."""
    return {
        path.relative_to(ROOT).as_posix(): ast.parse(path.read_text())
        for root in ("src", "proof")
        for path in sorted((ROOT / root).glob("**/pam_*/**/*.py"))
    }


def doubled(modules: dict[str, ast.Module]) -> dict[str, list[str]]:
    """Public classes that more than one module defines, with these modules."""
    found = defaultdict(list)
    for path, tree in modules.items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found[node.name].append(path)
    return {name: paths for name, paths in found.items() if len(paths) > 1}


def test_no_two_modules_define_a_class_of_the_same_name() -> None:
    found = doubled(trees())
    assert found.keys() >= SHARED, "take it off the list"
    found = {name: paths for name, paths in found.items() if name not in SHARED}
    assert not found, f"say whose it is: {found}"


def test_no_module_of_the_product_is_named_as_a_test() -> None:
    names = {path: path.rpartition("/")[2].removesuffix(".py") for path in trees()}
    found = [p for p, name in names.items() if name.startswith("test_") or name.endswith("_test")]
    assert not found, f"name them by what they do: {found}"


def test_the_rule_sees_classes_of_modules_and_passes_private_ones() -> None:
    modules = {
        "a": ast.parse("class Motion: ...\nclass _Form: ..."),
        "b": ast.parse("class _Form: ..."),
    }
    assert not doubled(modules)
    modules["c"] = ast.parse("class Motion: ...")
    assert doubled(modules) == {"Motion": ["a", "c"]}
