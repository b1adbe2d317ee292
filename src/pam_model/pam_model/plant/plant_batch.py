"""Many joints, simulated step by step side by side, each with commands of its own.

`Plant` steps one joint; a batch steps 64 of them in hardly more than the time of a few, because
their numbers lie in the vectors of the processor (lane_kernel.py). The results are the same.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from pam_model.bounds import within
from pam_model.errors import PamError
from pam_model.plant import layout as lay
from pam_model.plant.compiled import HAVE_NUMBA, for_kernel
from pam_model.plant.constants import derive_constants
from pam_model.plant.default_step import DEFAULT_STEP
from pam_model.plant.kernel import record
from pam_model.plant.lane_blocks import blocks_of_lanes
from pam_model.plant.lane_choice import lane_kernels
from pam_model.plant.own_commands_kernel import SteppedBlock
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.sensors import SensorBank

Array = npt.NDArray[np.float64]


class PlantBatch:
    """Joints with equal muscle models and unequal numbers.

    The first step compiles a kernel for the laws that occur, once on a machine (10 to 30 s).

    Parameters
    ----------
    parameters : PlantParameters
        Gives the force tables.
    values : (n, n_parameters) array
        The numbers of each joint, as `PlantParameters.values`.
    states : (n, n_states) array
        The initial states, as of `initial_state`.
    period : float
        Time of a step, during which the commands hold [s].
    step : float, optional
        Longest step of the integration [s].

    Raises
    ------
    PamError
        For arrays of a wrong shape, values that are not finite, or times not above zero.
    """

    def __init__(
        self,
        parameters: PlantParameters,
        values: Array,
        states: Array,
        period: float,
        step: float = DEFAULT_STEP,
    ) -> None:
        within("period", period, unit="s", above=0.0)
        within("step", step, unit="s", above=0.0)
        n = len(values)
        n_values, n_states = len(parameters.values), lay.states_of(len(parameters.muscles))
        if values.shape != (n, n_values) or states.shape != (n, n_states) or n == 0:
            raise PamError(
                f"values {values.shape} and states {states.shape}: expected (n, {n_values}) and "
                f"(n, {n_states}), n at least 1"
            )
        if not (np.isfinite(values).all() and np.isfinite(states).all()):
            raise PamError("values or states hold numbers that are not finite")
        self.period, self._step = period, step
        self._tables: Any = tuple(for_kernel(table) for table in parameters.tables)
        self._values = np.array(values, dtype=float)
        self._muscles = parameters.muscles
        self._constants = self._derived(values)
        self._states = np.array(states, dtype=float)
        self._outputs = np.zeros((n, lay.outputs_of(len(self._muscles))))
        self._fresh, self._all = np.full(n, True), np.full(n, True)
        self._past = np.zeros((n, 1, len(self._muscles)))
        self._sensors = SensorBank(self._values, period, self._muscles)
        self._begin()

    def _derived(self, values: Array) -> Array:
        return derive_constants(values, muscles=self._muscles)

    def _begin(self) -> None:
        delays = self._constants[:, lay.C_MUSCLES + lay.M_DELAY :: lay.N_MUSCLE_CONSTANTS]
        rows = int(delays.max() / self.period) + 3 if delays.any() else 1
        kept = self._past[:, -rows:]
        missing = np.repeat(kept[:, :1], rows - kept.shape[1], axis=1)
        self._past = np.concatenate([missing, kept], axis=1)
        kernels = lane_kernels(self._constants) if HAVE_NUMBA else ()
        groups = blocks_of_lanes(self._constants, kernels, self.period, self._step)
        self._blocks = [
            SteppedBlock(one, self._constants, self._states, self._tables) for one in groups
        ]

    @property
    def states(self) -> Array:
        """A copy of the states (n, n_states), in the order of layout.state_names."""
        for block in self._blocks:
            self._states[block.members] = block.states
        return self._states.copy()

    @property
    def outputs(self) -> Array:
        """The true quantities (n, n_outputs) after the last step, by layout.output_names."""
        return self._outputs.copy()

    @property
    def positions(self) -> Array:
        """The true positions (n,) after the last step [rad]."""
        return self._outputs[:, lay.O_POSITION].copy()

    def restart(self, chosen: npt.NDArray[np.bool_], values: Array, states: Array) -> None:
        """Begin anew with some of the joints.

        Parameters
        ----------
        chosen : (n,) array of bool
            Which joints.
        values, states : (n_chosen, ...) array
            As for the constructor.
        """
        self._states = self.states
        self._values[chosen], self._states[chosen] = values, states
        self._constants[chosen] = self._derived(values)
        self._fresh[chosen] = True
        self._sensors.restart(chosen, values)
        self._begin()

    def step(self, commands: Array) -> Array:
        """Hold the commands for one period; return the readings of the sensors at its end.

        Parameters
        ----------
        commands : (n, n_muscles) array
            Spool -1..1 of a flow valve, gauge pressure [Pa] of a regulator.

        Returns
        -------
        (n, 1 + n_muscles) array
            Position [rad] and all gauge pressures [Pa], as `Plant.step` gives them.
        """
        self._past[:, :-1] = self._past[:, 1:]
        self._past[:, -1] = commands
        if self._fresh.any():  # before its first command, a valve had the same one
            self._past[self._fresh] = commands[self._fresh, None]
            self._fresh[:] = False
        for block in self._blocks:
            self._outputs[block.members] = block.step(
                self._past[block.members], self.period, self._step
            )
        return self._readings(self._all)

    def observe(self, chosen: npt.NDArray[np.bool_]) -> Array:
        """Readings of joints that have just begun, as `step` returns them for all.

        Parameters
        ----------
        chosen : (n,) array of bool
            Which joints; the rows of the others have no meaning.
        """
        states = self.states
        for i in np.flatnonzero(chosen):
            row = for_kernel(np.zeros(self._outputs.shape[1]))
            record(for_kernel(self._constants[i]), self._tables, for_kernel(states[i]), row)
            self._outputs[i] = row
        return self._readings(chosen)

    def _readings(self, chosen: npt.NDArray[np.bool_]) -> Array:
        pressures = self._outputs[:, lay.O_MUSCLES + lay.O_VALVE_PRESSURE :: lay.N_MUSCLE_OUTPUTS]
        return self._sensors.update(chosen, self._outputs[:, lay.O_POSITION], pressures)
