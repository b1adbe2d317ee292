"""Compile a function with numba where it is installed, leave it plain Python where it is not.

The environment variable PAM_NO_NUMBA=1 forces plain Python. A compiled function takes arrays, a
plain one lists: `for_kernel` makes the right one, since indexing a numpy array from Python costs
twenty times a list's.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pam_model.effects import bladder_elasticity

try:
    if os.environ.get("PAM_NO_NUMBA", "0") not in ("", "0"):
        raise ImportError
    import numba

    HAVE_NUMBA = True
except ImportError:
    HAVE_NUMBA = False

_HERE = Path(__file__).parent
KERNEL_SOURCES = (
    *(
        _HERE / name
        for name in (
            "compiled.py",
            "layout.py",
            "gas_stage.py",
            "muscle_stage.py",
            "joint_stage.py",
            "kernel.py",
        )
    ),
    Path(bladder_elasticity.__file__),
)


def _cache_folder() -> str:
    """A folder named after the kernels' sources, "" where none can be written.

    numba's own cache looks at the file of the outermost function alone and would go on using an
    old compilation of what it calls.
    """
    digest = hashlib.sha256()
    for source in KERNEL_SOURCES:
        digest.update(source.read_bytes())
    folder = _HERE / "__pycache__" / f"numba-{digest.hexdigest()[:12]}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return ""
    return str(folder) if os.access(folder, os.W_OK) else ""


_CACHE = _cache_folder() if HAVE_NUMBA and not os.environ.get("NUMBA_CACHE_DIR") else ""


def compiled[F: Callable[..., Any]](function: F) -> F:
    """Decorate a function of floats and arrays; no fast-math, so that Python gives the same."""
    if not HAVE_NUMBA:
        return function
    given = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = _CACHE or given
    try:
        # numpy's error model: no branch per division; the kernels guard their divisors
        # themselves. They allocate nothing, so reference counting is left out.
        result: F = numba.njit(
            cache=True, error_model="numpy", nogil=True, forceinline=True, _nrt=False
        )(function)
    finally:
        numba.config.CACHE_DIR = given
    return result


def for_kernel(array: npt.NDArray[Any]) -> Any:
    """The array itself for a compiled kernel, nested lists of Python floats for a plain one."""
    return np.ascontiguousarray(array) if HAVE_NUMBA else array.tolist()
