"""Table of mutants per module and the change that each survivor made, from mutmut's results."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from mutmut.mutation.diff_apply import get_diff_for_mutant

SURVIVED, NOT_TESTED = (0, 5), (33, 34)  # codes that mutmut keeps
LEAST = 0.9


def main(folder: Path) -> int:
    """Print it; 1 if too many survive."""
    survivors: list[str] = []
    total = killed = 0
    print("| module | mutants | noticed | share |\n|---|---|---|---|")
    for path in sorted(folder.glob("pam_*/*.meta")):
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
