"""Compile a function with numba if it is installed; otherwise it remains plain Python.

The laws of effects, gas and friction are plain functions of floats that the whole suite calls. When
the plant compiles a function, the plain functions that it calls by name are compiled as well, so
that no law is written twice. The environment variable PAM_NO_NUMBA=1, or numba's own
NUMBA_DISABLE_JIT=1, forces plain Python. A compiled function takes arrays, a plain one takes lists,
because Python indexes a list about twenty times faster than a numpy array. `for_kernel` converts an
array to the right type.
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

from pam_model import body, gas, physics
from pam_model.effects.registry import effect_files

try:
    if os.environ.get("PAM_NO_NUMBA", "0") not in ("", "0"):
        raise ImportError
    import numba

    from pam_model.machine_code_cache import keep_machine_code

    HAVE_NUMBA = not numba.config.DISABLE_JIT
except ImportError:
    HAVE_NUMBA = False

_HERE = Path(__file__).parent
_NEVER_COMPILED = (
    "command_history",
    "compile_beside",
    "constants",
    "default_step",
    "force_table",
    "lane_blocks",
    "lane_choice",
    "mounting",
    "muscle_arms",
    "numbers_of_lanes",
    "parameters",
    "plant_batch",
    "robot_plant",
    "sensors",
    "simulate",
    "trajectory",
    "uneven_pulley",
    "written_numbers",
)


def kernel_sources() -> tuple[Path, ...]:
    """All source files on which the compiled plant depends."""
    return (
        *(path for path in sorted(_HERE.glob("*.py")) if path.stem not in _NEVER_COMPILED),
        *sorted(Path(body.__file__).parent.glob("*.py")),
        *sorted(Path(gas.__file__).parent.glob("*.py")),
        *sorted(Path(physics.__file__).parent.glob("*.py")),
        *effect_files(),
    )


def _cache_folder() -> str:
    """A folder named after a hash of the kernels' sources; "" if no folder can be written.

    It is in the folder of the package or, where the installation is read-only, in the user's cache
    folder. numba's own cache checks only the file of the outermost function. After a change in a
    function that this one calls, numba would continue to use the old machine code.
    """
    digest = hashlib.sha256()
    for source in kernel_sources():
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    name = f"numba-{digest.hexdigest()[:12]}"
    home = os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()
    for folder in (_HERE / "__pycache__" / name, Path(home) / "pam_model" / name):
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return str(folder)
    return ""


def _functions_of(function: Any, found: dict[Any, FunctionType]) -> None:
    """Collect a function and all functions that it calls by name, by their code."""
    function = getattr(function, "py_func", function)
    if not isinstance(function, FunctionType) or function.__code__ in found:
        return
    found[function.__code__] = function
    for name in function.__code__.co_names:
        _functions_of(function.__globals__.get(name), found)


def _cache_of(function: FunctionType) -> str:
    """Where the machine code of an entry point is kept; "" where numba chooses.

    An entry point of another package depends on the files of its own functions as well, and on the
    constants that they import.
    """
    found: dict[Any, FunctionType] = {}
    _functions_of(function, found)
    plant, own = set(map(str, kernel_sources())), hashlib.sha256()
    files = {code.co_filename for code in found if not code.co_filename.startswith("<")}
    if not _CACHE or files <= plant:
        return _CACHE
    for file in sorted(files - plant):
        own.update(Path(file).read_bytes())
    constants = {
        f"{name}={known!r}"
        for each in found.values()
        for name in each.__code__.co_names
        if isinstance(known := each.__globals__.get(name), int | float | tuple)
    }
    own.update(";".join(sorted(constants)).encode())
    folder = Path(_CACHE) / own.hexdigest()[:12]
    folder.mkdir(parents=True, exist_ok=True)
    return str(folder)


_CACHE = _cache_folder() if HAVE_NUMBA and not os.environ.get("NUMBA_CACHE_DIR") else ""
_COMPILED: dict[tuple[FunctionType, bool], Any] = {}
FUSED = {"contract"}
"""What a compiler may do with fused functions: round a product and a sum together, once."""


def _with_compiled_calls(function: FunctionType, fused: bool) -> FunctionType:
    """A copy of a function in which the functions that it calls by name are compiled like it."""
    known = function.__globals__
    called = {}
    for name in function.__code__.co_names:
        value = known.get(name)
        if fused and not _is_fused(value):
            value = getattr(value, "py_func", value)
        if isinstance(value, FunctionType):
            called[name] = _compiled(value, cache=False, fused=fused)
    if not (called or fused):
        return function
    copy = FunctionType(
        function.__code__,
        {**known, **called},
        function.__name__,
        function.__defaults__,
        function.__closure__,
    )
    copy.__qualname__, copy.__module__ = function.__qualname__, function.__module__
    if fused:
        copy.__qualname__ += "_fused"
    return copy


def _is_fused(function: Any) -> bool:
    return bool(getattr(function, "targetoptions", {}).get("fastmath"))


def compiled[F: Callable[..., Any]](function: F) -> F:
    """Decorate a function of floats and arrays; without fast-math, results equal plain Python's."""
    return _compiled(function, cache=False)


