"""The plants of the blind check, run sample by sample with commands from outside."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from pam_check.blind.plants import FIRST
from pam_check.blind.second_plant import SecondPlant
from pam_check.blind.truth_plant import (
    Array,
    Sensors,
    TruthJoint,
    TruthMuscle,
    run_samples,
    slow_noise,
    start_state,
)


class RunningTruth:
    """A true rig that a controller drives, at rest at position 0 at first.

    Parameters
    ----------
    joint, muscles : TruthJoint, (TruthMuscle, TruthMuscle)
        Agonist first.
    sensors : Sensors
        Noise and quantisation of what the controller sees.
    generator : numpy.random.Generator
        Source of the noise.
    period : float
        Time between two samples [s]; commands are held meanwhile.
    count : int
        Number of samples that can be run.
    pressure : float
        Gauge pressure of both muscles at first [Pa].
    supply : ndarray, optional
        Pressure of the supply in each sample over that of the rig, shape (count,) [-].

    Attributes
    ----------
    commands, sensed, truth : ndarray
        Commands that acted, shape (count, 2); what the sensors showed, (count, 5): two pressures
        [Pa], position [rad], two forces [N]; true pressures and position, (count, 3).
    """

    def __init__(
        self,
        joint: TruthJoint,
        muscles: tuple[TruthMuscle, TruthMuscle],
        sensors: Sensors,
        generator: np.random.Generator,
        *,
        period: float,
        count: int,
        pressure: float,
        supply: Array | None = None,
    ) -> None:
        self.becomes(joint, muscles)
        self._state = start_state(self._joint, self._muscles, (pressure, pressure))
        scale = [sensors.pressure_noise] * 2 + [sensors.position_noise, 0.0, 0.0]
        self._noise: Array = generator.standard_normal((count, 5)) * np.array(scale)
        if sensors.pressure_colour > 0.0 or sensors.pressure_drift > 0.0:
            self._noise += slow_noise(sensors, period, count, generator)
        steps = [sensors.pressure_step, sensors.position_step, sensors.command_step]
        self._settings = np.array([period, 0.0, 0.0, 0.0, *steps])
        self._command_step = sensors.command_step
        self._unused = np.zeros(count)
        self._supply: Array = np.ones(count) if supply is None else supply
        self._given, self.commands = np.zeros((count, 2)), np.zeros((count, 2))
        self.sensed, self.truth = np.zeros((count, 5)), np.zeros((count, 3))
        self.samples = 0

    def becomes(self, joint: TruthJoint, muscles: tuple[TruthMuscle, TruthMuscle]) -> None:
        """Change the rig while it runs, as when a payload is put on; its state is kept."""
        self._joint = TruthJoint(*map(float, joint))
        first, second = muscles
        self._muscles = TruthMuscle(*map(float, first)), TruthMuscle(*map(float, second))

    def advance(self, commands: tuple[float, float]) -> Array:
        """Read the sensors, then hold these commands for a period; return what they showed.

        Raises
        ------
        FloatingPointError
            When the rig diverges.
        """
        k = self.samples
        for side, command in enumerate(commands):
            self._given[k, side] = round(command / self._command_step) * self._command_step
        end: int = run_samples(
            self._joint,
            self._muscles,
            self._unused,
            self._unused,
            self._unused,
            self._given,
            True,
            self._settings,
            self._supply,
            self._noise,
            self.commands,
            self.sensed,
            self.truth,
            self._state,
            k,
            k + 1,
        )
        if end != k + 1:
            raise FloatingPointError(f"the rig diverges at {k * self._settings[0]:.2f} s")
        self.samples = end
        shown: Array = self.sensed[k]
        return shown


class RunningSecond(SecondPlant):
    """The same rig as the second plant has it, by other laws; the arguments are the same."""

    def __init__(
        self,
        joint: TruthJoint,
        muscles: tuple[TruthMuscle, TruthMuscle],
        sensors: Sensors,
        generator: np.random.Generator,
        *,
        period: float,
        count: int,
        pressure: float,
        supply: Array | None = None,
    ) -> None:
        super().__init__(
            joint,
            muscles,
            sensors,
            generator,
            period=period,
            count=count,
            pressures=(pressure, pressure),
            supply=np.ones(count) if supply is None else supply,
        )
        self._command_step = sensors.command_step

    def advance(self, commands: tuple[float, float]) -> Array:
        """Read the sensors, then hold these commands for a period; return what they showed.

        Raises
        ------
        FloatingPointError
            When the rig diverges.
        """
        k = self.samples
        for side, command in enumerate(commands):
            self.commands[k, side] = round(command / self._command_step) * self._command_step
        self.run(k + 1)
        shown: Array = self.sensed[k]
        return shown


RUNNING: Final[Mapping[str, type[RunningTruth | RunningSecond]]] = {
    FIRST: RunningTruth,
    "second": RunningSecond,
}
"""By the names of `plants.PLANTS`."""
