"""Compile a function with numba where it is installed, leave it plain Python where it is not.

Laws of effects, of the gas and of friction are plain functions of floats that everyone calls. When
the plant compiles a function, plain functions that it calls by name are compiled with it, so that
no law is written twice. The environment variable PAM_NO_NUMBA=1 forces plain Python. A compiled
function takes arrays, a plain one lists: `for_kernel` makes the right one, since indexing a numpy
array from Python costs twenty times a list's.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np
import numpy.typing as npt

from pam_model import gas, physics
from pam_model.effects.registry import effect_files

try:
    if os.environ.get("PAM_NO_NUMBA", "0") not in ("", "0"):
        raise ImportError
    import numba

    HAVE_NUMBA = True
except ImportError:
    HAVE_NUMBA = False

_HERE = Path(__file__).parent
_NEVER_COMPILED = ("constants", "force_table", "parameters", "sensors", "simulate", "trajectory")


def kernel_sources() -> tuple[Path, ...]:
    """Every file whose text the compiled plant depends on."""
    return (
        *(path for path in sorted(_HERE.glob("*.py")) if path.stem not in _NEVER_COMPILED),
        *sorted(Path(gas.__file__).parent.glob("*.py")),
        *sorted(Path(physics.__file__).parent.glob("*.py")),
        *effect_files(),
    )


def _cache_folder() -> str:
    """A folder named after the kernels' sources, "" where none can be written.

    numba's own cache looks at the file of the outermost function alone and would go on using an
    old compilation of what it calls.
    """
    digest = hashlib.sha256()
    for source in kernel_sources():
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    folder = _HERE / "__pycache__" / f"numba-{digest.hexdigest()[:12]}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return ""
    return str(folder) if os.access(folder, os.W_OK) else ""


_CACHE = _cache_folder() if HAVE_NUMBA and not os.environ.get("NUMBA_CACHE_DIR") else ""
_COMPILED: dict[FunctionType, Any] = {}


def _with_compiled_calls(function: FunctionType) -> FunctionType:
    """A copy of a function in which the plain functions that it calls by name are compiled."""
    known = function.__globals__
    called = {
        name: compiled(known[name])
        for name in function.__code__.co_names
        if isinstance(known.get(name), FunctionType)
    }
    if not called:
        return function
    copy = FunctionType(
        function.__code__,
        {**known, **called},
        function.__name__,
        function.__defaults__,
        function.__closure__,
    )
    copy.__qualname__, copy.__module__ = function.__qualname__, function.__module__
    return copy


def compiled[F: Callable[..., Any]](function: F) -> F:
    """Decorate a function of floats and arrays; no fast-math, so that Python gives the same."""
    return _compiled(function, cache=False)


def entry_point[F: Callable[..., Any]](function: F) -> F:
    """Decorate a compiled function that Python itself calls: its machine code is kept on disk.

    The machine code of an entry point holds that of all functions it calls.
    """
    return _compiled(function, cache=True)


def _compiled[F: Callable[..., Any]](function: F, *, cache: bool) -> F:
    if not HAVE_NUMBA:
        return function
    assert isinstance(function, FunctionType)
    if function in _COMPILED:
        return _COMPILED[function]  # type: ignore[no-any-return]
    given = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = _CACHE or given
    try:
        # numpy's error model: no branch per division; the kernels guard their divisors
        # themselves. They allocate nothing, so reference counting is left out.
        result: F = numba.njit(
            cache=cache, error_model="numpy", nogil=True, forceinline=True, _nrt=False
        )(_with_compiled_calls(function))
    finally:
        numba.config.CACHE_DIR = given
    _COMPILED[function] = result
    return result


def for_kernel(array: npt.NDArray[Any]) -> Any:
    """The array itself for a compiled kernel, nested lists of Python floats for a plain one."""
    return np.ascontiguousarray(array) if HAVE_NUMBA else array.tolist()
