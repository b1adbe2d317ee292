"""Converts the frames of the valve boards to messages and back, with the layout of the DBC file.

The layouts of `dbc` take a tenth of the time of a cantools call. The checksum is CRC-8 SAE J1850
(polynomial 0x1D, start and final XOR 0xFF) over the identifier, low byte first, and the payload
bytes before the checksum; a frame of zeros never passes it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from pam_driver.boards.frame_errors import (
    DbcError,
    EncodeError,
    FrameCrcError,
    FrameError,
    FrameLengthError,
    FrameRangeError,
    UnknownFrameError,
)
from pam_driver.boards.pam_board.dbc import (
    PROTOCOL_VERSION,
    BoardDbc,
    Layout,
    default_dbc_path,
    read_dbc,
)
from pam_driver.boards.pam_board.messages import (
    CHANNELS,
    BoardCode,
    BoardCommand,
    BoardFault,
    BoardMessage,
    BoardState,
    Heartbeat,
    Measurement,
    SafetyInput,
    Status,
    ValveCommand,
)

__all__ = [
    "CHANNELS",
    "PROTOCOL_VERSION",
    "BoardCode",
    "BoardCodec",
    "BoardCommand",
    "BoardFault",
    "BoardMessage",
    "BoardState",
    "DbcError",
    "EncodeError",
    "FrameCrcError",
    "FrameError",
    "FrameLengthError",
    "FrameRangeError",
    "Heartbeat",
    "Measurement",
    "SafetyInput",
    "Status",
    "UnknownFrameError",
    "ValveCommand",
    "crc8",
    "default_dbc_path",
]


def _crc_table(polynomial: int) -> tuple[int, ...]:
    table = []
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = ((crc << 1) ^ polynomial if crc & 0x80 else crc << 1) & 0xFF
        table.append(crc)
    return tuple(table)


_CRC_TABLE: Final = _crc_table(0x1D)


def crc8(frame_id: int, payload: bytes | bytearray) -> int:
    """CRC-8 SAE J1850 over the identifier, low byte first, and `payload`."""
    table = _CRC_TABLE
    crc = table[table[0xFF ^ (frame_id & 0xFF)] ^ (frame_id >> 8)]
    for byte in payload:
        crc = table[crc ^ byte]
    return crc ^ 0xFF


class BoardCodec:
    """Converts frames of the valve boards to messages and back; made by `from_dbc`.

    Attributes
    ----------
    board_count : int
        Largest number of boards on one bus; boards are numbered from 0.
    watchdog_timeout : float
        A board vents when it receives no valid valve command for this time [s].
    """

    def __init__(self, dbc: BoardDbc) -> None:
        layouts, board_count, self.watchdog_timeout = dbc
        self.board_count = board_count
        self._layouts = dict(layouts)
        # the bits of enable switches, brake and dump valve in a valve command
        self._switches: dict[tuple[tuple[bool, bool], bool, bool], int] = {}
        decoders: dict[str, Callable[[Layout, int, int], BoardMessage]] = {
            "BoardCommand": _decode_board_command,
            "ValveCommand": _decode_valve_command,
            "Measurement": _decode_measurement,
            "Status": _decode_status,
            "Heartbeat": _decode_heartbeat,
        }
        self._by_id = {
            layout.frame_id + board: (board, layout, layout.length, decoders[name])
            for name, layout in layouts.items()
            for board in range(board_count)
        }
        self._with_crc = frozenset(
            layout.frame_id + board
            for layout in layouts.values()
            if layout.fields[-1].name == "Crc"
            for board in range(board_count)
        )

    @classmethod
    def from_dbc(cls, path: str | Path | None = None, *, with_canopen: bool = False) -> BoardCodec:
        """Compile a DBC file, by default the one that comes with this package.

        Parameters
        ----------
        with_canopen : bool, optional
            Use the identifiers that share a bus with CANopen devices.

        Raises
        ------
        DbcError
            If the file cannot be read, is incomplete, or contradicts what the codec needs.
        """
        found = default_dbc_path() if path is None else path
        return cls(read_dbc(found, with_canopen=with_canopen))

    def frame_id(self, message: type[BoardMessage], board: int) -> int:
        """Identifier of one board's messages of a given kind."""
        if not 0 <= board < self.board_count:
            raise EncodeError(f"board {board}: expected 0 to {self.board_count - 1}")
        return self._layouts[message.__name__].frame_id + board

    def regular_frames(self) -> list[tuple[type[BoardMessage], int, float]]:
        """The messages that are sent regularly: length [bytes] and rate [Hz].

        The rate of a command is 0, since the driver's cycle decides it.
        """
        return [
            (kind, layout.length, 1000.0 / layout.period if kind is not ValveCommand else 0.0)
            for kind in (ValveCommand, Measurement, Status, Heartbeat)
            if (layout := self._layouts[kind.__name__]).period > 0.0
        ]

    def encode(self, board: int, message: BoardMessage) -> tuple[int, bytes]:
        """Identifier and payload of a message to or from a board.

        Raises
        ------
        EncodeError
            If a value is not finite (measurements may be NaN) or outside the range of the DBC.
        """
        frame_id = self.frame_id(type(message), board)
        layout = self._layouts[type(message).__name__]
        if isinstance(message, ValveCommand):
            return frame_id, self._payload(frame_id, layout, self._valve_command(layout, message))
        word = 0
        values: tuple[float, ...]
        if isinstance(message, Measurement):
            values = (*message.pressures, message.position, message.counter)
        elif isinstance(message, Status):
            values = (
                message.state,
                message.command_counter,
                message.supply_pressure,
                message.rejected_frames,
                message.emergency_stop,
                message.enabling_switch,
                message.brake_released,
                message.dump_closed,
                *(bool(message.faults & fault) for fault in BoardFault),
            )
        else:
            values = tuple(message)
        for field, value in zip(layout.fields, values, strict=False):
            word |= field.bits(value)
        return frame_id, self._payload(frame_id, layout, word)

    def _payload(self, frame_id: int, layout: Layout, word: int) -> bytes:
        """The bytes of a word, with the checksum if the frame has one."""
        payload = word.to_bytes(layout.length, "little")
        if frame_id in self._with_crc:
            payload = payload[:-1] + bytes((crc8(frame_id, payload[:-1]),))
        return payload

    def _valve_command(self, layout: Layout, message: ValveCommand) -> int:
        """The word of a valve command, which each board receives in each cycle."""
        valve0, valve1, enable0, enable1, counter, brake, dump = layout.fields[:7]
        (first, second), enable, count, release, close = message
        if not (-1.0 <= first <= 1.0 and -1.0 <= second <= 1.0):
            field, fraction = (valve1, second) if -1.0 <= first <= 1.0 else (valve0, first)
            raise EncodeError(f"{field.name} is {fraction}, expected -1 to 1 of full scale")
        switches = self._switches.get((enable, release, close))
        if switches is None:  # few combinations come again and again
            switches = enable0.bits(enable[0]) | enable1.bits(enable[1])
            switches |= brake.bits(release) | dump.bits(close)
            self._switches[enable, release, close] = switches
        return valve0.bits(first) | valve1.bits(second) | counter.bits(count) | switches

    def raw_frame(
        self, board: int, message: type[BoardMessage], raw: Mapping[str, int]
    ) -> tuple[int, bytes]:
        """A frame with raw values, which may be invalid, and a right checksum: to test boards.

        Parameters
        ----------
        board : int
            Number of the board.
        raw : mapping of str to int
            Raw value by signal; others are 0.
        """
        frame_id = self.frame_id(message, board)
        layout = self._layouts[message.__name__]
        word = 0
        for field in layout.fields:
            word |= (raw.get(field.name, 0) & field.mask) << field.shift
        return frame_id, self._payload(frame_id, layout, word)

    def decode(self, frame_id: int, data: bytes | bytearray) -> tuple[int, BoardMessage]:
        """Board number and message of a received frame.

        Raises
        ------
        FrameError
            For an unknown identifier, a wrong length, a wrong CRC or a value out of range.
        """
        entry = self._by_id.get(frame_id)
        if entry is None:
            raise UnknownFrameError(frame_id, "no message of the DBC has this identifier")
        board, layout, length, decode = entry
        if len(data) != length:
            raise FrameLengthError(
                frame_id, f"{layout.name} has {len(data)} bytes, expected {length}"
            )
        if frame_id in self._with_crc and crc8(frame_id, data[:-1]) != data[-1]:
            raise FrameCrcError(frame_id, f"{layout.name} fails its checksum")
        return board, decode(layout, int.from_bytes(data, "little"), frame_id)


