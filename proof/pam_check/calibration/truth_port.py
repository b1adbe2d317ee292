"""A drawn rig of the independent plant as a robot that is commissioned, with what is exchanged."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pam_check.blind.truth_plant import Array
from pam_check.calibration.drawn_rig import TrueRig
from pam_check.control.running_truth import RunningTruth
from pam_demo.commission.robot_port import JointReading

AT_REST = 6.0  # s, in which the vented joint comes to rest before anybody looks


class TruthPort:
    """A true rig behind sensors and cables.

    Parameters
    ----------
    drawn : TrueRig
        The rig.
    exchanged : str
        What is exchanged, of `EXCHANGES`; empty for nothing.
    period : float
        Between two readings [s].
    seconds : float
        How long it can run [s].
    seed : int
        Of the noise.

    Attributes
    ----------
    period, measurement_delay, command_delay : float
        As of every `RobotPort`; a command acts one period after the reading it follows from.
    """

    def __init__(
        self, drawn: TrueRig, exchanged: str, period: float, seconds: float, seed: int
    ) -> None:
        self.period, self.measurement_delay, self.command_delay = period, 0.0, period
        self._exchanged = exchanged
        self._regulated = drawn.muscles[0].regulator > 0.0
        count = round((seconds + AT_REST) / period)
        self._plant = RunningTruth(
            drawn.joint, drawn.muscles, drawn.sensors, np.random.default_rng(seed),
            period=period, count=count, pressure=0.0,
            supply=drawn.supply.factor(np.arange(count, dtype=np.float64) * period),
        )  # fmt: skip
        self._first = round(AT_REST / period)
        empty = 0.0 if self._regulated else -1.0
        for _ in range(self._first):
            self._plant.advance((empty, empty))

    @property
    def seconds(self) -> float:
        """How long it has run [s]."""
        return (self._plant.samples - self._first) * self.period

    @property
    def truth(self) -> Array:
        """True pressures [Pa] and position [rad], shape (n, 3)."""
        return self._plant.truth[self._first : self._plant.samples]

    def mend(self) -> None:
        """Put right what is exchanged."""
        self._exchanged = ""

    def advance(self, commands: Sequence[float]) -> JointReading:
        """As of every `RobotPort`."""
        first, second = commands
        if self._exchanged == "hoses":
            first, second = second, first
        if self._exchanged in ("sign of both valves", "sign of one valve"):
            first = -first
        if self._exchanged == "sign of both valves":
            second = -second
        shown = self._plant.advance((first, second))
        position, pressures = float(shown[2]), [float(shown[0]), float(shown[1])]
        if self._exchanged == "sign of the joint":
            position = -position
        if self._exchanged == "hoses":
            pressures.reverse()
        now = (self._plant.samples - 1 - self._first) * self.period
        return JointReading(now, position, (pressures[0], pressures[1]))
