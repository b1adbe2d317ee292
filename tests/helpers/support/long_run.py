"""Which tests only `make test-all` runs, and which cases stand for the others in `make test`.

``@pytest.mark.long(reason)`` leaves a test to `make test-all`. ``@pytest.mark.sampled(reason)``
leaves most cases of a parametrised test to it: every value of every parameter stays in at least
one case of `make test`. With ``cases=12`` these are twelve cases that have as many values as
possible; with ``alike=f``, where ``f(**parameters)`` tells the kind of a case, one of each kind.
Other cases are chosen only when the parameters change, so that a failure can be repeated.
"""

from __future__ import annotations

import ast
import random
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest


def mark_the_long_run(items: Sequence[pytest.Item]) -> None:
    """Mark as `long` what `sampled` leaves out; refuse either marker without a reason.

    Raises
    ------
    pytest.UsageError
        A marker has no sentence that says what stands for the test in the short run.
    """
    families: dict[str, list[pytest.Item]] = defaultdict(list)
    for item in items:
        for name in ("long", "sampled"):
            marker = item.get_closest_marker(name)
            if marker and (len(marker.args) != 1 or len(str(marker.args[0]).split()) < 5):
                raise pytest.UsageError(f"{item.nodeid}: {name} needs the reason as a sentence")
        if item.get_closest_marker("sampled"):
            families[item.nodeid.split("[")[0]].append(item)
    for name, family in families.items():
        marker = family[0].get_closest_marker("sampled")
        assert marker is not None
        values = [_values(item, marker.kwargs.get("alike")) for item in family]
        kept = representative(values, marker.kwargs.get("cases"), name)
        for place, item in enumerate(family):
            if place not in kept:
                item.add_marker(pytest.mark.long(marker.args[0]))


def _values(item: Any, alike: Callable[..., Hashable] | None) -> dict[int, Hashable]:
    """What makes a case one of its own: its kind, or the id of each of its `parametrize` marks."""
    if alike:
        return {0: alike(**item.callspec.params)}
    return dict(enumerate(item.callspec._idlist))


def representative(
    cases: Sequence[Mapping[int, Hashable]], count: int | None, seed: str
) -> set[int]:
    """Places of the cases that stand for all.

    Parameters
    ----------
    cases : sequence of mapping
        Something that tells the value of each parameter, by the parameter's place.
    count : int, optional
        How many to choose; as many as needed for every value if it is left out.
    seed : str
        Decides between cases that add as many values.
    """
    left = {value for case in cases for value in case.items()}
    order = list(range(len(cases)))
    random.Random(seed).shuffle(order)
    chosen: set[int] = set()
    while order and (left if count is None else len(chosen) < count):
        best = max(order, key=lambda place: len(left & cases[place].items()))
        order.remove(best)
        chosen.add(best)
        left -= cases[best].items()
    return chosen


def long_tests(folder: Path) -> Iterator[tuple[str, str, str]]:
    """File, test (or "all") and reason of every marked test in the files of a folder."""
    for path in sorted(folder.rglob("test_*.py")):
        text = path.read_text(encoding="utf-8")
        if "mark.long" not in text and "mark.sampled" not in text:
            continue
        tree = ast.parse(text)
        known = {
            target.id: node.value
            for node in tree.body
            if isinstance(node, ast.Assign)
            for target in node.targets
            if isinstance(target, ast.Name)
        }
        place = path.relative_to(folder).as_posix()
        for node in tree.body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                for reason, what in _reasons(node.decorator_list, known):
                    yield place, f"{what}{node.name}", reason
            elif isinstance(node, ast.Assign) and _assigns(node, "pytestmark"):
                for reason, what in _reasons([node.value], known):
                    yield place, f"{what}all", reason


def _assigns(node: ast.Assign, name: str) -> bool:
    return any(isinstance(target, ast.Name) and target.id == name for target in node.targets)


def _reasons(nodes: Iterable[ast.expr], known: Mapping[str, ast.expr]) -> Iterator[tuple[str, str]]:
    """Reason, and how many cases are meant, of each such marker within the nodes."""
    for outer in nodes:
        for inner in ast.walk(outer):
            node = known.get(inner.id) if isinstance(inner, ast.Name) else inner
            if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
                continue
            if node.func.attr not in ("long", "sampled") or not node.args:
                continue
            reason = node.args[0]
            if isinstance(reason, ast.Name):
                reason = known[reason.id]
            cases = "most cases of " if node.func.attr == "sampled" else "some cases of "
            whole = node.func.attr == "long" and inner is outer
            yield ast.literal_eval(reason), "" if whole else cases
