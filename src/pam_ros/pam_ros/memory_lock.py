"""Keeps the memory of a process in RAM, so that no page has to be read from the disk in a cycle.

Linux may take pages of a program away that were not used for a while, even where there is no swap,
because it can read them again from the file. A thread with a real-time priority then still waits
for the disk. Source: mlockall(2), section
"Real-time processes".
"""

from __future__ import annotations

import ctypes
import os
import sys
from typing import Final

# asm-generic/mman.h; Python's standard library has no names for them
_CURRENT: Final = 1
_FUTURE: Final = 2
_ON_FAULT: Final = 4  # pages that were never used need no memory (Linux 4.4)


def lock_memory() -> bool:
    """Lock the pages that this process uses now, and later ones where nothing limits them.

    Under a limit, later pages are left alone: a process at its limit would get no more memory.

    Returns
    -------
    bool
        Whether they are locked; not, if the system does not permit it (RLIMIT_MEMLOCK or
        CAP_IPC_LOCK) or has no such call.
    """
    if not sys.platform.startswith("linux"):
        return False
    import resource  # noqa: PLC0415  (Unix alone has it)

    call = ctypes.CDLL(None, use_errno=True).mlockall
    unlimited = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] == resource.RLIM_INFINITY
    if unlimited or os.geteuid() == 0:
        return bool(call(_CURRENT | _FUTURE | _ON_FAULT) == 0)
    return bool(call(_CURRENT | _ON_FAULT) == 0)
