"""Simulates a block of lanes and writes what they do: `kernel.run` for several joints side by side.

Motion and pressures are not prescribed here (lane_kernel.py).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from pam_model.plant.compiled import entry_point
from pam_model.plant.kernel import record
from pam_model.plant.lane_blocks import Lanes, in_lines
from pam_model.plant.lane_kernel import advance_lanes, with_loops
from pam_model.plant.lane_twins import LANES, Variant

Array = npt.NDArray[np.float64]

# Loops over the lanes, which are defined for each kernel.
record_lanes: Any = None
advance_block: Any = None


def run_block(
    active: int,
    members: Any,
    c: Any,
    tables: Any,
    commands: Any,
    shut: bool,
    sample_time: float,
    steps: int,
    y: Any,
    k1: Any,
    k2: Any,
    k3: Any,
    k4: Any,
    ys: Any,
    held: Any,
    contact: Any,
    torque: Any,
    output: Any,
    drive: Any,
    outputs: Any,
) -> None:
    """Simulate a block; `outputs[members[lane], k]` is lane `lane` when command row k begins."""
    for k in range(len(commands)):
        record_lanes(active, c, tables, y, output)
        for lane in range(len(members)):
            for i in range(len(output) // LANES):
                outputs[members[lane], k, i] = output[i * LANES + lane]
        advance_block(
            active, c, tables, y, k1, k2, k3, k4, ys, held, contact, torque, drive, commands, k,
            shut, sample_time, steps,
        )  # fmt: skip


@cache
def _compiled_run(variant: Variant) -> Callable[..., None]:
    """`run_block` compiled for a variant of the plant."""
    made = with_loops(run_block, (record,), variant)
    made.__globals__["advance_block"] = advance_lanes(variant)
    return entry_point(made)


def simulate_block(
    group: Lanes,
    constants: Array,
    tables: Any,
    commands: Array,
    states: Array,
    outputs: Array,
    *,
    sample_time: float,
    shut: bool,
) -> None:
    """Simulate the members of a block; write their outputs, and their states at the end.

    Parameters
    ----------
    group : Lanes
        Several lanes.
    constants : (n_batch, n_constants) array
        Of each plant of the batch.
    tables : tuple of arrays
        Force table of each muscle.
    commands : (n, n_muscles) array
        As for `simulate`.
    states : (n_batch, n_states) array
        Of each plant, before and after.
    outputs : (n_batch, n, n_outputs) array
        In the order of layout.output_names.
    sample_time : float
        [s].
    shut : bool
        The valves stay shut regardless of the commands.
    """
    width = group.width
    y = group.side_by_side(states)
    muscles = len(tables)
    _compiled_run(group.variant)(
        group.active,
        group.members,
        group.side_by_side(constants),
        tables,
        commands,
        shut,
        sample_time,
        group.steps,
        y,
        *(in_lines(np.zeros(states.shape[1] * width)) for _ in range(5)),
        in_lines(np.zeros(muscles * width)),
        in_lines(np.zeros(2 * width)),
        in_lines(np.zeros(width)),
        in_lines(np.zeros(outputs.shape[2] * width)),
        np.zeros(1 + muscles),
        outputs,
    )
    states[group.members] = y.reshape(-1, width).T[: len(group.members)]
