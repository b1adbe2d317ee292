"""What the driver asks of a kind of board, and what a board promises: the whole protocol.

A *kind* (`BoardKind`) is registered under a name, see `register`. It checks the part of a rig file
that concerns its boards and makes one `Board` for each. A `Board` turns set points into frames
and frames into measurements; the driver's core sends, receives, judges and never looks at a
payload. What a board cannot do is said in its `Promises` and not worked around in the core: a
device without enable, counter, watchdog or status is a `Board` with weaker promises.

Values are in SI units on this side of the protocol: pressures in Pa gauge, the supply in Pa
absolute, angles in rad, times in s. A set point is a fraction of the valve's full scale (-1 to 1
for a flow valve, 0 to 1 of `valve.full_scale` for a pressure regulator); the wires of a board hold
its muscles, so that a device in other units can convert. Identifiers are whole numbers with
`EXTENDED` set for 29 bits. Every board names its bus; "" is the only one of a rig that has one.

docs/new_board.md shows how to add a kind; the checks for it and its simulated twin are in
`tests/helpers/support/board_conformance.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, Protocol

from pam_driver.boards.frame_errors import FrameError
from pam_model.rig import Joint, Muscle

NEVER: Final = -math.inf
Frame = tuple[int, bytes]
"""Identifier and payload."""
Channel = int | str
"""An input or output of a board, as the rig file names it."""
Address = int | str
"""A board, as the rig file names it: a number, or the name of its section under `boards`."""
Hear = Callable[[bytes, float, float], None]
"""Takes a payload, the time it was measured (monotonic) and its stamp (wall clock) [s]."""


class Condition(NamedTuple):
    """Something wrong: its kind, who is concerned, and a line for a person."""

    kind: str
    subject: str
    text: str

    def __str__(self) -> str:
        return f"{self.subject}: {self.text}" if self.subject else self.text


class Sample(NamedTuple):
    """A value with the times it was measured: monotonic for ages, wall clock for stamps [s]."""

    value: float = math.nan
    time: float = NEVER
    stamp: float = 0.0


class MuscleWire(NamedTuple):
    """One muscle on a board: which channel drives or measures it, its place in the rig's order."""

    channel: Channel
    place: int
    muscle: Muscle


class JointWire(NamedTuple):
    """One joint whose angle a board measures, and its place in the rig's order."""

    channel: Channel
    place: int
    joint: Joint


@dataclass(frozen=True, slots=True)
class WiredBoard:
    """One board as the rig file describes it.

    Attributes
    ----------
    address : int or str
        As muscles and joints name it.
    settings : mapping
        Its section of the rig file (`boards.<name>`), empty for a board that has only a number;
        `kind` and `bus` are read by the driver, everything else belongs to the kind.
    valves, pressures : tuple of MuscleWire
        Muscles whose valve it drives, and whose pressure it measures.
    angles : tuple of JointWire
        Joints whose angle it measures.
    """

    address: Address
    settings: Mapping[str, Any]
    valves: tuple[MuscleWire, ...]
    pressures: tuple[MuscleWire, ...]
    angles: tuple[JointWire, ...]

    @property
    def name(self) -> str:
        """What messages and diagnostics call it."""
        return f"board {self.address}"

    @property
    def bus(self) -> str:
        """The bus it is on; "" is the only one."""
        return str(self.settings.get("bus", ""))


@dataclass(frozen=True, slots=True)
class Promises:
    """What a board does for safety by itself; the core and the documents rely on it.

    Attributes
    ----------
    watchdog : float or None
        It vents when it has heard no valid command for so long [s]; None: it never does.
    latches : bool
        After its watchdog or a fault it stays vented until the faults are cleared.
    needs_arming : bool
        After power-up, a vent or a fault it opens a valve only when it has heard a command that
        enables none.
    tells_state : bool
        It says whether its valves follow the set points.
    tells_faults : bool
        It says what is wrong with it.
    echoes_commands : bool
        It repeats something of the last command, so that a deaf board is found.
    counts_samples : bool
        Its measurements carry a counter, so that a frozen board and lost frames are found.
    has_heartbeat : bool
        It shows that it has restarted.
    has_checksum : bool
        Commands are protected by a checksum, and a corrupted one is refused.
    measures_supply : bool
        It measures the supply pressure.
    """

    watchdog: float | None
    latches: bool
    needs_arming: bool
    tells_state: bool
    tells_faults: bool
    echoes_commands: bool
    counts_samples: bool
    has_heartbeat: bool
    has_checksum: bool
    measures_supply: bool


