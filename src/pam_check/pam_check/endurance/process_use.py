"""Resources that a process uses, read from /proc."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple


class Use(NamedTuple):
    """Number of threads, file handles and sockets (a part of the handles); memory [byte]."""

    threads: int
    handles: int
    sockets: int
    memory: int


def use_of(pid: int | None = None) -> Use:
    """Present resources of a process; by default of this one."""
    folder = Path("/proc") / str(os.getpid() if pid is None else pid)
    fields = dict(
        line.split(":", 1) for line in (folder / "status").read_text().splitlines() if ":" in line
    )
    handles = list((folder / "fd").iterdir())
    targets = [str(handle.readlink()) for handle in handles if handle.is_symlink()]
    sockets = sum(target.startswith("socket:") for target in targets)
    memory = int(fields["VmRSS"].split()[0]) * 1024
    return Use(int(fields["Threads"]), len(handles), sockets, memory)
