"""Twins of the plant's functions that work on one of several lanes.

A lane is one parameter vector of a batch. The arrays of several lanes lie side by side: entry i of
lane j is at i * LANES + j. The twin of a function is made from its source: `c[i]` becomes
`c[i * LANES + lane]` for every array of LANE_ARRAYS. So each law and each stage is written once,
for one joint. A loop over the lanes around inlined twins has no calls, and LLVM converts it to
vector instructions, with masks where lanes take different branches.

A twin is made for a variant of the plant: its number of muscles, over which loops are repeated,
and what no lane of a batch has. Constants named in `off` are 0, and statements that depend on them
alone disappear. A kernel for a single joint calls the functions as they are, or twins from which
only these statements have disappeared (single_kernel.py).
"""

from __future__ import annotations

import ast
import copy
import hashlib
import inspect
import textwrap
from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any, Final, NamedTuple

from pam_model.plant.compiled import HAVE_NUMBA, compiled, compiled_fused, compiled_loop

LANES: Final = 32
"""Lanes side by side; with more of them, the start of each loop and the wait for its last results
weigh less. LLVM does not convert loops that it knows to be shorter than 16."""
LANE_ARRAYS: Final = frozenset(
    {"c", "sensors", "y", "dy", "moved", "k1", "k2", "k3", "k4"}
    | {"held", "contact", "torque", "output"}
    | {"shown", "history", "total"}  # of the comparison with a recording
)
"""Names of the arguments that hold one array per lane, wherever they appear in the plant."""
COUNTS_OF_MUSCLES: Final = frozenset({"len(tables)", "len(held)"})
"""Expressions of the number of muscles in loops over them."""


class LaneVariant(NamedTuple):
    """What all lanes of a block have in common, for which their kernel is made."""

    off: frozenset[str]  # names of constants that are 0 in all lanes
    muscles: int  # number of muscles of each joint


SINGLE: Final = None
"""In place of a variant: the kernel of a single lane, with all constants, of any muscles."""
Variant = LaneVariant | None


def _plain(function: Any) -> FunctionType:
    """The Python function behind a compiled one."""
    found = getattr(function, "py_func", function)
    assert isinstance(found, FunctionType)
    return found


def _is_lane_function(function: Any) -> bool:
    function = getattr(function, "py_func", function)
    return isinstance(function, FunctionType) and not LANE_ARRAYS.isdisjoint(
        function.__code__.co_varnames[: function.__code__.co_argcount]
    )


class _WithoutLaws(ast.NodeTransformer):
    """Rewrites a function to one without the statements of laws that are off."""

    def __init__(self, variant: LaneVariant) -> None:
        self.off, self.muscles = variant

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        self.generic_visit(node)
        node.decorator_list, node.returns = [], None
        for argument in node.args.args:
            argument.annotation = None
        return node

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        self.generic_visit(node)
        named = {name.id for name in ast.walk(node.slice) if isinstance(name, ast.Name)}
        is_off = isinstance(node.value, ast.Name) and node.value.id == "c" and named & self.off
        return ast.Constant(0.0) if is_off else node

    def visit_If(self, node: ast.If) -> ast.stmt | list[ast.stmt]:
        self.generic_visit(node)
        test = node.test
        if isinstance(test, ast.Compare) and isinstance(test.left, ast.Constant):
            # Only a comparison of `c[...]` with 0.0 of something that is off becomes one of two
            # constants; it is false.
            return node.orelse
        return node

    def visit_For(self, node: ast.For) -> ast.stmt | list[ast.stmt]:
        """Repeat the body of `for i in range(2)`: only innermost loops become vector code.

        So do loops over all muscles, `for i in range(len(tables))`.
        """
        call = node.iter
        assert isinstance(call, ast.Call)
        assert isinstance(node.target, ast.Name)
        count = call.args[0]
        if isinstance(count, ast.Constant):
            times = int(str(count.value))
        else:
            assert ast.unparse(count) in COUNTS_OF_MUSCLES, ast.unparse(count)
            times = self.muscles
        repeated: list[ast.stmt] = []
        for number in range(times):
            once = ast.Assign([ast.Name(node.target.id, ast.Store())], ast.Constant(number))
            for statement in (once, *copy.deepcopy(node.body)):
                new = self.visit(statement)
                repeated += new if isinstance(new, list) else [new]
        return repeated


