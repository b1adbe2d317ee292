"""Where a robot's muscles and joints are wired: buses, and boards with their channels."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Bus:
    """One CAN bus of a robot that has several; boards refer to it by its name."""

    # interface, channel: as python-can takes them
    interface: str = "socketcan"
    channel: str = "can0"
    bitrate: int = 1_000_000  # [bit/s]; of CAN FD that of the arbitration phase
    fd: bool = False  # whether CAN FD frames are used
    data_bitrate: int = 2_000_000  # of the data phase of CAN FD frames [bit/s]
    port: int = 43113  # UDP port, used by the interface udp_multicast only
    options: str = ""  # further options of the interface: name=value, name=value
    # whether CANopen devices share the bus; their identifiers are then refused to boards
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
