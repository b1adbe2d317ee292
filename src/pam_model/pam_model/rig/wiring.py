"""Where a robot's muscles and joints are wired: buses, and boards with their channels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pam_model.rig.keys import Key


@dataclass(frozen=True, slots=True)
class Bus:
    """One CAN bus of a robot that has several; boards refer to it by its name."""

    # interface, channel: as python-can takes them
    interface: str = "socketcan"
    channel: str = "can0"
    # fmt: off
    bitrate: Annotated[int, Key("bit/s", 10_000, 1_000_000,
        text="for the bus load; with CAN FD, that of the arbitration phase")] = 1_000_000
    fd: bool = False  # whether CAN FD frames are used
    data_bitrate: Annotated[int, Key("bit/s", 10_000, 8_000_000,
        text="of the data phase of CAN FD frames")] = 2_000_000
    port: Annotated[int, Key("-", 1024, 65535, text="UDP port, used by udp_multicast only")] = 43113
    # fmt: on
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
