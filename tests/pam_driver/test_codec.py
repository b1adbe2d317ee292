"""The compiled codec against cantools, and its refusals."""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import Any

import cantools
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pam_driver.boards.pam_board.codec import (
    BoardCode,
    BoardCodec,
    BoardCommand,
    BoardFault,
    BoardState,
    DbcError,
    EncodeError,
    FrameCrcError,
    FrameError,
    FrameLengthError,
    FrameRangeError,
    Heartbeat,
    Measurement,
    SafetyInput,
    Status,
    UnknownFrameError,
    ValveCommand,
    crc8,
    default_dbc_path,
)

CODEC = BoardCodec.from_dbc()
DATABASE = cantools.database.load_file(default_dbc_path())
BYTE = st.integers(0, 255)
BOARD = st.integers(0, 15)
FRACTION = st.floats(-1.0, 1.0)
PRESSURE = st.floats(-100_000.0, 1_210_680.0) | st.just(math.nan)
POSITION = st.floats(-8.388607, 8.388607) | st.just(math.nan)
SUPPLY = st.floats(0.0, 1_310_680.0) | st.just(math.nan)

MESSAGES = st.one_of(
    st.builds(BoardCommand, st.sampled_from(BoardCode), st.integers(0, 65535)),
    st.builds(
        ValveCommand,
        st.tuples(FRACTION, FRACTION),
        st.tuples(st.booleans(), st.booleans()),
        BYTE,
        st.booleans(),
        st.booleans(),
    ),
    st.builds(Measurement, st.tuples(PRESSURE, PRESSURE), POSITION, BYTE),
    st.builds(
        Status,
        st.sampled_from(BoardState),
        st.integers(0, 2 * max(BoardFault) - 1).map(BoardFault),
        BYTE,
        SUPPLY,
        st.integers(0, 65535),
        st.sampled_from(SafetyInput),
        st.sampled_from(SafetyInput),
        st.booleans(),
        st.booleans(),
    ),
    st.builds(Heartbeat, st.floats(0.0, 4294967.295), BYTE, st.integers(0, 65535)),
)


def signals_of(message: Any) -> dict[str, float]:
    """The same message as cantools wants it, without its checksum."""
    if isinstance(message, BoardCommand):
        return {"Code": message.code, "Argument": message.argument}
    if isinstance(message, ValveCommand):
        return {
            "Valve0": message.valves[0],
            "Valve1": message.valves[1],
            "Enable0": message.enable[0],
            "Enable1": message.enable[1],
            "Counter": message.counter,
            "ReleaseBrake": message.release_brake,
            "CloseDump": message.close_dump,
        }
    if isinstance(message, Measurement):
        return {
            "Pressure0": message.pressures[0],
            "Pressure1": message.pressures[1],
            "Position": message.position,
            "Counter": message.counter,
        }
    if isinstance(message, Status):
        faults = {
            "FaultWatchdog": 0,
            "FaultCrc": 1,
            "FaultOverPressure": 2,
            "FaultSensor": 3,
            "FaultSupply": 4,
            "FaultValve": 5,
            "FaultTemperature": 6,
            "FaultInternal": 7,
            "FaultHost": 8,
            "FaultEmergencyStop": 9,
        }
        return {
            "State": message.state,
            "CommandCounter": message.command_counter,
            "SupplyPressure": message.supply_pressure,
            "RejectedFrames": message.rejected_frames,
            "EmergencyStop": message.emergency_stop,
            "EnablingSwitch": message.enabling_switch,
            "BrakeReleased": message.brake_released,
            "DumpClosed": message.dump_closed,
            **{name: message.faults >> bit & 1 for name, bit in faults.items()},
        }
    return {
        "Uptime": message.uptime,
        "ProtocolVersion": message.protocol_version,
        "FirmwareVersion": message.firmware_version,
    }


@given(BOARD, MESSAGES)
def test_encodes_what_cantools_encodes(board: int, message: Any) -> None:
    frame_id, data = CODEC.encode(board, message)
    description = DATABASE.get_message_by_name(type(message).__name__)
    missing = {"Pressure0": 65535, "Pressure1": 65535, "Position": -8388608}
    missing["SupplyPressure"] = 65535
    signals = signals_of(message)
    # raw values by cantools' own scaling, so that "not available" can be said
    raw = {
        name: missing[name]
        if math.isnan(value)
        else description.get_signal_by_name(name).conversion.numeric_scaled_to_raw(value)
        for name, value in signals.items()
    }
    if "Crc" in description.signal_tree:
        raw["Crc"] = data[-1]
    assert frame_id == description.frame_id + board
    assert data == description.encode(raw, scaling=False, strict=False)


