"""The result of a simulation: the true quantities over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pam_model.plant import layout as lay

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The result of a simulation for one parameter vector (n, ...) or a batch (n_lane, n, ...).

    Row k is the state at `time[k]`, when command row k begins.

    Attributes
    ----------
    time : (n,) array
        [s].
    outputs : (..., n, n_outputs) array
        In the order of layout.OUTPUT_NAMES; the properties below give single columns.
    final_state : (..., n_states) array
        The state one sample after the last row, from which a next `simulate` can continue.
    """

    time: Array
    outputs: Array
    final_state: Array

    def __getitem__(self, name: str) -> Array:
        """A column by its name in layout.OUTPUT_NAMES, such as `agonist.spool`."""
        return self.outputs[..., lay.OUTPUT_NAMES.index(name)]

    def _pair(self, column: int) -> Array:
        return self.outputs[..., lay.O_AGONIST + column :: lay.N_MUSCLE_OUTPUTS]

    @property
    def position(self) -> Array:
        """Joint position [rad]."""
        return self.outputs[..., lay.O_POSITION]

    @property
    def velocity(self) -> Array:
        """Joint velocity [rad/s]."""
        return self.outputs[..., lay.O_VELOCITY]

    @property
    def torque(self) -> Array:
        """Torque of the muscles [N m]."""
        return self.outputs[..., lay.O_TORQUE]

    @property
    def reservoir_pressure(self) -> Array:
        """Pressure of the reservoir from which the valves draw [Pa absolute]."""
        return self.outputs[..., lay.O_RESERVOIR]

    @property
    def pressures(self) -> Array:
        """Gauge pressure in the muscles (..., n, 2) [Pa]."""
        return self._pair(lay.O_PRESSURE)

    @property
    def valve_pressures(self) -> Array:
        """Gauge pressure at the sensors (..., n, 2) [Pa]."""
        return self._pair(lay.O_VALVE_PRESSURE)

    @property
    def forces(self) -> Array:
        """Pull of the muscles (..., n, 2) [N]."""
        return self._pair(lay.O_FORCE)

    @property
    def lengths(self) -> Array:
        """Length of the muscles (..., n, 2) [m]."""
        return self._pair(lay.O_LENGTH)
