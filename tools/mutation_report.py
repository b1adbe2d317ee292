"""Prints mutmut's results: a table of mutants per module, and the change of each survivor."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from mutmut.mutation.diff_apply import get_diff_for_mutant

SURVIVED, NOT_TESTED = (0, 5), (33, 34)  # result codes of mutmut
LEAST = 0.9


def main(folder: Path) -> int:
    """Print the report; returns 1 if too many mutants survive, 2 if none was run."""
    survivors: list[str] = []
    total = killed = 0
    print("| module | mutants | noticed | share |\n|---|---|---|---|")
    for path in sorted(folder.glob("pam_*/**/*.meta")):
        codes = {
            name: code
            for name, code in json.loads(path.read_text())["exit_code_by_key"].items()
            if code is not None
        }
        if not codes:
            continue
        lived = [name for name, code in codes.items() if code in (*SURVIVED, *NOT_TESTED)]
        survivors += lived
        count, dead = len(codes), len(codes) - len(lived)
        total, killed = total + count, killed + dead
        print(f"| {path.name.removesuffix('.py.meta')} | {count} | {dead} | {dead / count:.1%} |")
    if not total:
        print("no mutant was run")
        return 2
    print(f"| all | {total} | {killed} | {killed / total:.1%} |\n")
    for name in survivors:
        lines = get_diff_for_mutant(name).splitlines()
        change = [line for line in lines if line[:1] in "+-" and line[:3] not in ("+++", "---")]
        print("\n".join([name, *(f"    {line}" for line in change)]))
    return 0 if killed >= LEAST * total else 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
