"""The protocol between the simulation and the twin of a kind of board.

A twin represents the firmware and electronics of a board: it obeys the rules of the real board, and
it has its own clock and its own latched faults. It is registered under the name of its kind (see
`register`) and must pass the same conformance test. Its muscles and joints have the order of the
`WiredBoard` from which it is made: the first valve is that of `wired.valves[0]`, the first angle
that of `wired.angles[0]`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from pam_driver.boards.protocol import Channel, Frame, KindOptions, WiredBoard
from pam_driver.boards.samples import ANGLE_INPUT, PRESSURE_INPUT, SUPPLY_INPUT
from pam_model.errors import PamError, RigError

if TYPE_CHECKING:
    from pam_model.rig import Muscle

OVER_PRESSURE_SHARE = 1.1  # ratio of a board's own limit to the muscle's max_pressure


@dataclass(frozen=True, slots=True)
class BoardSettings:
    """Settings of the simulated boards of a rig.

    Attributes
    ----------
    measurement_rate, status_rate, heartbeat_rate : float
        Frames per second [Hz].
    watchdog_period : float or None
        An active board that receives no valid command for this time has a fault [s]. None: the
        default of the kind.
    boot_time : float
        Duration of the self test after power-up [s].
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
    """How a board converts a fraction of full scale for one valve, and its own pressure limit.

    Attributes
    ----------
    is_regulator : bool
        True for a pressure regulator, False for a flow valve.
    full_scale : float
        Full scale of a regulator [Pa gauge].
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
            If a pressure regulator has no full scale.
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


def readings_of(
    wired: WiredBoard, pressures: Sequence[float], angles: Sequence[float], supply: float
) -> dict[tuple[str, Channel], float]:
    """What the inputs of a device measure, by kind and channel; the supply has no channel."""
    found: dict[tuple[str, Channel], float] = {(SUPPLY_INPUT, ""): supply}
    for wire, value in zip(wired.pressures, pressures, strict=True):
        found[PRESSURE_INPUT, wire.channel] = value
    for angle, value in zip(wired.angles, angles, strict=True):
        found[ANGLE_INPUT, angle.channel] = value
    return found


class SimulatedBoard(Protocol):
    """The twin of one board."""

    @property
    def valves(self) -> Sequence[BoardValve]:
        """The valves on its outputs."""

    @property
    def valve_commands(self) -> Sequence[float]:
        """The valves' commands: spool -1..1 or gauge pressure [Pa]; vented unless active."""

    @property
    def active(self) -> bool:
        """Whether its valves follow set points; always True for a board without a vent state."""

    @property
    def fault_names(self) -> Sequence[str]:
        """The names of its latched faults, in capitals as in the table of faults."""

    @property
    def rejected_frames(self) -> int:
        """The number of frames to this board that were not valid commands."""

    def on_frame(self, frame_id: int, data: bytes, now: float) -> None:
        """Receive a frame from its bus; a frame for another board is ignored."""

    def poll(
        self,
        now: float,
        pressures: Sequence[float],
        angles: Sequence[float],
        supply_pressure: float,
    ) -> list[Frame]:
        """Check the sensors and the time; return the frames that are due.

        Parameters
        ----------
        now : float
            Time [s], which never decreases.
        pressures, angles : sequence of float
            Readings of its sensors [Pa gauge], [rad]; NaN for a defective one.
        supply_pressure : float
            [Pa absolute].
        """

    def restarted(self, now: float) -> SimulatedBoard:
        """The board after a power-up at `now` [s]."""

    def misbehave(self, fault: str, value: float) -> None:
        """Behave as faulty firmware would, until the next call with "mended".

        Parameters
        ----------
        fault : str
            "counter_jump" (by `value`), "counter_frozen", "not_available_between" or "mended";
            "emergency_stop" and
            "enabling_switch" with 0 (forbids motion) or 1 (permits it). No effect on a board that
            has no such counter or input.
        value : float
            Parameter of the fault.
        """


class TwinKind(Protocol):
    """Makes the twins of one kind."""

    def make(self, wired: WiredBoard, settings: BoardSettings, now: float) -> SimulatedBoard:
        """The twin of one board, powered up at `now` [s]."""


MakeTwin = Callable[[KindOptions], TwinKind]
"""The registered callable; its options are those of the kind."""
