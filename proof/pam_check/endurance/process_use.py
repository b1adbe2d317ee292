"""Resources that a process uses, read from /proc."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

from pam_model.errors import PamError


class Use(NamedTuple):
    """Number of threads, file handles and sockets (a part of the handles); memory [byte]."""

    threads: int
    handles: int
    sockets: int
    memory: int


def use_of(pid: int | None = None) -> Use:
    """Present resources of a process; by default of this one.

    Raises
    ------
    PamError
        When the process has ended.
    """
    number = os.getpid() if pid is None else pid
    folder = Path("/proc") / str(number)
    try:
        lines = (folder / "status").read_text().splitlines()
        handles = list((folder / "fd").iterdir())
    except OSError as error:
        raise PamError(f"process {number} has ended: its resources are unknown") from error
    fields = dict(line.split(":", 1) for line in lines if ":" in line)
    if "VmRSS" not in fields:  # ended, but its parent has not taken note of it
        raise PamError(f"process {number} has ended: its resources are unknown")
    sockets = sum(_target(handle).startswith("socket:") for handle in handles)
    memory = int(fields["VmRSS"].split()[0]) * 1024
    return Use(int(fields["Threads"]), len(handles), sockets, memory)


def _target(handle: Path) -> str:
    """What a file handle leads to; nothing if it was closed meanwhile."""
    try:
        return str(handle.readlink())
    except OSError:
        return ""
