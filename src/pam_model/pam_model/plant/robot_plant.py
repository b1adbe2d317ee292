"""All joints of a robot, simulated side by side, whose valves draw from one reservoir.

Each of the n joints is simulated with the share 1/n of the reservoir and of its refill path. After
each `EXCHANGE` the pressures of the shares become equal, which keeps the mass of the gas. For short
times between exchanges, this is one reservoir from which all joints draw:

    dP_s/dt = k R T (mdot_in - sum of mdot_drawn)/V_s
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import DEFAULT_STEP, Plant

EXCHANGE: Final = 1e-3
"""Longest time between two exchanges of gas between the shares of the reservoir [s]."""
Array = npt.NDArray[np.float64]
Reading = tuple[float, float, float]


class RobotPlant:
    """The joints of a robot, simulated step by step.

    Parameters
    ----------
    parameters : sequence of PlantParameters
        By joint.
    step : float, optional
        Longest RK4 step [s].
    states : sequence of array, optional
        By joint, as for `Plant`.

    Attributes
    ----------
    joints : tuple of Plant
        The plant of each joint.
    """

    def __init__(
        self,
        parameters: Sequence[PlantParameters],
        step: float = DEFAULT_STEP,
        states: Sequence[Array | None] | None = None,
    ) -> None:
        share = 1.0 / max(len(parameters), 1)
        starts: Sequence[Array | None] = states or [None] * len(parameters)
        self.joints = tuple(
            Plant(one, step, start, reservoir_share=share)
            for one, start in zip(parameters, starts, strict=True)
        )

    @property
    def reservoir_pressure(self) -> float:
        """Pressure of the reservoir from which all valves draw [Pa absolute]."""
        return self.joints[0].reservoir_pressure

    def step(self, commands: Sequence[Sequence[float]], duration: float) -> list[Reading]:
        """Hold the commands for `duration` [s]; return the readings of the sensors at its end.

        Parameters
        ----------
        commands : sequence of pair of float
            By joint, as for `Plant.step`.
        duration : float
            [s].

        Returns
        -------
        list of (position, pressure, pressure)
            By joint, as from `Plant.step`.
        """
        shares = len(self.joints) > 1 and any(plant.has_reservoir for plant in self.joints)
        pieces = max(math.ceil(duration / EXCHANGE - 1e-9), 1) if shares else 1
        for _ in range(pieces):
            readings = [
                plant.step(pair, duration / pieces)
                for plant, pair in zip(self.joints, commands, strict=True)
            ]
            if shares:
                self._exchange()
        return readings

    def _exchange(self) -> None:
        """Make the pressures of all shares equal; the mass of the gas is kept."""
        volumes = [plant.reservoir_volume for plant in self.joints]
        gas = sum(
            plant.reservoir_pressure * volume
            for plant, volume in zip(self.joints, volumes, strict=True)
        )
        for plant in self.joints:
            plant.fill_reservoir(gas / sum(volumes))