def _decode_board_command(layout: Layout, word: int, frame_id: int) -> BoardCommand:
    code, argument, _ = layout.fields
    raw = code.raw(word, frame_id)
    return BoardCommand(BoardCode(raw), argument.raw(word, frame_id))


def _decode_valve_command(layout: Layout, word: int, frame_id: int) -> ValveCommand:
    valve0, valve1, enable0, enable1, counter, brake, dump, _ = layout.fields
    valves = (valve0.value(word, frame_id), valve1.value(word, frame_id))
    if math.isnan(valves[0] + valves[1]):
        raise FrameRangeError(frame_id, "a valve command is not available")
    return ValveCommand(
        valves,
        (enable0.raw(word, frame_id) != 0, enable1.raw(word, frame_id) != 0),
        counter.raw(word, frame_id),
        brake.raw(word, frame_id) != 0,
        dump.raw(word, frame_id) != 0,
    )


def _decode_measurement(layout: Layout, word: int, frame_id: int) -> Measurement:
    pressure0, pressure1, position, counter = layout.fields
    return Measurement(
        (pressure0.value(word, frame_id), pressure1.value(word, frame_id)),
        position.value(word, frame_id),
        counter.raw(word, frame_id),
    )


def _decode_status(layout: Layout, word: int, frame_id: int) -> Status:
    state, counter, supply, rejected, stop, enabling, brake, dump, *faults = layout.fields
    raised = BoardFault(0)
    for field, fault in zip(faults, BoardFault, strict=True):
        if field.raw(word, frame_id):
            raised |= fault
    return Status(
        BoardState(state.raw(word, frame_id)),
        raised,
        counter.raw(word, frame_id),
        supply.value(word, frame_id),
        rejected.raw(word, frame_id),
        _safety_input(stop.raw(word, frame_id)),
        _safety_input(enabling.raw(word, frame_id)),
        brake.raw(word, frame_id) != 0,
        dump.raw(word, frame_id) != 0,
    )


def _safety_input(raw: int) -> SafetyInput:
    """An input for people; a value that the protocol does not define forbids motion."""
    known = (SafetyInput.PERMIT, SafetyInput.NOT_AVAILABLE)
    return SafetyInput(raw) if raw in known else SafetyInput.STOP


def _decode_heartbeat(layout: Layout, word: int, frame_id: int) -> Heartbeat:
    uptime, protocol, firmware = layout.fields
    return Heartbeat(
        uptime.value(word, frame_id), protocol.raw(word, frame_id), firmware.raw(word, frame_id)
    )
