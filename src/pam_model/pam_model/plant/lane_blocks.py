"""Batches of parameter vectors, sorted into blocks of lanes that are simulated side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.plant.kernel import step_count
from pam_model.plant.lane_choice import VECTOR, LaneKernel
from pam_model.plant.lane_twins import LANES, SINGLE, Variant
from pam_model.plant.layout import C_RATE

Array = npt.NDArray[np.float64]

_STEP_COUNT: Final = getattr(step_count, "py_func", step_count)
"""In plain Python: for its own call, a process would compile it, which takes half a second."""
LINE: Final = 64
"""Bytes of a line of the processor's cache, and of its longest vectors."""


@dataclass(frozen=True, slots=True)
class Lanes:
    """One block of lanes."""

    members: npt.NDArray[np.int64]  # rows of the batch, at most LANES
    steps: int  # integration steps in one sample
    variant: Variant  # for which the kernel of the block is made; SINGLE for that of a single lane
    vector: int = VECTOR

    @property
    def width(self) -> int:
        """Number of lanes in the arrays of the block."""
        return 1 if self.variant is SINGLE else LANES

    @property
    def active(self) -> int:
        """Number of lanes that are simulated; those beyond `members` repeat the last one."""
        return min(-(-len(self.members) // self.vector) * self.vector, self.width)

    def side_by_side(self, rows: Array) -> Any:
        """Entries of the block's rows as the kernels take them: entry i of lane j at i width + j.

        Parameters
        ----------
        rows : (n_batch, n) array
            One row per member of the batch.
        """
        places = np.minimum(np.arange(self.width), len(self.members) - 1)
        return in_lines(rows[self.members[places]].T.ravel())


def in_lines(row: Array) -> Any:
    """The row for a compiled kernel, from the start of a cache line on: no vector lies in two."""
    if not HAVE_NUMBA:
        return row.tolist()
    spare = LINE // row.itemsize
    longer = np.empty(row.size + spare)
    first = -longer.ctypes.data % LINE // row.itemsize
    longer[first : first + row.size] = row
    return longer[first : first + row.size]


def blocks_of_lanes(
    constants: Array,
    kernels: Sequence[LaneKernel],
    sample_time: float,
    step: float,
    threads: int = 1,
) -> list[Lanes]:
    """Sort a batch into blocks of lanes with equal steps, and single lanes; most steps first.

    Parameters
    ----------
    constants : (n_batch, n_constants) array
        Of each plant.
    kernels : sequence of LaneKernel
        The kernels for several lanes, the fastest one first. A lane takes the first one that serves
        it and enough others.
    sample_time, step : float
        Sample time and longest integration step [s].
    threads : int, optional
        Number of blocks that run at the same time; lanes are shared out among so many.
    """
    steps = np.array([_STEP_COUNT(r, sample_time, step) for r in constants[:, C_RATE].tolist()])
    found: list[Lanes] = []
    alone = np.full(len(constants), True)
    for kernel in kernels:
        for count in np.unique(steps[kernel.serves & alone]):
            members = np.flatnonzero(kernel.serves & alone & (steps == count))
            share = -(-len(members) // threads)
            size = min(-(-share // kernel.vector) * kernel.vector, LANES)
            for first in range(0, len(members), size):
                block = members[first : first + size]
                if len(block) > kernel.few:
                    found.append(Lanes(block, int(count), kernel.variant, kernel.vector))
                    alone[block] = False
    found += [Lanes(np.array([i]), int(steps[i]), SINGLE) for i in np.flatnonzero(alone)]
    return sorted(found, key=lambda one: -one.steps)
