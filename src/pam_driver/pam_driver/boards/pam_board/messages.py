"""The messages between the valve boards and the driver, in SI units.

`codec` converts them to frames and back; docs/can_protocol.md describes how a board reacts to them.
"""

from __future__ import annotations

from enum import IntEnum, IntFlag
from typing import Final, NamedTuple

CHANNELS: Final = 2


class BoardCode(IntEnum):
    """The action that a `BoardCommand` requests."""

    VENT = 1
    CLEAR_FAULTS = 2
    LATCH_FAULT = 3


class BoardState(IntEnum):
    """State of a board; air flows into a muscle in `ACTIVE` only."""

    BOOT = 0
    VENTED = 1
    ACTIVE = 2
    FAULT = 3


class BoardFault(IntFlag):
    """Latched faults of a board, one bit each in `Status`; `HOST` is one that the driver sent."""

    WATCHDOG = 1
    CRC = 2
    OVER_PRESSURE = 4
    SENSOR = 8
    SUPPLY = 16
    VALVE = 32
    TEMPERATURE = 64
    INTERNAL = 128
    HOST = 256
    EMERGENCY_STOP = 512


class SafetyInput(IntEnum):
    """An input for people; 0, the value of an open wire, always forbids motion."""

    STOP = 0
    PERMIT = 1
    NOT_AVAILABLE = 3


class BoardCommand(NamedTuple):
    """Vent at once, clear latched faults, or latch a fault of the host."""

    code: BoardCode
    argument: int = 0


class ValveCommand(NamedTuple):
    """Both valves of a board for one cycle."""

    valves: tuple[float, float]  # fraction of full scale per channel, -1 to 1
    enable: tuple[bool, bool]  # false vents the channel regardless of `valves`
    counter: int  # 0 to 255, one more than in the previous frame
    # release_brake, close_dump: outputs for a brake and for the dump valve of the supply; False is
    # the safe value
    release_brake: bool = False
    close_dump: bool = False


class Measurement(NamedTuple):
    """One sample of a board: gauge pressures [Pa] and joint angle [rad], NaN if not available."""

    pressures: tuple[float, float]
    position: float
    counter: int


class Status(NamedTuple):
    """State of a board; supply pressure in Pa absolute, NaN if not available."""

    state: BoardState
    faults: BoardFault
    command_counter: int
    supply_pressure: float
    rejected_frames: int
    emergency_stop: SafetyInput = SafetyInput.NOT_AVAILABLE
    enabling_switch: SafetyInput = SafetyInput.NOT_AVAILABLE
    brake_released: bool = False
    dump_closed: bool = False


class Heartbeat(NamedTuple):
    """Sign of life: time since power-up [s] and versions."""

    uptime: float
    protocol_version: int
    firmware_version: int


BoardMessage = BoardCommand | ValveCommand | Measurement | Status | Heartbeat
