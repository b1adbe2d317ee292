"""Feeds random and mutated input into the suite; only PamError may escape.

`pam check fuzz frames --count 10000000`; other targets are `driver`, `board`, `commands`,
`references`, `measurements`, `injections` and `files`. Half of the input is noise, the other half
are valid messages with a few changed bits or fields; `files` are sound files with some damage. The
seeds of failed blocks are kept in `--corpus` and tried first next time.
"""

from __future__ import annotations

import json
import random
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from pam_check.fuzz.random_targets import TARGETS as INTERFACES
from pam_check.fuzz.random_targets import Target
from pam_model.argument_types import make_parents
from pam_model.command_line import Arguments, Outcome
from pam_model.common_options import chosen_rig
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig


def _files(rig: Rig) -> Target:
    from pam_check.fuzz.damaged_files import files_target  # noqa: PLC0415  (readers of all formats)

    return files_target(rig)


TARGETS: Final[Mapping[str, Callable[[Rig], Target]]] = {**INTERFACES, "files": _files}
"""All targets; `files` damages files of every kind that is read, about 30 a second."""
BLOCK = 1000  # inputs per seed; few, so that a failure is reproduced quickly


def fuzz(rig: Rig, name: str, count: int, seed: int, corpus: Sequence[int] = ()) -> dict[int, str]:
    """Run a target on `count` inputs; return the failures by the seed of their block.

    Parameters
    ----------
    rig : Rig
        The rig whose names are used.
    name : str
        A key of TARGETS.
    count : int
        Number of inputs, in blocks of BLOCK.
    seed : int
        Seed of the first block.
    corpus : sequence of int
        Seeds that failed before; they are tried first.
    """
    failed: dict[int, str] = {}
    blocks = max(1, count // BLOCK)
    target = TARGETS[name](rig)
    for block in (*corpus, *range(seed, seed + blocks)):
        draw = random.Random(block)
        try:
            for _ in range(BLOCK):
                target(draw)
        except Exception as error:  # every exception that escapes is a finding
            failed[block] = f"{type(error).__name__}: {error}"
            target = TARGETS[name](rig)
    return failed


def run(given: Arguments) -> Outcome:
    """Fuzz, print the result and keep failed seeds; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        For a rig or a target that cannot be used, or a file that is no corpus.
    """
    rig = load_rig(chosen_rig(given))
    if given.target not in (*TARGETS, "all"):
        raise PamError(f"no target {given.target!r}; there are {', '.join(TARGETS)} and all")
    results = []
    for name in TARGETS if given.target == "all" else [given.target]:
        path = given.corpus / f"{name}.json"
        known = _kept_seeds(path)
        start = time.monotonic()
        failed = fuzz(rig, name, given.count, given.seed, [int(key) for key in known])
        rate = given.count / (time.monotonic() - start)
        print(f"{name}: {given.count} inputs, {len(failed)} blocks failed, {rate:.0f}/s")
        for block, text in list(failed.items())[:5]:
            print(f"  seed {block}: {text[:300]}", file=sys.stderr)
        if failed:
            make_parents(path).write_text(json.dumps(known | failed, indent=1), encoding="utf-8")
        results.append({"target": name, "inputs": given.count, "failed": failed})
    return Outcome(
        results,
        [f"{r['target']}: {len(r['failed'])} blocks failed" for r in results if r["failed"]],
    )


def _kept_seeds(path: Path) -> dict[str, str]:
    """Read the earlier failures by seed.

    Raises
    ------
    PamError
        For a file with other contents.
    """
    if not path.exists():
        return {}
    try:
        kept: Any = json.loads(path.read_text(encoding="utf-8"))
        return {str(int(key)): str(text) for key, text in kept.items()}
    except (ValueError, AttributeError):
        raise PamError(f"{path}: no corpus of seeds; remove it or name another --corpus") from None