def compiled_fused[F: Callable[..., Any]](function: F) -> F:
    """As `compiled`, with all that it calls, but products and sums may be rounded together.

    Results then differ from plain Python's in the last digits, by the processor that computes them.
    """
    return _compiled(function, cache=False, fused=True)


def entry_point[F: Callable[..., Any]](function: F) -> F:
    """Decorate a compiled function that Python calls: its machine code is cached on disk.

    The machine code of an entry point contains all functions that it calls.
    """
    return _compiled(function, cache=True)


def shared_entry_point[F: Callable[..., Any]](function: F) -> F:
    """An entry point that others call as well: it is not inlined, which compiles sooner."""
    return _compiled(function, cache=True, inlined=False)


def fused_entry_point[F: Callable[..., Any]](function: F) -> F:
    """An entry point that is compiled like `compiled_fused`, with all that it calls."""
    return _compiled(function, cache=True, fused=True)


def compiled_loop[F: Callable[..., Any]](function: F) -> F:
    """Compile a loop over lanes; it stays a function of its own, so that it becomes vector code."""
    return _compiled(function, cache=False, inlined=False)


def _compiled[F: Callable[..., Any]](
    function: F, *, cache: bool, inlined: bool = True, fused: bool = False
) -> F:
    if not HAVE_NUMBA:
        return function
    assert isinstance(function, FunctionType)
    if (function, fused) in _COMPILED:
        return _COMPILED[function, fused]  # type: ignore[no-any-return]
    given = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = (_cache_of(function) if cache else _CACHE) or given
    try:
        # numpy's error model saves a branch per division; the kernels check their divisors
        # themselves. They allocate nothing, so they need no reference counting (_nrt).
        result: F = numba.njit(
            error_model="numpy",
            nogil=True,
            forceinline=inlined,
            _nrt=False,
            fastmath=FUSED if fused else False,
        )(_with_compiled_calls(function, fused))
        if cache:
            keep_machine_code(result)
    finally:
        numba.config.CACHE_DIR = given
    _COMPILED[function, fused] = result
    return result


def is_on_disk(name: str) -> bool:
    """Whether the cache holds machine code of the entry point with this qualified name.

    It may be out of date; numba then compiles the entry point again.
    """
    folder = _CACHE or (numba.config.CACHE_DIR if HAVE_NUMBA else "")
    return bool(folder) and any(Path(folder).rglob(f"*.{name}-*.nbi"))


def for_kernel(array: npt.NDArray[Any]) -> Any:
    """The array for a compiled kernel, or nested lists of Python floats for a plain one."""
    return np.ascontiguousarray(array) if HAVE_NUMBA else array.tolist()


def prepare(function: Any, *arguments: Any) -> None:
    """Compile an entry point for arguments of these types, or read it from disk; nothing is run."""
    if HAVE_NUMBA:
        function.compile(tuple(map(numba.typeof, arguments)))


def listed_column(array: Any, place: int) -> list[Any]:
    """The same of one number of each row, which may lie in further rows."""
    if HAVE_NUMBA:
        return array[..., place].tolist()  # type: ignore[no-any-return]
    nested = isinstance(array[0][0], list)
    return [listed_column(row, place) if nested else row[place] for row in array]


def listed(array: Any) -> list[Any]:
    """What `for_kernel` made, as nested lists of Python floats."""
    return array if isinstance(array, list) else array.tolist()
