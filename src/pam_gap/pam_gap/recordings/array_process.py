"""Reads MAT and HDF5 files in a process of its own, which a damaged file may end or hold.

The libraries of both formats are written in C. On damage they may end the process by a memory
access (scipy with MAT 5), search without an end (HDF5 with texts in a heap), or allocate what a
header claims. The process has limits of processor time and memory, and its end is an error of the
file.
"""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import IO, Any, Final

import numpy as np

from pam_gap.recordings.array_files import HDF5, MAT, read_arrays
from pam_gap.recordings.size_limits import MOST_BYTES
from pam_model.reading import reason

APART: Final = (*MAT, *HDF5)
"""Endings of the files that are read by another process."""
_PROGRAM: Final = (
    "import sys; from pam_gap.recordings.array_process import serve; sys.exit(serve(sys.argv[1]))"
)
_LEAST_TIME: Final = 5.0
"""Processor time [s] that every file may take, the start of the process included."""
_SLOWEST: Final = 4e6
"""Bytes of the file for which one more second is allowed; packed arrays are read much faster."""
_MOST_MEMORY: Final = 3 * MOST_BYTES
"""Bytes of address space: the file's arrays, a copy of the largest, and the libraries."""


def read_arrays_apart(path: Path) -> dict[str, Any]:
    """`array_files.read_arrays` of a MAT or HDF5 file, done by another process.

    Raises
    ------
    ValueError
        When the file is damaged or holds no numbers, for a caller within `reading`.
    """
    with tempfile.TemporaryFile() as columns:
        ended = subprocess.run(
            [sys.executable, "-c", _PROGRAM, str(path.resolve())],
            stdin=subprocess.DEVNULL,
            stdout=columns,
            stderr=subprocess.PIPE,
            env={
                **os.environ,
                "PYTHONPATH": os.pathsep.join(place for place in sys.path if place),
                "OPENBLAS_NUM_THREADS": "1",  # the buffers of each thread count as memory
            },
            check=False,
        )
        if ended.returncode == 0:
            columns.seek(0)
            names = np.load(columns, allow_pickle=False)
            return {str(name): np.load(columns, allow_pickle=False) for name in names}
    raise ValueError(_why(ended.returncode, ended.stderr.decode(errors="replace")))


def _why(code: int, said: str) -> str:
    """What ended the process, in one line."""
    if code == -signal.SIGXCPU:
        return "the library that reads it did not come to an end; the file is damaged"
    if code < 0:
        return f"it ends the library that reads it by {signal.Signals(-code).name}; it is damaged"
    return said.strip().rpartition("\n")[2]


def serve(path: str) -> int:
    """Read one file and write its columns to standard output, as the other process expects them.

    Returns
    -------
    int
        0, or 1 when the file cannot be read; then the reason is the last line of standard error.
    """
    _limit(Path(path))
    with os.fdopen(os.dup(1), "wb") as answer:
        os.dup2(2, 1)  # what a library prints is no answer
        try:
            _write(answer, read_arrays(Path(path)))
        except Exception as error:  # whatever it is, it is the file's
            print(reason(error), file=sys.stderr)
            return 1
    return 0


def _write(answer: IO[bytes], columns: dict[str, Any]) -> None:
    np.save(answer, np.array(list(columns), dtype=np.str_), allow_pickle=False)
    for column in columns.values():
        np.save(answer, column, allow_pickle=False)


def _limit(path: Path) -> None:
    seconds = int(_LEAST_TIME + path.stat().st_size / _SLOWEST)
    for kind, most in (
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_AS, _MOST_MEMORY),
        (resource.RLIMIT_CORE, 0),
    ):
        hard = resource.getrlimit(kind)[1]
        least = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(kind, (least, hard))
