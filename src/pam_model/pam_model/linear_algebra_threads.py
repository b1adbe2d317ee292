"""Linear algebra with one thread, so that a result does not depend on the machine's processors.

A BLAS with several threads adds in another order. The difference is in the last digits, but a fit
of many parameters can then end in another minimum, and a near tie can be decided differently.
"""

from __future__ import annotations

import os
from typing import Final

ONE_THREAD: Final = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
"""Environment of a process whose linear algebra has one thread."""


def use_one_thread() -> None:
    """Give this process that environment; without effect once NumPy or SciPy is imported.

    What the user has set himself stays.
    """
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)
