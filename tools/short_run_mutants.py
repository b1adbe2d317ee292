"""Does `make test` notice what `make test-all` notices? Changes lines at random and tries both.

Usage: ``.venv/bin/python tools/short_run_mutants.py [--count 30] [--seed 1] [--limit 240]``

Only modules are changed that a file with tests of the long run imports, of every package equally
many. Each change is tried in a copy of the tree with the test files that import the module, those
about the module first, until a test fails or the time is over: first their tests of the short run,
then, if nobody has noticed, those of the long run alone. The last lines count both. The random
choice depends on the seed and on the sources.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
SHORT, LONG = "not vcan and not long", "long and not vcan"
ALONE = " and not system"  # tests of processes fail on a busy computer
TIME_IS_OVER = "the time is over"
OTHER_OPERATORS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.And: ast.Or,
    ast.Or: ast.And,
}  # fmt: skip


def changed(node: ast.AST) -> ast.expr | None:
    """A small change of an expression; None if this kind of expression is left as it is."""
    new: ast.expr | None = None
    if isinstance(node, ast.Compare) and type(node.ops[0]) in OTHER_OPERATORS:
        first = OTHER_OPERATORS[type(node.ops[0])]()
        new = ast.Compare(node.left, [first, *node.ops[1:]], node.comparators)  # type: ignore[list-item]
    elif isinstance(node, ast.BoolOp):
        new = ast.BoolOp(OTHER_OPERATORS[type(node.op)](), node.values)  # type: ignore[arg-type]
    elif isinstance(node, ast.BinOp) and type(node.op) in OTHER_OPERATORS:
        new = ast.BinOp(node.left, OTHER_OPERATORS[type(node.op)](), node.right)  # type: ignore[arg-type]
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
        new = node.operand
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        new = ast.Constant(not node.value)
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        new = ast.Constant(node.value * 2 + 1)
    return new


def changes(path: Path) -> Iterator[tuple[int, str, str, str]]:
    """Line, old text, new text and whole source of every change within the functions of a file."""
    source = path.read_text(encoding="utf-8")
    starts = [0]
    for line in source.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    functions = [n for n in ast.walk(ast.parse(source)) if isinstance(n, ast.FunctionDef)]
    seen = set()
    for node in (n for function in functions for part in function.body for n in ast.walk(part)):
        new = changed(node)
        if new is None or not isinstance(node, ast.expr) or node.end_lineno is None:
            continue
        begin = starts[node.lineno - 1] + node.col_offset
        end = starts[node.end_lineno - 1] + (node.end_col_offset or 0)
        if (begin, end) not in seen:
            seen.add((begin, end))
            whole, text = source.encode(), f"({ast.unparse(new)})"
            result = whole[:begin] + text.encode() + whole[end:]
            yield node.lineno, whole[begin:end].decode(), text, result.decode()


def imported(path: Path) -> set[Path]:
    """The files of the packages that a test file, or what it takes from its folder, imports.

    Or starts as a process: what it calls by the name of a module.
    """
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            helper = path.with_name(f"{node.module}.py")
            if node.level == 1 and helper.exists():
                found |= imported(helper)
        elif isinstance(node, ast.Constant) and re.fullmatch(r"pam_\w+(\.\w+)+", str(node.value)):
            names = [str(node.value)]
        for name in names:
            inside = name.replace(".", "/") + ".py"
            for folder in (ROOT / "src" / name.split(".")[0], ROOT / "proof"):
                if (folder / inside).exists():
                    found.add((folder / inside).relative_to(ROOT))
    return found


def has_long_tests(path: Path) -> bool:
    """Whether a test file leaves anything to the long run."""
    text = path.read_text(encoding="utf-8")
    return "mark.long(" in text or "mark.sampled(" in text


def about(module: Path, tests: dict[Path, set[Path]]) -> list[str]:
    """The test files that import a module, those first that say most about it."""
    stem = module.stem.removesuffix("_node")
    found = [path for path, names in tests.items() if module in names]
    found.sort(key=lambda path: (stem not in path.stem, len(tests[path]), path))
    return [str(path.relative_to(ROOT)) for path in found]


@dataclass
class Trial:
    """A copy of the tree in which changes are tried.

    Attributes
    ----------
    tree : Path
        The copy.
    limit : float
        Time of each run [s].
    without : str
        What is left out of either run, as pytest's option -m takes it.
    unsound : set of str
        Tests that have failed there without a change; they are left out.
    """

    tree: Path
    limit: float
    without: str
    unsound: set[str] = field(default_factory=set)

    def failed(self, tests: Sequence[str], which: str) -> list[str]:
        """The first test of one run that fails, if one does; else perhaps TIME_IS_OVER."""
        if not tests:
            return []
        folders = [*sorted((self.tree / "src").iterdir()), self.tree / "proof", self.tree]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, folders))}
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider"]
        left_out = [word for test in self.unsound for word in ("--deselect", test)]
        run = subprocess.Popen(
            [*command, "-m", which + self.without, *left_out, *tests],
            cwd=self.tree,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        try:
            output, _ = run.communicate(timeout=self.limit)
        except subprocess.TimeoutExpired:
            return [TIME_IS_OVER]
        finally:
            if run.poll() is None:
                os.killpg(run.pid, signal.SIGKILL)
                run.communicate()
        if run.returncode in (0, 5):  # 5: no test is selected
            return []
        if run.returncode == 4:
            raise RuntimeError(f"pytest was called wrongly: {output}")
        return re.findall(r"^(?:FAILED|ERROR) (tests/\S+?\.py(?:::\w+)*)", output, re.M) or [*tests]

    def of(self, module: Path, source: str, tests: Sequence[str]) -> tuple[str, list[str]]:
        """Who notices a change of a module, and the test that does."""
        while True:
            (self.tree / module).write_text(source, encoding="utf-8")
            who, noticed = self._noticed(tests)
            shutil.copy2(ROOT / module, self.tree / module)
            again = self.failed(noticed, SHORT if who == "short run" else LONG) if noticed else []
            if not again or again == [TIME_IS_OVER]:
                return who, noticed
            self.unsound.update(again)

    def _noticed(self, tests: Sequence[str]) -> tuple[str, list[str]]:
        short = self.failed(tests, SHORT)
        if short and short != [TIME_IS_OVER]:
            return "short run", short
        late = " in time" if short else ""
        long = self.failed([test for test in tests if has_long_tests(ROOT / test)], LONG)
        if long and long != [TIME_IS_OVER]:
            return f"long run alone{late}", long
        return f"nobody{late if not long else ' in time'}", []


def copy_tree(tree: Path) -> None:
    """Copy what git knows, and the machine code of the kernels, which depends on times of files."""
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    kernels = [path.relative_to(ROOT) for path in ROOT.glob("*/**/__pycache__/**/*.nb[ci]")]
    for name in (*map(Path, listed.stdout.splitlines()), *kernels):
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, tree / name)


def draws(count: int, seed: int, modules: Sequence[Path]) -> Iterator[tuple[Path, Any]]:
    """Random changes of random modules, the packages one after the other."""
    draw = random.Random(seed)
    packages: dict[str, list[Path]] = {}
    for module in modules:
        packages.setdefault(module.parts[1 if module.parts[0] == "src" else 0], []).append(module)
    names = sorted(packages)
    draw.shuffle(names)
    done = 0
    while done < count:
        module = draw.choice(packages[names[done % len(names)]])
        if found := list(changes(ROOT / module)):
            yield module, draw.choice(found)
            done += 1


def main() -> int:
    """Print one line for each change, and the totals; 1 if only the long run notices a change."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=30, help="number of changes")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", metavar="PART", help="modules whose path contains it")
    parser.add_argument("--limit", type=float, default=240.0, help="time of each run [s]")
    parser.add_argument("--processes", action="store_true", help="tests of processes, too")
    given = parser.parse_args()
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        copy_tree(tree)
        paths = sorted(path.relative_to(tree) for path in (tree / "tests").rglob("test_*.py"))
        tests = {ROOT / path: imported(ROOT / path) for path in paths}
        long = [path for path in tests if has_long_tests(path)]
        modules = sorted({module for path in long for module in tests[path]})
        modules = [m for m in modules if given.only in str(m) and any(changes(ROOT / m))]
        if not modules:
            parser.error(f"--only {given.only}: no file with long tests imports such a module")
        trial = Trial(tree, given.limit, "" if given.processes else ALONE)
        for module, (line, old, new, source) in draws(given.count, given.seed, modules):
            begin = time.monotonic()
            who, noticed = trial.of(module, source, about(module, tests))
            counts[who] += 1
            seconds = f"{time.monotonic() - begin:.0f} s"
            test = noticed[0] if noticed else ""
            print(f"{who}: {module}:{line}: {old!r} -> {new!r} ({seconds}) {test}", flush=True)
    print(", ".join(f"{who}: {count}" for who, count in counts.items()))
    return int(any(who.startswith("long run alone") for who in counts))


if __name__ == "__main__":
    sys.exit(main())