class _ToLane(_WithoutLaws):
    """Rewrites a function of arrays to a function of one lane of them, too."""

    def __init__(self, variant: LaneVariant, inner: frozenset[str]) -> None:
        super().__init__(variant)
        self.inner = inner

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        super().visit_FunctionDef(node)
        node.args.args.insert(0, ast.arg("lane"))
        return node

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        found = super().visit_Subscript(node)
        if not (isinstance(node.value, ast.Name) and node.value.id in LANE_ARRAYS):
            return found
        if isinstance(found, ast.Constant):
            return found
        index = ast.BinOp(node.slice, ast.Mult(), ast.Constant(LANES))
        node.slice = ast.BinOp(index, ast.Add(), ast.Name("lane", ast.Load()))
        return node

    def visit_Call(self, node: ast.Call) -> ast.Call:
        self.generic_visit(node)
        if isinstance(node.func, ast.Name) and node.func.id in self.inner:
            node.args.insert(0, ast.Name("lane", ast.Load()))
        return node


def kernel_name(variant: Variant) -> str:
    """A short name of the kernel of this variant.

    numba names files and symbols of machine code after the function. Two kernels from two
    processes would share a symbol, and one would run the other's code, if their functions had the
    same name.
    """
    if variant is SINGLE:
        return "single"
    parts = " ".join((str(variant.muscles), *sorted(variant.off)))
    return hashlib.sha256(parts.encode()).hexdigest()[:8]


@cache
def lane_twin(function: Any, variant: LaneVariant) -> Callable[..., Any]:
    """The twin of a compiled function: its first argument is the lane.

    Parameters
    ----------
    function : callable
        A function of the plant that takes at least one of LANE_ARRAYS.
    variant : LaneVariant
        Number of muscles, and constants that are 0, of all lanes.
    """
    inner = _inner(function)
    return _rewritten(function, variant, inner, _ToLane(variant, inner), lane_twin, "of_lane")


@cache
def twin_without_laws(function: Any, variant: LaneVariant) -> Callable[..., Any]:
    """The same function for one joint of a variant, whose arrays are as they were."""
    rewriter = _WithoutLaws(variant)
    return _rewritten(
        function, variant, _inner(function), rewriter, twin_without_laws, "without_laws"
    )


def _inner(function: Any) -> frozenset[str]:
    """Names of the functions of LANE_ARRAYS that a function calls."""
    plain = _plain(function)
    known = plain.__globals__
    return frozenset(name for name in plain.__code__.co_names if _is_lane_function(known.get(name)))


def _rewritten(
    function: Any,
    variant: LaneVariant,
    inner: frozenset[str],
    rewriter: _WithoutLaws,
    twin_of: Callable[[Any, LaneVariant], Callable[..., Any]],
    name: str,
) -> Callable[..., Any]:
    """A function from rewritten source, compiled; it calls the twins of its inner functions."""
    plain = _plain(function)
    known = plain.__globals__
    tree = ast.parse(textwrap.dedent(inspect.getsource(plain)))
    new = ast.fix_missing_locations(rewriter.visit(tree))
    code = compile(new, f"<twin of {plain.__name__}>", "exec")
    used = {each.id for each in ast.walk(new) if isinstance(each, ast.Name)}
    names = {**known, **{one: twin_of(known[one], variant) for one in sorted(inner & used)}}
    exec(code, names)
    twin: FunctionType = names[plain.__name__]
    twin.__qualname__ = f"{plain.__name__}_{name}_{kernel_name(variant)}"
    return compiled_fused(twin)


@cache
def lane_loop(function: Any, variant: Variant) -> Callable[..., None]:
    """A loop that calls the twin of `function` for the first `active` lanes.

    The loop takes `active` before the arguments of `function`. For a single lane it calls
    `function` itself.
    """
    plain = _plain(function)
    arguments = ", ".join(inspect.signature(plain).parameters)
    if not HAVE_NUMBA:
        return lambda active, *given: plain(*given)
    names: dict[str, Any]
    if variant is SINGLE:
        names = {"twin": compiled(plain)}
        source = f"def loop(active, {arguments}):\n    twin({arguments})\n"
    else:
        names = {"twin": lane_twin(function, variant)}
        source = (
            f"def loop(active, {arguments}):\n"
            f"    for lane in range(min(active, {LANES})):\n"
            f"        twin(lane, {arguments})\n"
        )
    exec(compile(source, f"<lane loop of {plain.__name__}>", "exec"), names)
    loop: FunctionType = names["loop"]
    loop.__name__ = loop.__qualname__ = f"{plain.__name__}_of_lanes_{kernel_name(variant)}"
    return compiled(loop) if variant is SINGLE else compiled_loop(loop)
