"""Steps a block of lanes of which each has commands of its own; batch_kernel.py has shared ones."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from pam_model.plant.compiled import entry_point, for_kernel
from pam_model.plant.kernel import WORK_ROWS, record, run
from pam_model.plant.lane_blocks import Lanes
from pam_model.plant.lane_kernel import advance_lanes, with_loops
from pam_model.plant.lane_twins import LANES, SINGLE, Variant
from pam_model.plant.layout import outputs_of

Array = npt.NDArray[np.float64]

# Loops over the lanes, which are defined for each kernel.
record_lanes: Any = None
advance_block: Any = None


def step_block(
    active: int,
    c: Any,
    tables: Any,
    commands: Any,
    at: int,
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
    drive: Any,
    output: Any,
) -> None:
    """Simulate one sample of a block and write its outputs."""
    advance_block(
        active, c, tables, y, k1, k2, k3, k4, ys, held, contact, torque, drive, commands, at,
        False, sample_time, steps,
    )  # fmt: skip
    record_lanes(active, c, tables, y, output)


@cache
def _compiled_step(variant: Variant) -> Callable[..., None]:
    """`step_block` compiled for a variant of the plant."""
    made = with_loops(step_block, (record,), variant)
    made.__globals__["advance_block"] = advance_lanes(variant, own_commands=True)
    return entry_point(made)


class SteppedBlock:
    """A block of lanes that keeps its state, side by side as its kernel takes it.

    Parameters
    ----------
    group : Lanes
        One or several lanes.
    constants : (n_batch, n_constants) array
        Of each plant of the batch.
    states : (n_batch, n_states) array
        Of each plant.
    tables : tuple of arrays
        Force table of each muscle, as the kernels take them.
    """

    def __init__(self, group: Lanes, constants: Array, states: Array, tables: Any) -> None:
        self.members = group.members
        self._group, self._tables = group, tables
        width, muscles = group.width, len(tables)
        n_states, n_outputs = states.shape[1], outputs_of(muscles)
        self._c, self._y = group.side_by_side(constants), group.side_by_side(states)
        self._commands = np.zeros((width, 0, muscles))
        self._output = np.zeros(n_outputs * width)
        self._scratch = (
            *(np.zeros(n_states * width) for _ in range(5)),
            np.zeros(muscles * width),
            np.zeros(2 * width),
            np.zeros(width),
            np.zeros(1 + muscles),
        )
        self._alone = (
            for_kernel(np.zeros(0)),
            for_kernel(np.zeros((0, muscles))),
            for_kernel(np.zeros((WORK_ROWS, n_states))),
            for_kernel(np.zeros((1, n_outputs))),
        )

    @property
    def states(self) -> Array:
        """Of its members, (n_member, n_states)."""
        width = self._group.width
        y = np.asarray(self._y, dtype=float).reshape(-1, width)
        return y.T[: len(self.members)]

    def step(self, commands: Array, sample_time: float, longest_step: float) -> Array:
        """Simulate one sample; return the outputs of the members, (n_member, n_outputs).

        Parameters
        ----------
        commands : (n_member, n_rows, n_muscles) array
            Of each member; the last row holds now, those before it are the past.
        sample_time, longest_step : float
            Of a row, and of an integration step at most [s].
        """
        if self._group.variant is SINGLE:
            return self._step_alone(commands[0], sample_time, longest_step)
        if self._commands.shape[1] != commands.shape[1]:
            self._commands = np.zeros((self._group.width, *commands.shape[1:]))
        self._commands[: len(commands)] = commands
        self._commands[len(commands) :] = commands[-1]
        _compiled_step(self._group.variant)(
            self._group.active, self._c, self._tables, self._commands, commands.shape[1] - 1,
            sample_time, self._group.steps, self._y, *self._scratch, self._output,
        )  # fmt: skip
        return self._output.reshape(-1, LANES).T[: len(self.members)]

    def _step_alone(self, commands: Array, sample_time: float, longest_step: float) -> Array:
        none, no_pressures, work, row = self._alone
        run(
            self._c, self._tables, for_kernel(commands), len(commands) - 1, none, no_pressures,
            False, sample_time, longest_step, self._y, work, row,
        )  # fmt: skip
        record(self._c, self._tables, self._y, row[0])
        return np.asarray(row, dtype=float)
