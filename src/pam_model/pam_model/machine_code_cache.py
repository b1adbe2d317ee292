"""numba's cache of machine code on disk, with which a damaged or a full disk costs only time.

numba lets the process end when a file of its cache cannot be written or read. After a power cut
such files may be empty, and neither simulation nor diagnosis would start until somebody deletes
them.
"""

from __future__ import annotations

import contextlib
import logging
from typing import Any

from numba.core.caching import FunctionCache
from numba.core.runtime import rtsys

_log = logging.getLogger(__name__)


class MachineCodeCache(FunctionCache):  # type: ignore[misc]
    """The cache of one compiled function."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled function for a signature; None if it has to be compiled."""
        try:
            # numba first imports all that it can compile (0.5 s and 100 MB). What is already
            # compiled needs only what allocates its arrays; without, it would end the process.
            rtsys.initialize(target_context)
            with self._guard_against_spurious_io_errors():
                return self._load_overload(sig, target_context)
        except Exception:  # pickle raises nearly anything for a damaged file
            with contextlib.suppress(OSError):
                self.flush()  # else the damaged index would be read again when it is saved
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a compiled function, if the disk permits it."""
        try:
            super().save_overload(sig, data)
        except OSError as error:
            _log.warning(
                "machine code cannot be kept in %s (%s): the next start compiles it again",
                self.cache_path,
                error.strerror,
            )


def keep_machine_code[F](function: F) -> F:
    """Let a function that numba compiles keep its machine code on disk, where a folder permits it.

    Parameters
    ----------
    function : numba dispatcher
        The result of `njit`, without `cache=True`.
    """
    dispatcher: Any = function
    # numba raises RuntimeError where it finds no folder that it can write to
    with contextlib.suppress(RuntimeError):
        dispatcher._cache = MachineCodeCache(dispatcher.py_func)
    return function