@given(BOARD, MESSAGES)
def test_decodes_what_cantools_decodes(board: int, message: Any) -> None:
    frame_id, data = CODEC.encode(board, message)
    heard_board, heard = CODEC.decode(frame_id, data)
    description = DATABASE.get_message_by_name(type(message).__name__)
    expected = description.decode(data, decode_choices=False)
    raw = description.decode(data, decode_choices=False, scaling=False)
    assert heard_board == board
    assert type(heard) is type(message)
    for name, value in signals_of(heard).items():
        choices = description.get_signal_by_name(name).choices or {}
        if str(choices.get(raw[name])) == "not_available":
            assert math.isnan(value) or value is SafetyInput.NOT_AVAILABLE
        else:
            assert value == expected[name]


@given(BOARD, MESSAGES)
def test_a_message_survives_within_half_a_step(board: int, message: Any) -> None:
    _, heard = CODEC.decode(*CODEC.encode(board, message))
    description = DATABASE.get_message_by_name(type(message).__name__)
    for (name, sent), got in zip(
        signals_of(message).items(), signals_of(heard).values(), strict=True
    ):
        step = float(description.get_signal_by_name(name).conversion.scale)
        assert (math.isnan(sent) and math.isnan(got)) or abs(sent - got) <= 0.5001 * step


@given(st.integers(0, 0x1FFFFFFF), st.binary(max_size=64))
def test_random_bytes_are_a_message_or_a_frame_error(frame_id: int, data: bytes) -> None:
    try:
        board, message = CODEC.decode(frame_id, data)
    except FrameError as error:
        assert error.kind and "\n" not in str(error)
    else:
        # fields the DBC leaves unused are not looked at
        assert CODEC.decode(*CODEC.encode(board, message))[0] == board


@given(st.sampled_from([0x080, 0x100, 0x180, 0x280, 0x700]), BOARD, st.binary(max_size=12))
def test_random_payloads_of_known_frames(base: int, board: int, data: bytes) -> None:
    try:
        message = CODEC.decode(base + board, data)[1]
    except FrameError:
        return
    if isinstance(message, ValveCommand):
        assert all(-1.0 <= value <= 1.0 for value in message.valves)


@given(BOARD, FRACTION, BYTE, st.integers(0, 63))
def test_one_flipped_bit_of_a_command_is_noticed(
    board: int, fraction: float, counter: int, bit: int
) -> None:
    command = ValveCommand((fraction, -fraction), (True, True), counter)
    frame_id, data = CODEC.encode(board, command)
    damaged = (int.from_bytes(data, "little") ^ (1 << bit)).to_bytes(8, "little")
    with pytest.raises(FrameCrcError):
        CODEC.decode(frame_id, damaged)


@pytest.mark.parametrize("kind", [BoardCommand, ValveCommand])
@pytest.mark.parametrize("byte", [0x00, 0xFF])
def test_frames_of_zeros_or_ones_are_no_command(kind: type, byte: int) -> None:
    for board in range(16):
        length = 4 if kind is BoardCommand else 8
        with pytest.raises(FrameError):
            CODEC.decode(CODEC.frame_id(kind, board), bytes([byte]) * length)


def test_a_command_for_one_board_is_none_for_another() -> None:
    frame_id, data = CODEC.encode(3, ValveCommand((0.5, 0.5), (True, True), 7))
    for board in set(range(16)) - {3}:
        with pytest.raises(FrameCrcError):
            CODEC.decode(frame_id - 3 + board, data)


def test_checksum_is_the_published_one() -> None:
    # the catalogue's check value is over "123456789"; identifier 0x3231 is its first two bytes
    assert crc8(0x3231, b"3456789") == 0x4B


