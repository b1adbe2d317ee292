"""What a commissioning needs of a robot: send commands, wait a period, read the sensors.

A simulated robot, another plant and a robot on ROS topics have the same face, so that the same code
commissions each of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol


class JointReading(NamedTuple):
    """What the sensors of one joint showed."""

    time: float  # at which it was asked for [s]; the next commands follow from it
    position: float  # [rad]; NaN if it is not known or too old
    pressures: tuple[float, float]  # gauge, agonist first [Pa]; NaN if not known or too old
    refusal: str = ""  # why the robot's driver takes no commands; empty if it does
    # age, pressure_age: of the angle and of the pressures at `time`, by their stamps [s]
    age: float = 0.0
    pressure_age: float = 0.0

    @property
    def known(self) -> bool:
        """Whether the angle and both pressures are known."""
        return all(map(math.isfinite, (self.position, *self.pressures)))

    @property
    def problem(self) -> str:
        """Why nothing can be concluded from this reading; empty if something can."""
        return self.refusal or (
            "" if self.known else "a pressure or the angle is missing or too old"
        )

    @property
    def position_time(self) -> float:
        """Stamp of the angle [s]."""
        return self.time - self.age

    @property
    def pressure_time(self) -> float:
        """Stamp of the pressures [s]."""
        return self.time - self.pressure_age


class RobotPort(Protocol):
    """One joint of a robot.

    Attributes
    ----------
    period : float
        Time between two readings [s].
    measurement_delay, command_delay : float
        From a sensor's sample to its stamp, and from a command to the valve [s].
    """

    period: float
    measurement_delay: float
    command_delay: float

    def advance(self, commands: Sequence[float]) -> JointReading:
        """Send the commands of both valves, and return the readings of this period.

        Parameters
        ----------
        commands : sequence of two floats
            Agonist first: spool -1 to 1 of a flow valve, set point of a regulator [Pa gauge].
        """