class Identifiers(NamedTuple):
    """The identifiers of one board: frames that it sends, and frames that are sent to it."""

    answers: tuple[int, ...]
    commands: tuple[int, ...]


class BoardReport(NamedTuple):
    """What the diagnostics show of a board: its state in words, and named values."""

    text: str
    values: Mapping[str, object]


class Board(Protocol):
    """One board of the rig, as the driver's core sees it.

    Everything is called from the driver's I/O thread or under its lock, and nothing may wait.
    """

    @property
    def name(self) -> str:
        """What messages and diagnostics call it; the subject of its conditions."""

    @property
    def promises(self) -> Promises:
        """What it does for safety by itself."""

    @property
    def identifiers(self) -> Identifiers:
        """The identifiers of its frames."""

    @property
    def listeners(self) -> Mapping[int, Hear]:
        """By identifier, who takes the payload; raises `FrameError` for one that is no message.

        Identifiers of commands to the board are in it where a second driver can be told by them;
        their listener raises `ForeignCommandError`.
        """

    @property
    def pressures(self) -> Mapping[Channel, Sample]:
        """By channel the last pressure that was available [Pa gauge]; always the same object."""

    @property
    def angles(self) -> Mapping[Channel, Sample]:
        """By channel the last angle that was available [rad]; always the same object."""

    @property
    def supply_pressure(self) -> float:
        """What it measured last [Pa absolute], NaN if it does not measure it."""

    @property
    def follows(self) -> bool:
        """Whether its valves follow the set points, as far as it says."""

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
        """Frames that vent at once, beside the `command` of the cycle; nothing if there is none."""

    def clear_faults(self) -> Iterable[Frame]:
        """Frames that clear its latched faults; nothing if it has none."""

    def acknowledge(self) -> None:
        """Forget what was only to be reported once, such as a restart."""

    def silent(self, now: float, timeout: float) -> list[str]:
        """Which of the frames that it sends regularly are missing, in words."""

    def conditions(
        self, now: float, timeout: float, sensor_timeout: float, moving: bool
    ) -> Iterator[Condition]:
        """What is wrong with it; its kinds of condition are listed in docs/driver.md.

        Parameters
        ----------
        now : float
            Monotonic time [s].
        timeout : float
            A frame older than this is missing [s].
        sensor_timeout : float
            A measurement that repeats itself for longer is frozen [s].
        moving : bool
            Whether the board has been told to let air move for at least `timeout`.
        """

    def counts(self) -> Mapping[str, int]:
        """What happened how often, by name: frames lost, repeated, out of order, restarts."""

    def report(self) -> BoardReport:
        """What the diagnostics show."""


class BoardKind(Protocol):
    """A kind of board with its options; made once for a rig by what is registered."""

    def problems(self, wired: Sequence[WiredBoard]) -> list[str]:
        """What is wrong with the rig file's boards of this kind, a line each.

        Checks what only the kind knows: numbers, channels, its keys under `boards.<name>`.
        """

    def make(self, wired: WiredBoard) -> Board:
        """A board of its own for one driver; `problems` has found none."""

    def stranger(self, frame_id: int, data: bytes) -> FrameError | None:
        """What a frame is that belongs to no board of the rig; None if it is not of this kind."""


KindOptions = Mapping[str, str]
"""What a user gives beside the rig file, by name: `dbc`, the path of a DBC file."""

MakeKind = Callable[[KindOptions], BoardKind]
"""What is registered; raises a PamError for options that cannot be used."""
