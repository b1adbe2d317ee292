"""The loop that plays an excitation: pressures follow their references, the angle corrects them.

One proportional loop, the same in the simulation that chose the experiment and on the rig, so that
what was expected is what is played.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from pam_gap.experiments.excitations import LOOP_RATE, Excitation
from pam_model.gas import REFERENCE_DENSITY
from pam_model.rig import Muscle, Rig
from pam_ros.valve_command import PRESSURE_REGULATOR

GAS_CONSTANT = 287.05  # J/(kg K)


def loop_gain(rig: Rig, joint: int) -> float:
    """Spool per pressure error of a loop that closes with LOOP_RATE [1/Pa]."""
    muscle = rig.muscle(rig.joints[joint].agonist)
    volume = muscle.dead_volume + muscle.neutral_length * (
        muscle.thread_length**2 - muscle.neutral_length**2
    ) / (4.0 * math.pi * muscle.turns**2)
    flow = muscle.valve.sonic_conductance * REFERENCE_DENSITY * rig.supply_pressure
    return LOOP_RATE * max(volume, 1e-6) / (GAS_CONSTANT * rig.gas.temperature * flow)


def _full_scale(muscle: Muscle) -> float:
    """The highest set point that the muscle's valve takes, if it takes one at all [Pa gauge]."""
    return math.inf if muscle.valve.full_scale is None else muscle.valve.full_scale


def holding_commands(rig: Rig, pressures: Mapping[str, float]) -> list[float]:
    """Commands under which every muscle of a rig keeps the air that it has.

    Parameters
    ----------
    rig : Rig
        Whose muscles.
    pressures : mapping
        Muscle -> measured pressure [Pa gauge]; a muscle whose pressure is not known and whose valve
        is a regulator is vented.

    Returns
    -------
    list of float
        In the order of the rig: 0 shuts a flow valve, a regulator is asked for what it has.
    """
    commands = []
    for muscle in rig.muscles:
        held = 0.0
        if muscle.valve.kind == PRESSURE_REGULATOR:
            measured = pressures.get(muscle.name, math.nan)
            highest = min(muscle.max_pressure, _full_scale(muscle))
            held = min(max(measured, 0.0), highest) if math.isfinite(measured) else 0.0
        commands.append(held)
    return commands


class ExperimentLoop:
    """Valve commands of one excitation, sample by sample.

    Parameters
    ----------
    rig, joint : Rig, int
        Whose.
    excitation : Excitation
        What is played.
    """

    def __init__(self, rig: Rig, joint: int, excitation: Excitation) -> None:
        muscles = [rig.muscle(m) for m in rig.joints[joint].muscles]
        self.is_regulated = [muscle.valve.kind == PRESSURE_REGULATOR for muscle in muscles]
        self._highest = [
            min(0.95 * min(muscle.max_pressure, rig.supply_gauge_pressure), _full_scale(muscle))
            for muscle in muscles
        ]
        self._gain = loop_gain(rig, joint)
        self._excitation = excitation
        self._levels = excitation.level.tolist()
        self._differences = excitation.difference.tolist()
        self._positions = excitation.position.tolist()

    @property
    def start_pressures(self) -> tuple[float, float]:
        """Where the excitation begins [Pa gauge]."""
        return (
            self._levels[0] + self._differences[0],
            self._levels[0] - self._differences[0],
        )

    def commands(
        self, time: float, position: float, pressures: Sequence[float]
    ) -> tuple[float, float]:
        """What the valves are told.

        Parameters
        ----------
        time : float
            Since the excitation began [s]; before 0 its first references hold.
        position : float
            Measured [rad].
        pressures : sequence of two floats
            Measured [Pa gauge], agonist first.
        """
        e = self._excitation
        if time >= e.open_from:
            return e.open_commands
        k = min(max(int(time / e.sample_time + 1e-6), 0), len(self._levels) - 1)
        half = self._differences[k] + e.position_gain * (self._positions[k] - position)
        return (
            self._command(0, self._levels[k] + half, pressures[0]),
            self._command(1, self._levels[k] - half, pressures[1]),
        )

    def _command(self, i: int, wanted: float, measured: float) -> float:
        wanted = min(max(wanted, 0.0), self._highest[i])
        if self.is_regulated[i]:
            return wanted
        return min(max(self._gain * (wanted - measured), -1.0), 1.0)