@pytest.mark.parametrize(
    ("frame_id", "data", "error"),
    [
        (0x110, b"\0" * 8, UnknownFrameError),
        (0x7FF, b"", UnknownFrameError),
        (0x180, b"\0" * 7, FrameLengthError),
        (0x180, b"", FrameLengthError),
        (0x280, b"\x04" + b"\0" * 7, FrameRangeError),
    ],
)
def test_what_is_wrong_has_a_kind(frame_id: int, data: bytes, error: type[FrameError]) -> None:
    with pytest.raises(error, match=f"0x{frame_id:03X}"):
        CODEC.decode(frame_id, data)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1.001, -1.001])
def test_a_command_out_of_range_is_not_encoded(value: float) -> None:
    with pytest.raises(EncodeError, match="Valve1"):
        CODEC.encode(0, ValveCommand((0.0, value), (True, True), 0))


@pytest.mark.parametrize("board", [-1, 16])
def test_a_board_that_cannot_be_is_not_addressed(board: int) -> None:
    with pytest.raises(EncodeError, match="0 to 15"):
        CODEC.encode(board, BoardCommand(BoardCode.VENT))


def test_layout_in_bytes() -> None:
    """The layout as docs/can_protocol.md says it, by hand."""
    _, data = CODEC.encode(2, Measurement((150_000.0, 0.0), -1.5, 9))
    assert data[:4] == struct.pack("<HH", 12_500, 5_000)
    assert data[4:7] == (-1_500_000).to_bytes(3, "little", signed=True)
    assert data[7] == 9


BAD_DBC = {
    "no message": (
        lambda text: text.replace("BO_ 384 Measurement", "BO_ 384 Other"),
        "Measurement",
    ),
    "no signal": (lambda text: text.replace(" Position ", " Angle "), "Position is missing"),
    "bar": (lambda text: text.replace('[-100000|1210680] "Pa"', '[-100000|1210680] "bar"'), "bar"),
    "big-endian": (
        lambda text: text.replace("SG_ Uptime : 0|32@1+", "SG_ Uptime : 7|32@0+"),
        "little-endian",
    ),
    "no reserved value": (
        lambda text: text.replace('VAL_ 384 Position -8388608 "not_available" ;', ""),
        "not_available",
    ),
    "16 bytes": (
        lambda text: text.replace("BO_ 384 Measurement: 8", "BO_ 384 Measurement: 16"),
        "Measurement has 16 bytes, expected at most 8: a pam_board uses classic CAN",
    ),
    "other states": (lambda text: text.replace('3 "fault"', '3 "broken"'), "State"),
    "overlap": (lambda text: text.replace(" 384 ", " 260 "), "overlap"),
    "other checksum": (lambda text: text.replace("SAE_J1850", "ISO_1"), "CrcProfile"),
    "checksum not last": (
        lambda text: text.replace("SG_ Crc : 56|8", "SG_ Crc : 48|8"),
        "last byte",
    ),
    "no protocol": (lambda text: text.replace("ProtocolVersion", "Version"), "ProtocolVersion"),
    "other protocol": (
        lambda text: text.replace('BA_ "ProtocolVersion" 2', 'BA_ "ProtocolVersion" 1'),
        "ProtocolVersion",
    ),
    "nonsense": (lambda text: text[: len(text) // 3] + "%%%", "not a valid DBC"),
    "empty": (lambda text: "", "not a valid DBC"),
}


@pytest.mark.parametrize("name", BAD_DBC)
def test_a_bad_dbc_is_refused_by_name(name: str, tmp_path: Path) -> None:
    change, expected = BAD_DBC[name]
    text = default_dbc_path().read_text()
    changed = change(text)
    assert changed != text
    path = tmp_path / "board.dbc"
    path.write_text(changed)
    with pytest.raises(DbcError, match=expected) as caught:
        BoardCodec.from_dbc(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_dbc_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(DbcError, match="cannot be read"):
        BoardCodec.from_dbc(tmp_path / "none.dbc")
    with pytest.raises(DbcError, match="cannot be read"):
        BoardCodec.from_dbc(tmp_path)


def test_a_huge_file_is_not_parsed(tmp_path: Path) -> None:
    path = tmp_path / "huge.dbc"
    path.write_bytes(b" " * 1_000_001)
    with pytest.raises(DbcError, match="larger"):
        BoardCodec.from_dbc(path)


def test_config_holds_the_dbc_that_is_shipped() -> None:
    config = Path(__file__).parents[2] / "config/pam_board.dbc"
    assert config.read_bytes() == default_dbc_path().read_bytes()
