"""The protocol between the driver and a kind of board: required methods, and a board's promises.

A *kind* (`BoardKind`) is registered under a name, see `register`. It checks the part of a rig file
that concerns its boards and makes one `Board` for each. A `Board` turns set points into frames
and frames into measurements; the driver's core sends, receives and judges, but never interprets a
payload. The `Promises` of a board state what it cannot do, and the core does not compensate for it:
a device without enable, counter, watchdog or status is a `Board` with weaker promises.

All values in this protocol are in SI units: pressures in Pa gauge, the supply pressure in Pa
absolute, angles in rad, times in s. A set point is a fraction of the valve's full scale (-1 to 1
for a flow valve, 0 to 1 of `valve.full_scale` for a pressure regulator). The wires of a board
contain its muscles, so that a device with other units can convert. Identifiers are whole numbers
with the flag `EXTENDED` for 29 bits and the flag `FD` for a CAN FD frame. Every board names its
bus; the name is "" if the rig has only one bus.

docs/new_board.md shows how to add a kind; a kind and its simulated twin must pass the checks in
`pam_sim.conformance`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Protocol, runtime_checkable

from pam_driver.boards.frame_errors import FrameError

if TYPE_CHECKING:
    from pam_driver.boards.availability import Availability
    from pam_model.rig import Joint, Muscle

NEVER: Final = -math.inf
EMERGENCY_STOP: Final = "emergency_stop"
ENABLING_SWITCH: Final = "enabling_switch"
Frame = tuple[int, bytes]
"""Identifier and payload."""
Channel = int | str
"""An input or output of a board, as the rig file names it."""
Address = int | str
"""A board, as the rig file names it: a number, or the name of its section under `boards`."""
Hear = Callable[[bytes, float, float], None]
"""Takes a payload, the time of the measurement (monotonic) and its stamp (wall clock) [s]."""


class Condition(NamedTuple):
    """Something that is wrong: its kind, the subject concerned, and one line for the user."""

    kind: str
    subject: str
    text: str

    def __str__(self) -> str:
        return f"{self.subject}: {self.text}" if self.subject else self.text


class Sample(NamedTuple):
    """A value with its time of measurement: monotonic for ages, wall clock for stamps [s]."""

    value: float = math.nan
    time: float = NEVER
    stamp: float = 0.0


class MuscleWire(NamedTuple):
    """One muscle on a board: the channel that drives or measures it, and its place in the rig."""

    channel: Channel
    place: int
    muscle: Muscle


class JointWire(NamedTuple):
    """One joint on a board: the channel that measures its angle, and its place in the rig."""

    channel: Channel
    place: int
    joint: Joint


@dataclass(frozen=True, slots=True)
class WiredBoard:
    """One board as the rig file describes it.

    Attributes
    ----------
    address : int or str
        The name or number by which muscles and joints refer to it.
    settings : mapping
        Its section of the rig file (`boards.<name>`), empty for a board that has only a number;
        the driver reads `kind` and `bus`, and the kind reads all other keys.
    valves, pressures : tuple of MuscleWire
        Muscles whose valves it drives, and muscles whose pressures it measures.
    angles : tuple of JointWire
        Joints whose angle it measures.
    ambient_pressure : float
        For devices that measure absolute pressures [Pa absolute].
    brake_release_delay : float
        Time from the first set point until its brake is released [s].
    """

    address: Address
    settings: Mapping[str, Any]
    valves: tuple[MuscleWire, ...]
    pressures: tuple[MuscleWire, ...]
    angles: tuple[JointWire, ...]
    ambient_pressure: float = 101325.0
    brake_release_delay: float = 0.0

    @property
    def name(self) -> str:
        """Its name in messages and diagnostics."""
        return f"board {self.address}"

    @property
    def bus(self) -> str:
        """The name of its bus; "" if the rig has only one bus."""
        return str(self.settings.get("bus", ""))


@dataclass(frozen=True, slots=True)
class Promises:
    """What a board does for safety by itself; the core and the documentation rely on it.

    Attributes
    ----------
    watchdog : float or None
        It vents when it has received no valid command for this time [s]; None: it has no watchdog.
    latches : bool
        After a watchdog time-out or a fault it stays vented until the faults are cleared.
    keeps_host_fault : bool
        It latches a fault that the driver sends it, reports it, and stays vented until the faults
        are cleared: the fault survives a crash and a restart of the host.
    needs_arming : bool
        After power-up, a vent or a fault it opens a valve only after it has received a command
        that enables no valve.
    tells_state : bool
        It reports whether its valves follow the set points.
    tells_faults : bool
        It reports what is wrong with it.
    echoes_commands : bool
        It returns a part of the last command, so that a board that receives nothing is detected.
    counts_samples : bool
        Its measurements contain a counter, so that a frozen board and lost frames are detected.
    has_heartbeat : bool
        It reports when it has restarted.
    has_checksum : bool
        Commands are protected by a checksum, and a corrupted one is refused.
    measures_supply : bool
        It measures the supply pressure.
    """

    watchdog: float | None
    latches: bool
    keeps_host_fault: bool
    needs_arming: bool
    tells_state: bool
    tells_faults: bool
    echoes_commands: bool
    counts_samples: bool
    has_heartbeat: bool
    has_checksum: bool
    measures_supply: bool


class Identifiers(NamedTuple):
    """The identifiers of one board: of frames that it sends, and of frames that are sent to it.

    `service` are frames from the driver that configure and supervise, and that several boards of a
    bus may share, such as NMT of CANopen; they carry no set points.
    """

    answers: tuple[int, ...]
    commands: tuple[int, ...]
    service: tuple[int, ...] = ()


class BoardReport(NamedTuple):
    """What the diagnostics show of a board: its state as text, and named values."""

    text: str
    values: Mapping[str, object]


class Board(Protocol):
    """One board of the rig, as the driver's core sees it.

    The driver calls everything from its I/O thread or under its lock, and nothing may wait.
    """

    @property
    def name(self) -> str:
        """Its name in messages and diagnostics, and the subject of its conditions."""

    @property
    def promises(self) -> Promises:
        """What the board does for safety by itself."""

    @property
    def identifiers(self) -> Identifiers:
        """The identifiers of its frames."""

    @property
    def listeners(self) -> Mapping[int, Hear]:
        """By identifier, the function that takes the payload.

        It raises `FrameError` for a payload that is not a valid message. Where commands of a second
        driver can be recognised by their identifier, that identifier is included; its listener
        raises `ForeignCommandError`.
        """

    @property
    def pressures(self) -> Mapping[Channel, Sample]:
        """By channel the last available pressure [Pa gauge]; always the same object."""

    @property
    def angles(self) -> Mapping[Channel, Sample]:
        """By channel the last available angle [rad]; always the same object."""

    @property
    def inputs(self) -> Mapping[str, Sample]:
        """The inputs for people that the board has: `EMERGENCY_STOP`, `ENABLING_SWITCH`.

        The value is 1 if the input permits motion (released stop, held switch), otherwise 0, or NaN
        if the board had the input and now reports that it has none. An input that the board never
        had is no key.
        """

    @property
    def availability(self) -> Availability:
        """How often it has reported that it has no measurement, for each of them."""

    @property
    def supply_pressure(self) -> float:
        """The last measured supply pressure [Pa absolute], NaN if the board does not measure it."""

    @property
    def follows(self) -> bool:
        """Whether its valves follow the set points, as far as the board reports it."""

    @property
    def host_fault(self) -> bool:
        """Whether it reports a latched fault of the host; False for a kind that keeps none."""

    @property
    def round_trip(self) -> float:
        """From sending a command until its echo arrived [s]; NaN if unknown or not echoed."""

    def command(self, setpoints: Sequence[float] | None, now: float) -> Iterable[Frame]:
        """The frames of one cycle.

        Parameters
        ----------
        setpoints : sequence of float or None
            Fraction of full scale by muscle, in the rig's order; None: every valve vents.
        now : float
            Monotonic time [s].
        """

    def vent(self) -> Iterable[Frame]:
        """Frames that vent at once, in addition to `command`; empty if the kind has none."""

    def clear_faults(self) -> Iterable[Frame]:
        """Frames that clear its latched faults; empty if the kind has none."""

    def latch_fault(self) -> Iterable[Frame]:
        """Frames that make it keep a fault of the host until `clear_faults`; may be empty."""

    def acknowledge(self) -> None:
        """Discard conditions that are reported only once, such as a restart."""

    def silent(self, now: float, timeout: float) -> list[str]:
        """The names of the regular frames that are missing."""

    def conditions(
        self, now: float, timeout: float, sensor_timeout: float, moving: bool
    ) -> Iterator[Condition]:
        """What is wrong with the board; docs/driver.md lists the kinds of condition.

        Parameters
        ----------
        now : float
            Monotonic time [s].
        timeout : float
            A frame older than this is missing [s].
        sensor_timeout : float
            A measurement that is repeated for longer is frozen [s].
        moving : bool
            Whether the board has been commanded to let air move for at least `timeout`.
        """

    def counts(self) -> Mapping[str, int]:
        """Counts of events by name: frames lost, repeated and out of order, restarts."""

    def report(self) -> BoardReport:
        """What the diagnostics show."""


class Traffic(NamedTuple):
    """Frames of one identifier: how many bytes, and how many frames in a second [Hz]."""

    name: str
    frame_id: int
    length: int
    rate: float


@runtime_checkable
class DescribesItself(Protocol):
    """What a board may offer in addition, for tools that explain a rig before it runs."""

    def traffic(self, rate: float) -> Sequence[Traffic]:
        """Its frames in both directions, for a driver with `rate` cycles in a second [Hz]."""

    def wires(self) -> Mapping[tuple[str, Channel], str]:
        """By ("setpoint", "pressure" or "angle", channel), the signal that carries it."""


@runtime_checkable
class ExplainsPromises(Protocol):
    """What a board may offer in addition: its own words for promises that it does not give."""

    @property
    def without(self) -> Mapping[str, tuple[str, str]]:
        """By the name of a promise: what its absence means, and what makes up for it."""


@runtime_checkable
class NamesInvalidValues(Protocol):
    """What a board may offer in addition, for tools that explain a rig before it runs."""

    def invalid_values(self) -> Mapping[tuple[str, Channel], Mapping[int, str]]:
        """By measurement ("pressure", "angle" or "supply", channel), raw values that are none."""


@runtime_checkable
class HasDoubts(Protocol):
    """What a kind may offer in addition: what is odd about boards that can be used."""

    @property
    def doubts(self) -> Sequence[str]:
        """One line for each, known after `problems`; a person reads them before air is on."""


class BoardKind(Protocol):
    """A kind of board with its options; the registered `MakeKind` makes it once for a rig."""

    def problems(self, wired: Sequence[WiredBoard]) -> list[str]:
        """What is wrong with the rig file's boards of this kind, one line for each problem.

        Checks what only the kind knows: numbers, channels, its keys under `boards.<name>`.
        """

    def make(self, wired: WiredBoard) -> Board:
        """A new board for one driver; called only if `problems` has found none."""

    def stranger(self, frame_id: int, data: bytes) -> FrameError | None:
        """The error for a frame of no board in the rig; None if it is not of this kind."""


KindOptions = Mapping[str, str]
"""Options in addition to the rig file, by name: `dbc`, the path of a DBC file."""

MakeKind = Callable[[KindOptions], BoardKind]
"""The registered callable; raises a PamError for options that cannot be used."""
