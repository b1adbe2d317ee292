"""The result of a simulation: the true quantities over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pam_model.plant import layout as lay
from pam_model.plant.joint_muscles import PAIR, JointMuscles, names_of

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
        In the order of layout.output_names; the properties below give single columns.
    final_state : (..., n_states) array
        The state one sample after the last row, from which a next `simulate` can continue.
    muscles : tuple of JointMuscle, optional
        Those of the joint.
    """

    time: Array
    outputs: Array
    final_state: Array
    muscles: JointMuscles = PAIR

    def __getitem__(self, name: str) -> Array:
        """A column by its name in layout.output_names, such as `agonist.spool`."""
        return self.outputs[..., lay.output_names(names_of(self.muscles)).index(name)]

    def _of_muscles(self, column: int) -> Array:
        return self.outputs[..., lay.O_MUSCLES + column :: lay.N_MUSCLE_OUTPUTS]

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
        """Gauge pressure in the muscles (..., n, n_muscles) [Pa]."""
        return self._of_muscles(lay.O_PRESSURE)

    @property
    def valve_pressures(self) -> Array:
        """Gauge pressure at the sensors (..., n, n_muscles) [Pa]."""
        return self._of_muscles(lay.O_VALVE_PRESSURE)

    @property
    def forces(self) -> Array:
        """Pull of the muscles (..., n, n_muscles) [N]."""
        return self._of_muscles(lay.O_FORCE)

    @property
    def lengths(self) -> Array:
        """Length of the muscles (..., n, n_muscles) [m]."""
        return self._of_muscles(lay.O_LENGTH)
