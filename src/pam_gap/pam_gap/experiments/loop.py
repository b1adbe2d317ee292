"""The proportional loop that plays an excitation: pressure control with a correction by the angle.

The simulation that chooses the experiment and the rig use the same loop, so that the rig does what
was simulated.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from pam_gap.experiments.excitations import LOOP_RATE, Excitation
from pam_model.gas import REFERENCE_DENSITY
from pam_model.rig import Muscle, Rig
from pam_model.robot import compose
from pam_model.views.gas_volume import neutral_gas_volume
from pam_ros.valve_command import PRESSURE_REGULATOR

GAS_CONSTANT = 287.05  # J/(kg K)


def loop_gain(rig: Rig, joint: int, bandwidth: float = LOOP_RATE) -> float:
    """Gain from pressure error to spool opening for a loop with a bandwidth [1/s], in 1/Pa."""
    robot = compose(rig)
    muscle = robot.muscles[robot.joints[joint].muscles[0]]
    volume = neutral_gas_volume(muscle)
    flow = muscle.valve.sonic_conductance * REFERENCE_DENSITY * robot.supply.pressure
    return bandwidth * max(volume, 1e-6) / (GAS_CONSTANT * rig.gas.temperature * flow)


def _full_scale(muscle: Muscle) -> float:
    """Highest set point of the muscle's regulator [Pa gauge]; infinite for a flow valve."""
    return math.inf if muscle.valve.full_scale is None else muscle.valve.full_scale


def holding_commands(rig: Rig, pressures: Mapping[str, float]) -> list[float]:
    """Commands with which every muscle of a rig keeps its air.

    Parameters
    ----------
    pressures : mapping
        Muscle -> measured pressure [Pa gauge]. A muscle with a regulator is vented if its pressure
        is not known.

    Returns
    -------
    list of float
        In the order of the rig: 0 for a flow valve, the measured pressure for a regulator.
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


class PressureLoop:
    """Proportional control of the pressures of a joint's two muscles; regulators have their own.

    Parameters
    ----------
    rig, joint : Rig, int
        The rig, and the number of the joint.
    bandwidth : float
        Of the loop of a flow valve [1/s].

    Attributes
    ----------
    is_regulated : list of bool
        Whether the valve is a pressure regulator, agonist first.
    highest : list of float
        Highest pressure that is commanded [Pa gauge].
    """

    def __init__(self, rig: Rig, joint: int, bandwidth: float = LOOP_RATE) -> None:
        muscles = [rig.muscle(m) for m in rig.joints[joint].muscles]
        self.is_regulated = [muscle.valve.kind == PRESSURE_REGULATOR for muscle in muscles]
        self.highest = [
            min(0.95 * min(muscle.max_pressure, rig.supply_gauge_pressure), _full_scale(muscle))
            for muscle in muscles
        ]
        self._gain = loop_gain(rig, joint, bandwidth)

    def commands(
        self, wanted: tuple[float, float], measured: Sequence[float]
    ) -> tuple[float, float]:
        """Valve commands for pressures that are wanted and measured [Pa gauge], agonist first."""
        return self._command(0, wanted[0], measured[0]), self._command(1, wanted[1], measured[1])

    def _command(self, i: int, wanted: float, measured: float) -> float:
        wanted = min(max(wanted, 0.0), self.highest[i])
        if self.is_regulated[i]:
            return wanted
        return min(max(self._gain * (wanted - measured), -1.0), 1.0)


class ExperimentLoop:
    """Valve commands of one excitation, sample by sample.

    Parameters
    ----------
    rig, joint : Rig, int
        The rig, and the number of the joint.
    excitation : Excitation
        The excitation to play.
    """

    def __init__(self, rig: Rig, joint: int, excitation: Excitation) -> None:
        self._pressures = PressureLoop(rig, joint)
        self.is_regulated = self._pressures.is_regulated
        self._excitation = excitation
        self._levels = excitation.level.tolist()
        self._differences = excitation.difference.tolist()
        self._positions = excitation.position.tolist()

    @property
    def start_pressures(self) -> tuple[float, float]:
        """Pressures at which the excitation begins [Pa gauge]."""
        return (
            self._levels[0] + self._differences[0],
            self._levels[0] - self._differences[0],
        )

    def commands(
        self, time: float, position: float, pressures: Sequence[float]
    ) -> tuple[float, float]:
        """Valve commands of one sample.

        Parameters
        ----------
        time : float
            Time since the excitation began [s]; before 0 the first references apply.
        position : float
            Measured position [rad].
        pressures : sequence of two floats
            Measured pressures [Pa gauge], agonist first.
        """
        e = self._excitation
        if time >= e.open_from:
            return e.open_commands
        k = min(max(int(time / e.sample_time + 1e-6), 0), len(self._levels) - 1)
        half = self._differences[k] + e.position_gain * (self._positions[k] - position)
        level = self._levels[k]
        return self._pressures.commands((level + half, level - half), pressures)
