"""Torque of what two muscles remember: thread friction and creep along the joint's reference."""

from __future__ import annotations

import math

from pam_control.compensation.bladder_creep import BladderCreep
from pam_control.compensation.thread_hysteresis import ThreadHysteresis
from pam_model.rig import Muscle

Pair = tuple[float, float]


class HistoryTorque:
    """Both muscles' memory, run along the reference.

    Parameters
    ----------
    muscles : (Muscle, Muscle)
        Agonist, antagonist.
    pulley_radius : float
        As it is, not as written [m].
    """

    def __init__(self, muscles: tuple[Muscle, ...], pulley_radius: float) -> None:
        self._radius = pulley_radius
        self._frictions = [ThreadHysteresis.from_muscle(muscle) for muscle in muscles]
        self._creeps = [BladderCreep.from_muscle(muscle) for muscle in muscles]
        self.is_neutral = not any(
            [friction.area for friction in self._frictions]
            + [creep.stiffness for creep in self._creeps]
        )
        self._position = self._time = math.nan

    def reset(self) -> None:
        """Forget the past."""
        self._position = self._time = math.nan
        for friction, creep in zip(self._frictions, self._creeps, strict=True):
            friction.reset()
            creep.reset()

    def advance(self, time: float, position: float, pressures: Pair) -> float:
        """Go on to where the reference is at `time`; the torque the muscles then add.

        Parameters
        ----------
        time : float
            Not before that of the last call [s].
        position : float
            Of the reference [rad].
        pressures : (float, float)
            About those the muscles have then, gauge [Pa].

        Returns
        -------
        float
            Torque on the joint [N m].
        """
        if self.is_neutral:
            return 0.0
        if not math.isnan(self._position):
            stroke = self._radius * (position - self._position)
            step = max(time - self._time, 0.0)
            for sign, friction, creep in zip(
                (-1.0, 1.0), self._frictions, self._creeps, strict=True
            ):
                friction.move(sign * stroke)
                creep.move(sign * stroke, step)
        self._position, self._time = position, time
        forces = [
            friction.force(pressure) + creep.force
            for friction, creep, pressure in zip(
                self._frictions, self._creeps, pressures, strict=True
            )
        ]
        return self._radius * (forces[0] - forces[1])
