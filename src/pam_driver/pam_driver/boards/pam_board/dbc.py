"""Checks the DBC file and reduces it to integer shifts and scales.

cantools reads the DBC once and provides all bit positions, scales, ranges, reserved raw values and
identifiers. A raw value labelled "not_available" (VAL_) becomes NaN.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Final, NamedTuple

from cantools.database import Database
from cantools.database.can import Message as DbcMessage
from cantools.database.can import Signal

from pam_driver.boards.dbc_file import load_dbc
from pam_driver.boards.frame_errors import DbcError, EncodeError, FrameRangeError
from pam_driver.boards.pam_board.messages import BoardCode, BoardFault, BoardState

PROTOCOL_VERSION: Final = 2
CLASSIC_CAN_BYTES: Final = 8
_MAX_DBC_BYTES: Final = 1_000_000
_NOT_AVAILABLE: Final = "not_available"
_ID_WITH_CANOPEN: Final = "IdWithCanopen"

_FAULT_SIGNALS: Final = {
    f"Fault{''.join(part.title() for part in str(fault.name).split('_'))}": fault
    for fault in BoardFault
}
# The signals that each message must have, in the order in which the codec reads them, with units.
LAYOUT: Final[Mapping[str, Mapping[str, str]]] = {
    "BoardCommand": {"Code": "", "Argument": "", "Crc": ""},
    "ValveCommand": {
        "Valve0": "",
        "Valve1": "",
        "Enable0": "",
        "Enable1": "",
        "Counter": "",
        "ReleaseBrake": "",
        "CloseDump": "",
        "Crc": "",
    },
    "Measurement": {"Pressure0": "Pa", "Pressure1": "Pa", "Position": "rad", "Counter": ""},
    "Status": {
        "State": "",
        "CommandCounter": "",
        "SupplyPressure": "Pa",
        "RejectedFrames": "",
        "EmergencyStop": "",
        "EnablingSwitch": "",
        "BrakeReleased": "",
        "DumpClosed": "",
        **dict.fromkeys(_FAULT_SIGNALS, ""),
    },
    "Heartbeat": {"Uptime": "s", "ProtocolVersion": "", "FirmwareVersion": ""},
}
_MAY_BE_MISSING: Final = {"Valve0", "Valve1", "Pressure0", "Pressure1", "Position"} | {
    "SupplyPressure"
}


def default_dbc_path() -> Path:
    """Path of the DBC file of this package."""
    return Path(__file__).with_name("pam_board.dbc")


class Field:
    """One signal as shift, mask and scale."""

    __slots__ = ("factor", "high", "low", "mask", "missing", "name", "offset", "shift", "sign")

    def __init__(self, signal: Signal) -> None:
        self.name = signal.name
        self.shift = signal.start
        self.mask = (1 << signal.length) - 1
        self.sign = 1 << (signal.length - 1) if signal.is_signed else 0
        self.factor = float(signal.conversion.scale)
        self.offset = float(signal.conversion.offset)
        lowest, highest = -self.sign, (self.mask if not self.sign else self.sign - 1)
        low, high = signal.minimum, signal.maximum
        self.low = lowest if low is None else round((low - self.offset) / self.factor)
        self.high = highest if high is None else round((high - self.offset) / self.factor)
        labels = {str(name): raw for raw, name in (signal.choices or {}).items()}
        self.missing = labels.get(_NOT_AVAILABLE)

    def raw(self, word: int, frame_id: int) -> int:
        """The raw value from a payload given as one integer; reserved values are accepted."""
        raw = (word >> self.shift) & self.mask
        if raw & self.sign:
            raw -= self.mask + 1
        if (raw < self.low or raw > self.high) and raw != self.missing:
            raise FrameRangeError(
                frame_id, f"{self.name} is {raw} raw, expected {self.low} to {self.high}"
            )
        return raw

    def value(self, word: int, frame_id: int) -> float:
        """The physical value, NaN if the raw value means "not available"."""
        raw = (word >> self.shift) & self.mask
        if raw & self.sign:
            raw -= self.mask + 1
        if raw == self.missing:
            return math.nan
        if raw < self.low or raw > self.high:
            self.raw(word, frame_id)  # says so
        return raw * self.factor + self.offset

    def bits(self, value: float) -> int:
        """`value` as bits at its place; NaN becomes "not available" if the DBC has such a value."""
        if math.isnan(value):
            if self.missing is None:
                raise EncodeError(f"{self.name} is NaN, which the frame cannot represent")
            return (self.missing & self.mask) << self.shift
        scaled = (value - self.offset) / self.factor
        if not self.low - 0.5 <= scaled <= self.high + 0.5:
            low = self.low * self.factor + self.offset
            high = self.high * self.factor + self.offset
            raise EncodeError(f"{self.name} is {value:g}, expected {low:g} to {high:g}")
        raw = round(scaled)
        raw = self.low if raw < self.low else self.high if raw > self.high else raw
        return (raw & self.mask) << self.shift


class Layout(NamedTuple):
    """A message as the DBC describes it for board 0; `period` is its cycle time [ms] or 0."""

    name: str
    frame_id: int
    length: int
    fields: tuple[Field, ...]
    period: float


class BoardDbc(NamedTuple):
    """The content of a DBC file: layouts by message, boards on one bus, watchdog time [s]."""

    layouts: Mapping[str, Layout]
    board_count: int
    watchdog_timeout: float


def _attribute(path: Path, database: Database, name: str) -> int | str:
    """A network-wide attribute of the DBC."""
    attributes = database.dbc.attributes if database.dbc is not None else {}
    if name not in attributes:
        raise DbcError(f"{path}: attribute {name} is missing")
    value = attributes[name].value
    return value if isinstance(value, str) else int(value)


def read_dbc(path: str | Path, *, with_canopen: bool = False) -> BoardDbc:
    """Check that a DBC file has everything that the codec needs, and reduce it to layouts.

    Parameters
    ----------
    with_canopen : bool, optional
        Use the identifiers that the attribute `IdWithCanopen` gives to each message.

    Raises
    ------
    DbcError
        If the file cannot be read, is incomplete, or contradicts what the codec needs.
    """
    path = Path(path)
    database = load_dbc(path, _MAX_DBC_BYTES)
    profile = _attribute(path, database, "CrcProfile")
    if profile != "SAE_J1850":
        raise DbcError(f"{path}: attribute CrcProfile is {profile!r}, expected 'SAE_J1850'")
    version = _attribute(path, database, "ProtocolVersion")
    if version != PROTOCOL_VERSION:
        raise DbcError(f"{path}: attribute ProtocolVersion is {version}, not {PROTOCOL_VERSION}")
    board_count = int(_attribute(path, database, "BoardCount"))
    watchdog = int(_attribute(path, database, "WatchdogTimeout"))
    if board_count < 1 or watchdog < 1:
        raise DbcError(f"{path}: attributes BoardCount and WatchdogTimeout must be at least 1")
    messages = {message.name: message for message in database.messages}
    layouts = {name: _layout(path, messages.get(name), name) for name in LAYOUT}
    if with_canopen:
        layouts = {
            name: layout._replace(frame_id=_id_with_canopen(path, messages[name]))
            for name, layout in layouts.items()
        }
    taken: dict[int, str] = {}
    for layout in layouts.values():
        for frame_id in range(layout.frame_id, layout.frame_id + board_count):
            other = taken.setdefault(frame_id, layout.name)
            if other != layout.name or frame_id > 0x7FF:
                raise DbcError(
                    f"{path}: identifiers of {layout.name} for {board_count} boards overlap those "
                    f"of {other} or exceed 0x7FF"
                )
    return BoardDbc(layouts, board_count, watchdog * 1e-3)


def _id_with_canopen(path: Path, message: DbcMessage) -> int:
    """The identifier of a message on a bus with CANopen devices."""
    attributes = message.dbc.attributes if message.dbc is not None else {}
    if _ID_WITH_CANOPEN not in attributes:
        raise DbcError(f"{path}: attribute {_ID_WITH_CANOPEN} of {message.name} is missing")
    return int(attributes[_ID_WITH_CANOPEN].value)


def _layout(path: Path, message: DbcMessage | None, name: str) -> Layout:
    """One message, checked signal by signal."""
    if message is None:
        raise DbcError(f"{path}: message {name} is missing")
    if message.is_extended_frame or message.is_multiplexed():
        raise DbcError(f"{path}: {name} must have an 11 bit identifier and no multiplexing")
    if message.length > CLASSIC_CAN_BYTES:
        raise DbcError(
            f"{path}: {name} has {message.length} bytes, expected at most {CLASSIC_CAN_BYTES}: a "
            "pam_board uses classic CAN"
        )
    signals = {signal.name: signal for signal in message.signals}
    fields = []
    for signal_name, unit in LAYOUT[name].items():
        where = f"{path}: {name}.{signal_name}"
        signal = signals.get(signal_name)
        if signal is None:
            raise DbcError(f"{where} is missing")
        if signal.byte_order != "little_endian" or signal.conversion.is_float:
            raise DbcError(f"{where} must be a little-endian integer (@1)")
        if (signal.unit or "") != unit:
            raise DbcError(f"{where} has unit {signal.unit!r}, expected {unit!r}")
        field = Field(signal)
        if signal_name in _MAY_BE_MISSING and field.missing is None:
            raise DbcError(f"{where} reserves no raw value named {_NOT_AVAILABLE!r} (VAL_)")
        if signal_name == "Crc" and (field.shift, field.mask) != (8 * message.length - 8, 0xFF):
            raise DbcError(f"{where} must be the last byte of the frame")
        fields.append(field)
    _check_labels(path, signals)
    period = float(message.cycle_time or 0)
    return Layout(name, message.frame_id, message.length, tuple(fields), period)


def _check_labels(path: Path, signals: Mapping[str, Signal]) -> None:
    """Check that the value tables of states and codes are those that this driver knows."""
    for name, known in (("State", BoardState), ("Code", BoardCode)):
        signal = signals.get(name)
        if signal is None:
            continue
        labels = {int(raw): str(label) for raw, label in (signal.choices or {}).items()}
        expected = {int(item): item.name.lower() for item in known}
        if labels != expected or (signal.minimum, signal.maximum) != (min(expected), max(expected)):
            raise DbcError(f"{path}: values of {name} are {labels}, expected {expected}")
