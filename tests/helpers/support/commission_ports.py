"""Simulated robots on which a commissioning is tried, some of them wrongly wired."""

from __future__ import annotations

from collections.abc import Sequence

from pam_demo.commission.robot_port import JointReading
from pam_demo.commission.simulated_port import SimulatedPort
from pam_model.rig import Rig

PERIOD = 0.004  # s
EXCHANGES = ("sign of the joint", "hoses", "sign of both valves", "sign of one valve")


class WiredPort(SimulatedPort):
    """A robot on which something is exchanged; it remembers its true readings."""

    def __init__(self, rig: Rig, exchanged: str = "") -> None:
        super().__init__(rig, PERIOD)
        self.exchanged = exchanged
        self.truth: list[JointReading] = []

    def advance(self, commands: Sequence[float]) -> JointReading:
        first, second = commands
        if self.exchanged == "hoses":
            first, second = second, first
        if self.exchanged in EXCHANGES[2:]:
            first = -first
        if self.exchanged == EXCHANGES[2]:
            second = -second
        reading = super().advance((first, second))
        self.truth.append(reading)
        time, position, pressures = reading[:3]
        if self.exchanged == "hoses":
            pressures = pressures[1], pressures[0]
        if self.exchanged == "sign of the joint":
            position = -position
        return JointReading(time, position, pressures)
