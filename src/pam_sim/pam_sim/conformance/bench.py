"""A bench on which a kind of board and its simulated twin are checked without a bus."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

from pam_driver.boards.frame_errors import FrameError
from pam_driver.boards.protocol import Address, Condition
from pam_driver.boards.wiring import RigWiring, kind_name
from pam_model.errors import PamError
from pam_model.rig import Rig
from pam_sim.boards.protocol import BoardSettings, BoardValve
from pam_sim.boards.register import twin_called

STEP: Final = 0.001  # s
TIMEOUT, SENSOR_TIMEOUT = 0.5, 0.05
SUPPLY: Final = 7e5  # Pa absolute
STAMPS_AHEAD: Final = 1000.0  # s, of the wall clock


class ConformanceError(PamError):
    """A board or its twin does not do what the protocol or its own promises demand."""


def require(met: bool, otherwise: str) -> None:
    """Raise a ConformanceError with this text unless the condition is met."""
    if not met:
        raise ConformanceError(otherwise)


class BoardBench:
    """The boards of a rig, their simulated twins, and a bus that loses no frame by itself.

    Parameters
    ----------
    rig : Rig
        A rig all of whose boards are of the kind to check; at least two boards.

    Attributes
    ----------
    pressures, angles : list of float
        What the sensors measure [Pa gauge, rad]; NaN is a sensor without a value.
    up, down : bool
        Whether frames reach the driver's side and the twins.
    now : float
        Time of the bus [s].

    Raises
    ------
    RigError
        If the kind refuses the rig.
    """

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.wiring = RigWiring(rig)
        self.boards = self.wiring.make_boards()
        self.now = 50.0
        self.twins = {
            address: twin_called(kind_name(wired))({}).make(wired, BoardSettings(), self.now)
            for address, wired in self.wiring.boards.items()
        }
        self.pressures = [1e5 + 1e4 * index for index in range(len(rig.muscles))]
        self.angles = [0.25 - 0.5 * index for index in range(len(rig.joints))]
        self.heard_up: list[tuple[Address, int]] = []
        self.sent_down: list[tuple[Address, int]] = []
        self.errors: list[FrameError] = []
        self.up = self.down = True

    @property
    def fractions(self) -> tuple[float, ...]:
        """A set point for each muscle, all different."""
        return tuple(0.25 + 0.0625 * index for index in range(len(self.rig.muscles)))

    def run(self, seconds: float, setpoints: Sequence[float] | None, command: bool = True) -> None:
        """Run for `seconds` at 1 kHz, with a command in every second millisecond.

        Parameters
        ----------
        seconds : float
            Duration [s].
        setpoints : sequence of float or None
            A fraction of full scale for each muscle of the rig; None vents.
        command : bool
            Whether commands are sent at all.
        """
        for tick in range(round(seconds / STEP)):
            self.now += STEP
            if command and tick % 2 == 0:
                for address in self.boards:
                    self.tell(address, self.boards[address].command(setpoints, self.now))
            for address, twin in self.twins.items():
                wired = self.wiring.boards[address]
                frames = twin.poll(
                    self.now,
                    [self.pressures[wire.place] for wire in wired.pressures],
                    [self.angles[wire.place] for wire in wired.angles],
                    SUPPLY,
                )
                for frame_id, data in frames:
                    self.heard_up.append((address, frame_id))
                    if self.up:
                        self.hear(frame_id, data)

    def tell(self, address: Address, frames: Iterable[tuple[int, bytes]]) -> None:
        """Send frames of a board to all twins."""
        for frame_id, data in frames:
            self.sent_down.append((address, frame_id))
            if self.down:
                for twin in self.twins.values():
                    twin.on_frame(frame_id, data, self.now)

    def hear(self, frame_id: int, data: bytes) -> None:
        """Hand a frame to the boards that listen to it, as the driver does."""
        for board in self.boards.values():
            listener = board.listeners.get(frame_id)
            if listener is not None:
                try:
                    listener(data, self.now, self.now + STAMPS_AHEAD)
                except FrameError as error:
                    self.errors.append(error)

    def start(self) -> None:
        """Bring all valves to their set points."""
        self.run(0.2, None)
        self.run(0.1, self.fractions)
        require(self.obeyed(), "the valves do not follow their set points after 0.1 s")

    def valves(self) -> list[tuple[float, float, BoardValve]]:
        """Of each muscle on each board: set point, what its valve does, and the valve."""
        return [
            (self.fractions[wire.place], command, valve)
            for address, twin in self.twins.items()
            for wire, command, valve in zip(
                self.wiring.boards[address].valves, twin.valve_commands, twin.valves, strict=True
            )
        ]

    def obeyed(self) -> bool:
        """Whether every valve does what its set point says."""
        return all(
            abs(command - valve.command(fraction)) <= 1e-3 * valve.full_scale
            for fraction, command, valve in self.valves()
        )

    def vented(self) -> bool:
        """Whether every valve vents."""
        return all(command == valve.vented for _, command, valve in self.valves())

    def conditions(self, moving: bool = False) -> list[Condition]:
        """All conditions that the boards report."""
        return [
            found
            for board in self.boards.values()
            for found in board.conditions(self.now, TIMEOUT, SENSOR_TIMEOUT, moving)
        ]

    def promised(self, name: str) -> bool:
        """Whether every board promises something."""
        return all(getattr(board.promises, name) for board in self.boards.values())
