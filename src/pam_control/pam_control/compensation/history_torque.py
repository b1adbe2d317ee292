"""Joint torque of the muscles' hysteresis and creep, predicted along the joint's reference."""

from __future__ import annotations

import math

from pam_control.compensation.muscle_memory import MuscleMemory
from pam_model.rig import Muscle

Pair = tuple[float, float]


class HistoryTorque:
    """The hysteresis and creep states of both muscles, advanced along the reference.

    Parameters
    ----------
    muscles : (Muscle, Muscle)
        Agonist, antagonist.
    pulley_radius : float
        Radius after the effects that the rig file names [m].
    """

    def __init__(self, muscles: tuple[Muscle, ...], pulley_radius: float) -> None:
        self._radius = pulley_radius
        self._agonist, self._antagonist = (MuscleMemory.from_muscle(m) for m in muscles)
        self.is_neutral = self._agonist.is_neutral and self._antagonist.is_neutral
        self._position = self._time = math.nan

    def reset(self) -> None:
        """Reset the states."""
        self._position = self._time = math.nan
        self._agonist.reset()
        self._antagonist.reset()

    def advance(self, time: float, position: float, pressures: Pair) -> float:
        """Advance the states along the reference to `time` and return their torque.

        Parameters
        ----------
        time : float
            Not earlier than in the last call [s].
        position : float
            Reference position at that time [rad].
        pressures : (float, float)
            Approximate pressures of the muscles at that time, gauge [Pa].

        Returns
        -------
        float
            Torque on the joint [N m].
        """
        if self.is_neutral:
            return 0.0
        if not math.isnan(self._position):
            stroke = self._radius * (position - self._position)
            duration = max(time - self._time, 0.0)
            self._agonist.move(-stroke, duration)
            self._antagonist.move(stroke, duration)
        self._position, self._time = position, time
        return self._radius * (
            self._agonist.pull(pressures[0]) - self._antagonist.pull(pressures[1])
        )
