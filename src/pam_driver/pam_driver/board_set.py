"""The boards of a rig on their buses: frames to measurements, set points to frames.

This module depends on the protocol of `boards.protocol` only. Every identifier has one listener,
which one table look-up finds, so that a kind of board adds only its own decoding to the cycle time.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Protocol

from pam_driver.boards.frame_errors import ForeignCommandError, FrameError, UnknownFrameError
from pam_driver.boards.protocol import (
    NEVER,
    Address,
    Board,
    Channel,
    Condition,
    Frame,
    Hear,
    Sample,
)
from pam_driver.boards.samples import ANGLE_INPUT, PRESSURE_INPUT
from pam_driver.boards.wiring import RigWiring
from pam_driver.can_bus.bus import BusState, ReceivedFrame, SendOutcome
from pam_driver.joint_velocity import JointVelocity
from pam_model.errors import RigError


class Port(Protocol):
    """What the driver needs of a bus, see `bus.CanPort`."""

    @property
    def state(self) -> BusState:
        """State of the bus."""

    def receive_all(self, now: float) -> list[ReceivedFrame]:
        """The frames that have arrived."""

    def send(self, frame_id: int, data: bytes, now: float) -> SendOutcome:
        """Send the frame or drop it."""


LATCH_PERIOD = 0.05
"""Period of sending a fault of the driver to a board until it reports that it keeps it [s]."""

Clock = Callable[[], tuple[float, float]]
"""Gives the present monotonic and wall time [s]."""
_Angle = tuple[JointVelocity, Mapping[Channel, Sample], Channel]
_Route = tuple[Hear, tuple[_Angle, ...], Board]
Look = Callable[[Board, float], None]
"""Looks at a board at a monotonic time [s]."""


class BoardSet:
    """All boards of one rig.

    Parameters
    ----------
    wiring : RigWiring
        Which muscle and joint is on which board.
    ports : mapping of str to Port
        Open buses by name.
    velocities : sequence of JointVelocity
        By joint; each is updated with every measured angle of its joint.

    Raises
    ------
    RigError
        If a board is on a bus that does not exist, or two boards use the same identifier.

    Attributes
    ----------
    boards : dict of address to Board
        The boards in the order of the rig file.
    ports : dict of str to Port
        Open buses by name.
    pressures, angles : tuple of (mapping, channel)
        Where each muscle's pressure and each joint's angle is kept, in the rig's order.
    sensors : tuple of (Availability, str, channel)
        The same, first muscles, then joints, for what a board says to have no measurement of.
    valves : tuple of Board
        The board of each muscle, in the rig's order.
    frame_errors : Counter
        Frames that were not valid messages, by kind; `last_frame_error` has the last of each, and
        `errors_by_bus` has both for each bus.
    foreign_at : float
        When a command of another driver was last received, monotonic [s].
    sent_at : dict of address to float
        When a command was last sent to each board, monotonic [s].
    """

    def __init__(
        self,
        wiring: RigWiring,
        ports: Mapping[str, Port],
        velocities: Sequence[JointVelocity],
    ) -> None:
        self.boards = wiring.make_boards()
        self.ports = dict(ports)
        self.pressures = tuple(
            (self.boards[board].pressures, channel) for board, channel in wiring.sensors
        )
        self.angles = tuple(
            (self.boards[board].angles, channel) for board, channel in wiring.joints
        )
        self.sensors = tuple(
            (self.boards[board].availability, what, channel)
            for what, wires in ((PRESSURE_INPUT, wiring.sensors), (ANGLE_INPUT, wiring.joints))
            for board, channel in wires
        )
        self.valves = tuple(self.boards[board] for board, _ in wiring.muscles)
        self.frame_errors: Counter[str] = Counter()
        self.last_frame_error: dict[str, str] = {}
        self.errors_by_bus: dict[str, tuple[Counter[str], dict[str, str]]] = {
            name: (Counter(), {}) for name in ports
        }
        self.foreign_at = NEVER
        self.sent_at: dict[Address, float] = dict.fromkeys(self.boards, NEVER)
        self._latch_sent_at: dict[Address, float] = dict.fromkeys(self.boards, NEVER)
        self._kinds = tuple(wiring.kinds.values())
        self._drained_at = NEVER
        self._bus_of = {address: wired.bus for address, wired in wiring.boards.items()}
        self._routes: dict[str, dict[int, _Route]] = {name: {} for name in ports}
        for address, wired in wiring.boards.items():
            board = self.boards[address]
            angles = tuple(
                (velocities[wire.place], board.angles, wire.channel) for wire in wired.angles
            )
            if wired.bus not in self._routes:
                names = ", ".join(repr(name) for name in ports)
                raise RigError(f"{board.name}: no bus is called {wired.bus!r} (there is {names})")
            routes = self._routes[wired.bus]
            for frame_id, hear in board.listeners.items():
                measures = frame_id in board.identifiers.answers
                routes[frame_id] = (hear, angles if measures else (), board)

    def receive(
        self, now: float, wall_now: float, clock: Clock | None = None, look: Look | None = None
    ) -> float:
        """Process the frames that have arrived on the buses.

        Parameters
        ----------
        now : float
            Monotonic time [s].
        wall_now : float
            The same moment on the clock that stamps frames [s].
        clock : callable, optional
            Returns both times again after the frames were read. Without it, frames that arrived
            while this process stood still between the look at the clocks and the reading would seem
            to have followed each other without a pause.
        look : callable, optional
            Looks at a board before a frame replaces another one with the same identifier that
            arrived in this call and says something else.

        Returns
        -------
        float
            The monotonic time at which the frames were read [s].
        """
        arrived = [(name, self.ports[name].receive_all(now)) for name in self._routes]
        began = now
        if clock is not None:
            now, wall_now = clock()
        # A frame that is read now arrived after the last read: this bounds its age when the wall
        # clock steps, and gives frames that waited during a stall their true age.
        longest = now - self._drained_at
        for name, frames in arrived:
            routes = self._routes[name]
            heard: dict[int, bytes] = {}
            for frame_id, data, stamp in frames:
                time = now - min(max(wall_now - stamp, 0.0), longest)
                try:
                    hear, angles, board = routes[frame_id]
                except KeyError:
                    self._count(name, self._stranger(frame_id, data))
                    continue
                if look is not None and heard.get(frame_id, data) != data:
                    look(board, time)
                heard[frame_id] = data
                try:
                    hear(data, time, stamp)
                except FrameError as error:
                    self._count(name, error)
                    if isinstance(error, ForeignCommandError):
                        self.foreign_at = time
                    continue
                for velocity, samples, channel in angles:
                    sample = samples[channel]
                    velocity.update(sample.value, sample.time)
        self._drained_at = began
        return now

    def command(self, setpoints: Sequence[float] | None, now: float) -> bool:
        """Command every board; False if a bus did not accept one of the frames.

        Parameters
        ----------
        setpoints : sequence of float or None
            Fraction of full scale by muscle; None vents all.
        now : float
            Monotonic time [s].
        """
        all_sent = True
        for address, board in self.boards.items():
            if self._send(address, board.command(setpoints, now), now):
                self.sent_at[address] = now
            else:
                all_sent = False
        return all_sent

    def vent(self, now: float) -> None:
        """Command every board to vent at once, in addition to the commands of the cycle."""
        for address, board in self.boards.items():
            self._send(address, board.vent(), now)

    def clear_faults(self, now: float) -> None:
        """Command every board to clear its faults."""
        for address, board in self.boards.items():
            self._send(address, board.clear_faults(), now)

    def latch_fault(self, now: float) -> None:
        """Send a fault of the driver to every board that keeps it and does not report it yet."""
        for address, board in self.boards.items():
            wanted = board.promises.keeps_host_fault and not board.host_fault
            if wanted and now - self._latch_sent_at[address] >= LATCH_PERIOD:
                self._latch_sent_at[address] = now
                self._send(address, board.latch_fault(), now)

    def host_faults(self) -> tuple[Condition, ...]:
        """The boards that report a fault which a driver latched on them."""
        keeping = [board for board in self.boards.values() if board.host_fault]
        return tuple([condition for board in keeping for condition in host_fault_of(board)])

    def acknowledge(self) -> None:
        """Discard conditions that are reported only once, such as a restart."""
        for board in self.boards.values():
            board.acknowledge()

    def _send(self, address: Address, frames: Iterable[Frame], now: float) -> bool:
        port = self.ports[self._bus_of[address]]
        sent = True
        for frame_id, data in frames:
            sent = port.send(frame_id, data, now) is SendOutcome.SENT and sent
        return sent

    def _stranger(self, frame_id: int, data: bytes) -> FrameError:
        """The error that describes a frame for which no board of the rig has a listener."""
        for kind in self._kinds:
            error = kind.stranger(frame_id, data)
            if error is not None:
                return error
        return UnknownFrameError(frame_id, "no board has this identifier")

    def _count(self, bus: str, error: FrameError) -> None:
        counts, last = self.errors_by_bus[bus]
        for counter in (self.frame_errors, counts):
            counter[error.kind] += 1
        self.last_frame_error[error.kind] = last[error.kind] = str(error)


def host_fault_of(board: Board) -> Iterator[Condition]:
    """Whether a board reports a fault which a driver latched on it."""
    if board.host_fault:
        text = "keeps a fault that the driver latched earlier"
        yield Condition("latched_fault", board.name, text)
