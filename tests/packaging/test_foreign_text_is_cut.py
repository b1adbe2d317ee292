"""Text of a message is cut before it is formatted: no f-string, join or log line without it.

How the rule decides, in every function of the files through which messages go:

1. Foreign are the parameters that carry messages or their texts, by the names that the suite gives
   them (`FOREIGN`), what is assigned or looped over from them, and every part of them.
2. Not foreign any more is the result of a call (`shown`, `plain`, `len`, `float`, a method of ours)
   except of those that only pass text on (`PASSES_ON`); a number, which is formatted with a format
   such as `:g`; a name after `if name not in known:` has left the function or the turn; and all
   names after a loop over them that has done so with each.
3. A foreign value in an f-string, in `join`, `%`, `format` or `repr`, or as the text of an error or
   of a log line, is a finding.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.source_tree import ROOT

PLACES = (
    "src/pam_ros/pam_ros/*.py",
    "src/pam_driver/pam_driver/driver*.py",
    "src/pam_driver/pam_driver/safety/*.py",
    "src/pam_control/pam_control/**/*.py",
    "src/pam_sim/pam_sim/rig_node.py",
    "src/pam_sim/pam_sim/rig_loop.py",
    "src/pam_sim/pam_sim/fault_injection.py",
    "src/pam_gap/pam_gap/live/*.py",
    "src/pam_gap/pam_gap/experiments/play_node.py",
    "src/pam_model/pam_model/model_node.py",
    "src/pam_model/pam_model/joints/joint_estimator.py",
    "src/pam_bringup/pam_bringup/viewer/*.py",
    "src/pam_demo/pam_demo/*_node.py",
    "proof/pam_check/faults/operator_node.py",
)
FOREIGN = frozenset(
    {"message", "messages", "request", "requested", "goal", "names", "source", "command", "status"}
)
PASSES_ON = frozenset(
    {
        "list", "tuple", "set", "dict", "frozenset", "sorted", "reversed", "zip", "enumerate",
        "str", "repr", "next", "iter", "get", "items", "keys", "values", "split", "partition",
        "strip", "replace", "decode", "lower", "upper", "join", "format",
    }
)  # fmt: skip
CHECKED_BEFORE = {"_check_point": "check_trajectory has refused names that are unknown"}
"""Functions whose only caller has checked the names."""
LOGS = frozenset({"debug", "info", "warning", "error", "fatal", "log", "print"})


class Function(ast.NodeVisitor):
    """Findings in one function."""

    def __init__(self, function: ast.FunctionDef, inherited: set[str]) -> None:
        arguments = function.args
        every = (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)
        self.foreign = {one.arg for one in every if one.arg in FOREIGN} | inherited
        self.findings: list[int] = []
        for statement in function.body:
            self.visit(statement)

    # --- what is foreign ---

    def is_foreign(self, node: ast.AST) -> bool:
        """Whether an expression gives foreign text."""
        parts: list[ast.expr] = []
        match node:
            case ast.Name(id=name):
                return name in self.foreign
            case ast.ListComp() | ast.SetComp() | ast.GeneratorExp():
                return self._comprehension(node)
            case ast.Attribute() | ast.Starred() | ast.Subscript():
                parts = [node.value]
            case ast.Call(func=ast.Name(id=name)) if name in PASSES_ON:
                parts = node.args
            case ast.Call(func=ast.Attribute(attr=name, value=value)) if name in PASSES_ON:
                parts = [value, *node.args]
            case ast.BoolOp():
                parts = node.values
            case ast.IfExp():
                parts = [node.body, node.orelse]
            case ast.BinOp(op=ast.Add() | ast.Mod()):
                parts = [node.left, node.right]
            case ast.List() | ast.Tuple() | ast.Set():
                parts = node.elts
        return any(map(self.is_foreign, parts))

    def _comprehension(self, node: ast.ListComp | ast.SetComp | ast.GeneratorExp) -> bool:
        before = set(self.foreign)
        for part in node.generators:
            if self.is_foreign(part.iter):
                self.foreign |= bound(part.target)
            else:
                self.foreign -= bound(part.target)
            for condition in part.ifs:
                self.foreign -= known_if_true(condition)
        try:
            return self.is_foreign(node.elt)
        finally:
            self.foreign = before

    def _assign(self, target: ast.AST, value: ast.AST) -> None:
        names = bound(target)
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            for one, part in zip(target.elts, value.elts, strict=False):
                self._assign(one, part)
        elif self.is_foreign(value):
            self.foreign |= names
        else:
            self.foreign -= names

    def visit_Assign(self, node: ast.Assign) -> None:
        self.generic_visit(node)
        for target in node.targets:
            self._assign(target, node.value)

    def visit_For(self, node: ast.For) -> None:
        self._assign(node.target, node.iter)
        match node.iter, node.target:
            case ast.Call(func=ast.Name(id="enumerate")), ast.Tuple(elts=parts):
                self.foreign -= bound(parts[0])  # a number
        self.generic_visit(node)
        if isinstance(node.iter, ast.Name) and bound(node.target) & refused(node.body):
            self.foreign -= {node.iter.id}

    def visit_If(self, node: ast.If) -> None:
        before = set(self.foreign)
        self.visit(node.test)
        self.foreign -= known_if_true(node.test)
        for statement in node.body:
            self.visit(statement)
        self.foreign = before - known_if_false(node.test)
        for statement in node.orelse:
            self.visit(statement)
        leaves = isinstance(node.body[-1], ast.Raise | ast.Return | ast.Continue | ast.Break)
        self.foreign = before - (known_if_false(node.test) if leaves else set())

    # --- where it must not appear ---

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        for part in node.values:
            if not isinstance(part, ast.FormattedValue):
                continue
            if part.format_spec is None and self.is_foreign(part.value):
                self.findings.append(part.lineno)
            self.visit(part.value)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        text = isinstance(node.left, ast.Constant) and isinstance(node.left.value, str)
        if text and isinstance(node.op, ast.Mod | ast.Add) and self.is_foreign(node.right):
            self.findings.append(node.lineno)
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        shows = name in LOGS or name.endswith("Error") or name in {"join", "format", "repr"}
        if shows and any(map(self.is_foreign, node.args)):
            self.findings.append(node.lineno)
        self.generic_visit(node)

    def visit_ListComp(self, node: ast.ListComp) -> None:
        self._in_comprehension(node)

    def visit_SetComp(self, node: ast.SetComp) -> None:
        self._in_comprehension(node)

    def visit_GeneratorExp(self, node: ast.GeneratorExp) -> None:
        self._in_comprehension(node)

    def _in_comprehension(self, node: ast.ListComp | ast.SetComp | ast.GeneratorExp) -> None:
        before = set(self.foreign)
        for part in node.generators:
            self._assign(part.target, part.iter)
            for condition in part.ifs:
                self.foreign -= known_if_true(condition)
        self.visit(node.elt)
        self.foreign = before

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        self.findings += Function(node, self.foreign).findings


def bound(target: ast.AST) -> set[str]:
    """The names that an assignment sets."""
    return {node.id for node in ast.walk(target) if isinstance(node, ast.Name)}


def refused(body: list[ast.stmt]) -> set[str]:
    """The names that a loop raises an error for, unless they are known."""
    return {
        name
        for part in body
        if isinstance(part, ast.If) and isinstance(part.body[-1], ast.Raise)
        for name in known_if_false(part.test)
    }


def known_if_true(test: ast.AST) -> set[str]:
    """The names that are known to be ours where a condition is true."""
    match test:
        case ast.Compare(left=ast.Name(id=name), ops=[ast.In() | ast.Eq()]):
            return {name}
        case ast.BoolOp(op=ast.And(), values=values):
            return set().union(*map(known_if_true, values))
    return set()


def known_if_false(test: ast.AST) -> set[str]:
    """The names that are known to be ours where a condition is false."""
    match test:
        case ast.Compare(left=ast.Name(id=name), ops=[ast.NotIn() | ast.NotEq()]):
            return {name}
        case ast.Compare(left=ast.Name(id=name), ops=[ast.Is()]):
            return {name}  # `index = known.get(name)`, `if index is None`
        case ast.BoolOp(op=ast.Or(), values=values):
            return set().union(*map(known_if_false, values))
    return set()


def findings(source: str) -> list[int]:
    """Lines in which foreign text is formatted."""
    tree = ast.parse(source)
    inner = {
        id(below)
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
        for below in ast.walk(node)
        if below is not node
    }
    return [
        line
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and id(node) not in inner
        if node.name not in CHECKED_BEFORE
        for line in Function(node, set()).findings
    ]


def files() -> Iterator[Path]:
    for place in PLACES:
        found = sorted(ROOT.glob(place))
        assert found, f"{place}: no such file"
        yield from found


def test_no_foreign_text_is_formatted_before_it_is_cut() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}"
        for path in files()
        for line in findings(path.read_text(encoding="utf-8"))
    ]
    assert found == []


@pytest.mark.parametrize(
    "line",
    [
        "print(f'unknown joint {message.name[0]!r}')",
        "raise ValueError('unknown: ' + ', '.join(message.name))",
        "raise ValueError(message.header.frame_id)",
        "for name in message.name:\n        print(f'{name}')",
        "for place, name in enumerate(names):\n        self.log(f'{place}: {name}')",
        "pairs = dict(zip(message.name, message.position))\n    print(f'{list(pairs)}')",
        "text = message.data.split()\n    print('%s' % text[0])",
        "told = [name for name in names if name]\n    print(', '.join(told))",
        "print(', '.join(f'{pair.key}' for pair in message.values))",
        "if name_of(names[0]):\n        print(repr(names[0]))",
    ],
)
def test_the_rule_finds(line: str) -> None:
    assert findings(f"def take(message, names):\n    {line}\n")


@pytest.mark.parametrize(
    "line",
    [
        "print(f'unknown joint {shown(message.name[0])}')",
        "print(f'{len(message.name)} names, {message.position[0]:g} rad')",
        "raise ValueError(all_shown(message.name))",
        "for name in names:\n        if name not in known:\n            raise ValueError()\n"
        "        print(f'{name} is known')",
        "for name in [one for one in names if one in known]:\n        print(name)",
    ],
)
def test_the_rule_permits(line: str) -> None:
    assert not findings(f"def take(message, names):\n    {line}\n")
