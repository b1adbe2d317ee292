"""Compiles a faster kernel in a thread of its own, while the work goes on with a slower one.

The compilation takes about ten seconds once on a machine; numba keeps its result on disk. Nobody
has to wait for it, because both kernels give the same result.
"""

from __future__ import annotations

import sys
import threading
from collections import Counter
from collections.abc import Callable, Hashable
from functools import partial
from typing import Final

import numpy as np
import numpy.typing as npt

from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.plant.lane_blocks import FEW
from pam_model.plant.lane_kernel import LaneKernel, lane_kernels

WORTH: Final = 4_000_000
"""Samples or steps of one joint that a kernel must have to simulate: about a second of work."""
SWITCH_INTERVAL: Final = 5e-4
"""Longest time [s] that the compilation keeps the interpreter from the work."""


class CompileBeside:
    """Kernels that are compiled when a process has work for them."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._threads: dict[Hashable, threading.Thread] = {}
        self._failed: set[Hashable] = set()
        self._work: Counter[Hashable] = Counter()

    def is_ready(self, kernel: Hashable, work: int, compile_it: Callable[[], object]) -> bool:
        """Whether a kernel is compiled; if it is worth it, its compilation begins.

        Parameters
        ----------
        kernel : hashable
            Its name.
        work : int
            Samples or steps that it could simulate now.
        compile_it : callable
            Calls the kernel once.
        """
        with self._lock:
            self._work[kernel] += work
            thread = self._threads.get(kernel)
            if thread is None and self._work[kernel] >= WORTH:
                arguments = (kernel, compile_it)
                thread = threading.Thread(target=self._run, args=arguments, name="compile")
                self._threads[kernel] = thread
                thread.start()
                return False
        return thread is not None and not thread.is_alive() and kernel not in self._failed

    def ready_kernels(
        self,
        constants: npt.NDArray[np.float64],
        work: int,
        compile_it: Callable[[LaneKernel, int], object],
    ) -> list[LaneKernel]:
        """The kernels for the lanes of a batch that are compiled; none without numba.

        Parameters
        ----------
        constants : (n_batch, n_constants) array
            Of each plant.
        work : int
            As for `is_ready`, of one lane.
        compile_it : callable
            Calls a kernel once, for lanes that are all like the one with this number.
        """
        ready, left = [], np.full(len(constants), HAVE_NUMBA)
        for kernel in lane_kernels(constants):
            own = np.flatnonzero(kernel.serves & left)
            if own.size > FEW and self.is_ready(
                kernel.off, own.size * work, partial(compile_it, kernel, int(own[0]))
            ):
                ready.append(kernel)
            left[own] = False
        return ready

    def _run(self, kernel: Hashable, compile_it: Callable[[], object]) -> None:
        usual = sys.getswitchinterval()
        sys.setswitchinterval(min(usual, SWITCH_INTERVAL))
        self._failed.add(kernel)  # until it has run without an error
        try:
            compile_it()
            self._failed.discard(kernel)
        finally:
            sys.setswitchinterval(usual)
