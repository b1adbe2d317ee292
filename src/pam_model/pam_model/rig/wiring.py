"""Where a robot's muscles and joints are wired: buses, and boards with their channels."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Bus:
    """One CAN bus of a robot that has several; boards refer to it by its name.

    Attributes
    ----------
    interface, channel : str
        As python-can takes them.
    bitrate : int
        [bit/s]; of CAN FD that of the arbitration phase.
    fd : bool
        Whether CAN FD frames are used.
    data_bitrate : int
        Of the data phase of CAN FD frames [bit/s].
    port : int
        UDP port, used by the interface udp_multicast only.
    options : str
        Further options of the interface: name=value, name=value.
    canopen : bool
        Whether CANopen devices share the bus; their identifiers are then refused to boards.
    """

    interface: str = "socketcan"
    channel: str = "can0"
    bitrate: int = 1_000_000
    fd: bool = False
    data_bitrate: int = 2_000_000
    port: int = 43113
    options: str = ""
    canopen: bool = False


@dataclass(frozen=True, slots=True)
class Encoder:
    """The board that measures a joint's angle, and the channel on it; see `Muscle.board`."""

    board: int | str
    channel: int | str = 0


@dataclass(frozen=True, slots=True)
class PressureSensor:
    """The board that measures a muscle's pressure, and the channel on it; see `Muscle.board`."""

    board: int | str
    channel: int | str
