"""Compiles a faster kernel in a thread of its own, while the work continues with a slower one.

The compilation takes about ten seconds once on a machine. Nobody has to wait for it, because all
kernels give the same result; one is compiled at a time. Numba keeps the machine code on disk, from
where it is read at once.
"""

from __future__ import annotations

import sys
import threading
from collections import Counter
from collections.abc import Callable, Hashable
from functools import cache, partial
from typing import Final

import numpy as np
import numpy.typing as npt

from pam_model.plant.compiled import HAVE_NUMBA, is_on_disk
from pam_model.plant.lane_choice import LaneKernel, lane_kernels
from pam_model.plant.lane_twins import LaneVariant, kernel_name

WORTH: Final = 4_000_000
"""Samples or steps of one joint that a kernel must have to simulate: about a second of work."""
SWITCH_INTERVAL: Final = 5e-4
"""Longest time [s] that the compilation keeps the interpreter from the work."""


READING: Final = 1.0
"""Longest time [s] that machine code on disk is waited for; reading it takes less than 0.1 s."""


@cache
def _on_disk(function: str, variant: LaneVariant) -> bool:
    return is_on_disk(f"{function}_{kernel_name(variant)}")


class CompileBeside:
    """Kernels that are compiled when a process has work for them.

    Parameters
    ----------
    function : str
        Qualified name of the function from which the kernels are made.
    """

    def __init__(self, function: str) -> None:
        self._function = function
        self._lock = threading.Lock()
        self._threads: dict[Hashable, threading.Thread] = {}
        self._failed: set[Hashable] = set()
        self._work: Counter[Hashable] = Counter()

    def is_ready(
        self, kernel: Hashable, work: int, compile_it: Callable[[], object], on_disk: bool = False
    ) -> bool:
        """Whether a kernel is compiled; if it is worth it, its compilation begins.

        Parameters
        ----------
        kernel : hashable
            Its name.
        work : int
            Samples or steps that it could simulate now.
        compile_it : callable
            Calls the kernel once.
        on_disk : bool
            Whether its machine code seems to be on disk, so that it is worth it for any work.
        """
        with self._lock:
            self._work[kernel] += work
            thread = self._threads.get(kernel)
            is_due = self._work[kernel] >= WORTH and not self._is_compiling()
            if thread is None and (on_disk or is_due):
                arguments = (kernel, compile_it)
                thread = threading.Thread(target=self._run, args=arguments, name="compile")
                self._threads[kernel] = thread
                thread.start()
                thread.join(READING if on_disk else 0.0)
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
            if own.size > kernel.few and self.is_ready(
                kernel.variant,
                own.size * work,
                partial(compile_it, kernel, int(own[0])),
                _on_disk(self._function, kernel.variant),
            ):
                ready.append(kernel)
            left[own] = False
        return ready

    def _is_compiling(self) -> bool:
        return any(thread.is_alive() for thread in self._threads.values())

    def _run(self, kernel: Hashable, compile_it: Callable[[], object]) -> None:
        usual = sys.getswitchinterval()
        sys.setswitchinterval(min(usual, SWITCH_INTERVAL))
        self._failed.add(kernel)  # until it has run without an error
        try:
            compile_it()
            self._failed.discard(kernel)
        finally:
            sys.setswitchinterval(usual)
