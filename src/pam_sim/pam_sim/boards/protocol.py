"""What the simulation asks of the twin of a kind of board: frames in, frames out, valves, sensors.

A twin stands for the firmware and its electronics: it keeps the rules of the real board, its own
clock and its own latched faults. It is registered beside its kind (see `register`) and must pass
the same conformance test. Muscles and joints are counted as in the `WiredBoard` that it is made
of: the first valve is that of `wired.valves[0]`, the first angle that of `wired.angles[0]`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from pam_driver.boards.protocol import Frame, KindOptions, WiredBoard
from pam_model.errors import PamError, RigError
from pam_model.rig import Muscle

OVER_PRESSURE_SHARE = 1.1  # a board's own limit over the muscle's max_pressure


@dataclass(frozen=True, slots=True)
class BoardSettings:
    """How the simulated boards of a rig are set up.

    Attributes
    ----------
    measurement_rate, status_rate, heartbeat_rate : float
        Frames per second [Hz].
    watchdog_period : float or None
        Without a command that counts for so long while active: fault [s]. None: the kind's own.
    boot_time : float
        Self test after power-up [s].
    """

    measurement_rate: float = 500.0
    status_rate: float = 50.0
    heartbeat_rate: float = 10.0
    watchdog_period: float | None = None
    boot_time: float = 0.05

    def __post_init__(self) -> None:
        for name in ("measurement_rate", "status_rate", "heartbeat_rate"):
            rate = getattr(self, name)
            if not 0.0 < rate <= 10_000.0:
                raise PamError(f"{name} = {rate:g} Hz must be above 0 and at most 10000 Hz")
        if self.watchdog_period is not None and not self.watchdog_period > 0.0:
            raise PamError(f"watchdog_period = {self.watchdog_period:g} s must be above 0")


@dataclass(frozen=True, slots=True)
class BoardValve:
    """What one valve does with a fraction of full scale, and when its board gives up.

    Attributes
    ----------
    is_regulator : bool
        A pressure regulator; otherwise a flow valve.
    full_scale : float
        Of a regulator [Pa gauge].
    max_pressure : float
        The board's own limit [Pa gauge].
    """

    is_regulator: bool = False
    full_scale: float = 1.0
    max_pressure: float = math.inf

    @classmethod
    def of(cls, muscle: Muscle) -> BoardValve:
        """The valve of a muscle.

        Raises
        ------
        RigError
            For a pressure regulator without full scale.
        """
        limit = OVER_PRESSURE_SHARE * muscle.max_pressure
        if muscle.valve.kind == "flow":
            return cls(max_pressure=limit)
        if muscle.valve.full_scale is None:
            raise RigError(f"{muscle.name}.valve.full_scale is missing [Pa gauge]")
        return cls(True, muscle.valve.full_scale, limit)

    @property
    def vented(self) -> float:
        """The command that vents: pressure 0, or the exhaust fully open."""
        return 0.0 if self.is_regulator else -1.0

    def command(self, fraction: float) -> float:
        """Plant command: gauge pressure [Pa], or spool -1..1."""
        return max(fraction, 0.0) * self.full_scale if self.is_regulator else fraction


class SimulatedBoard(Protocol):
    """The twin of one board."""

    @property
    def valves(self) -> Sequence[BoardValve]:
        """What is on its outputs."""

    @property
    def valve_commands(self) -> Sequence[float]:
        """What the valves are driven with: spool -1..1 or gauge pressure [Pa]; vented if unsure."""

    @property
    def active(self) -> bool:
        """Whether its valves follow set points; a board that knows no vent is always active."""

    @property
    def fault_names(self) -> Sequence[str]:
        """What it has latched, in capitals as the table of faults names it."""

    @property
    def rejected_frames(self) -> int:
        """Frames to it that were no command."""

    def on_frame(self, frame_id: int, data: bytes, now: float) -> None:
        """Take a frame from its bus; one that is not for this board is not looked at."""

    def poll(
        self,
        now: float,
        pressures: Sequence[float],
        angles: Sequence[float],
        supply_pressure: float,
    ) -> list[Frame]:
        """Look at the sensors and the clock; return the frames that are due.

        Parameters
        ----------
        now : float
            [s], not going back.
        pressures, angles : sequence of float
            What its sensors read [Pa gauge], [rad]; NaN for a broken one.
        supply_pressure : float
            [Pa absolute].
        """

    def restarted(self, now: float) -> SimulatedBoard:
        """The board after a power-up at `now` [s]."""

    def misbehave(self, fault: str, value: float) -> None:
        """Behave as faulty firmware would, until told `mended`.

        Parameters
        ----------
        fault : str
            "counter_jump" (by `value`), "counter_frozen" or "mended"; a board that has no such
            counter goes on as before.
        value : float
            What the fault needs.
        """


class TwinKind(Protocol):
    """Makes the twins of one kind."""

    def make(self, wired: WiredBoard, settings: BoardSettings, now: float) -> SimulatedBoard:
        """The twin of one board, powered up at `now` [s]."""


MakeTwin = Callable[[KindOptions], TwinKind]
"""What is registered; takes the options that the kind takes."""
