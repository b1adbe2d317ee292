"""Frames of mapped devices: the same bits as cantools, and the checksums of their standards."""

from __future__ import annotations

import math
import struct

import cantools
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from pam_driver.boards.frame_errors import FrameCrcError, FrameLengthError
from pam_driver.boards.mapped.checksum import ALGORITHMS
from pam_driver.boards.mapped.signal_layout import SignalLayout, frame_length
from pam_driver.boards.units import UNITS, Linear, scale_of
from support.mapped_device import ELBOW_VENDOR, board_of, vendor_dbc

CHECK_VALUES = {  # of "123456789", from the catalogue of parametrised CRC algorithms
    "crc8": 0xF4,
    "crc8_sae_j1850": 0x4B,
    "crc8_sae_j1850_zero": 0x37,
    "crc8_autosar": 0xDF,
    "crc16_ccitt": 0x29B1,
    "crc16_xmodem": 0x31C3,
    "xor8": 0x31,
    "sum8": 0xDD,
    "sum8_negative": 0x23,
}


@st.composite
def signals(draw: st.DrawFn) -> tuple[str, int]:
    """A DBC file with one message of one signal anywhere in it; and the message's length."""
    length = draw(st.integers(1, 8))
    big = draw(st.booleans())
    is_float = draw(st.booleans())
    bits = draw(st.sampled_from((16, 32, 64))) if is_float else draw(st.integers(1, 8 * length))
    assume(bits <= 8 * length)
    first = draw(st.integers(0, 8 * length - bits))
    start = 8 * (first // 8) + 7 - first % 8 if big else first
    scale = draw(st.sampled_from((1.0, 0.001, -0.5, 12.0)))
    offset = draw(st.sampled_from((0.0, -100.0, 0.25)))
    sign = "-" if is_float or draw(st.booleans()) else "+"
    text = (
        'VERSION ""\nBS_:\nBU_: A\n'
        f"BO_ 291 M: {length} A\n"
        f' SG_ S : {start}|{bits}@{0 if big else 1}{sign} ({scale},{offset}) [0|0] "" A\n'
    )
    if is_float:
        text += f"SIG_VALTYPE_ 291 S : {2 if bits == 64 else 1};\n"
    assume(not is_float or bits != 16)  # a DBC file has no 16 bit float
    return text, length


@given(signals(), st.binary(min_size=8, max_size=8))
def test_any_signal_has_the_bits_that_cantools_reads(made: tuple[str, int], noise: bytes) -> None:
    text, length = made
    (message,) = cantools.database.load_string(text, "dbc").messages
    layout = SignalLayout(message, message.signals[0])
    data = noise[:length]
    expected = float(message.decode(data)["S"])  # type: ignore[call-overload, index]
    raw = layout.raw(int.from_bytes(data, "little"), int.from_bytes(data, "big"))
    value = layout.physical(raw)
    if not math.isfinite(expected):
        assert math.isnan(value)
        return
    assert value == pytest.approx(expected, rel=1e-12, abs=1e-300)
    bits = layout.bits_of_counts(layout.number(raw))
    order = "big" if layout.big else "little"
    again = message.decode(bits.to_bytes(length, order))["S"]  # type: ignore[arg-type, call-overload, index]
    assert float(again) == pytest.approx(expected, rel=1e-12, abs=1e-300)


def test_a_set_point_above_the_range_of_a_short_float_is_limited() -> None:
    """6 bar in Pa is more than a float of 16 bits can carry."""
    text = (
        'VERSION ""\nBS_:\nBU_: A\nBO_ 291 M: 2 A\n SG_ S : 7|16@0- (1,0) [0|0] "Pa" A\n'
        "SIG_VALTYPE_ 291 S : 1;\n"
    )
    (message,) = cantools.database.load_string(text, "dbc").messages
    layout = SignalLayout(message, message.signals[0])
    assert layout.high == 65504.0
    assert layout.number(layout.bits_of_counts(6e5)) == 65504.0
    assert layout.number(layout.bits_of_counts(-6e5)) == -65504.0


@pytest.mark.parametrize("name", ALGORITHMS)
def test_a_checksum_has_the_check_value_of_its_standard(name: str) -> None:
    assert ALGORITHMS[name].compute(b"123456789") == CHECK_VALUES[name]


@pytest.mark.parametrize(
    ("unit", "si"),
    [
        ("Pa", 1.0),
        ("hPa", 100.0),
        ("mbar", 100.0),
        ("kPa", 1e3),
        ("bar", 1e5),
        ("MPa", 1e6),
        ("psi", 6894.757),
        ("rad", 1.0),
        ("mrad", 0.001),
        ("deg", 0.017453293),
        ("rev", 6.283185307),
        ("percent", 0.01),
    ],
)
def test_a_unit_is_worth_what_its_definition_says(unit: str, si: float) -> None:
    assert UNITS[unit].factor == pytest.approx(si, rel=1e-7)


def test_two_points_say_what_a_voltage_means() -> None:
    linear = scale_of("mA", {"mA": [4.0, 20.0], "bar": [0.0, 10.0]}, ("pressure",))
    assert isinstance(linear, Linear)
    assert [linear.si(current) for current in (4.0, 12.0, 20.0)] == pytest.approx([0.0, 5e5, 1e6])
    assert linear.device(2.5e5) == pytest.approx(8.0)


def test_a_command_is_what_cantools_reads_with_the_vendors_file() -> None:
    """Set points in bar, mode, counter and checksum of the example, seen by another decoder."""
    database = cantools.database.load_file(vendor_dbc())
    message = database.get_message_by_name("PVM_Demand")
    board = board_of(ELBOW_VENDOR)
    seen = []
    for now, fraction in ((1.0, 0.5), (1.002, 0.25)):
        ((frame_id, data),) = board.command((fraction, 1.0), now)
        assert frame_id & 0x1FFF_FFFF == message.frame_id
        seen.append(message.decode(data))
        covered = bytes([0x5A]) + data[:7]
        assert data[7] == reference_crc8(covered)
    assert [values["P_Dem_A"] for values in seen] == pytest.approx([3.0, 1.5])
    assert [values["P_Dem_B"] for values in seen] == pytest.approx([6.0, 6.0])
    assert [str(values["Op_Mode"]) for values in seen] == ["run", "run"]
    assert seen[1]["Roll_Cnt"] == (seen[0]["Roll_Cnt"] + 1) % 16
    ((_, data),) = board.command(None, 2.0)
    values = message.decode(data)
    assert (values["P_Dem_A"], values["P_Dem_B"], str(values["Op_Mode"])) == (0.0, 0.0, "off")
    ((_, data),) = board.clear_faults()
    assert str(message.decode(data)["Op_Mode"]) == "reset"


def reference_crc8(data: bytes) -> int:
    """CRC-8 SAE J1850, bit by bit."""
    value = 0xFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = (value << 1 ^ 0x1D if value & 0x80 else value << 1) & 0xFF
    return value ^ 0xFF


def actual(pressure_a: float, pressure_b: float, supply: float, count: int) -> bytes:
    """A measurement of the example's device, written by hand: absolute bar, big-endian."""
    words = [
        round((value - zero) / 0.0005)
        for value, zero in ((pressure_a, 0.5), (pressure_b, 0.5), (supply, 0.0))
    ]
    data = struct.pack(">HHHB", *words, count)
    return data + bytes([reference_crc8(bytes([0x5B]) + data)])


def test_absolute_bar_and_turned_degrees_become_gauge_pascal_and_radian() -> None:
    board = board_of(ELBOW_VENDOR)
    measured, joint, _ = board.identifiers.answers
    board.listeners[measured](actual(3.01325, 1.51325, 7.0, 1), 5.0, 105.0)
    assert board.pressures["port_a"].value == pytest.approx(2e5, abs=30.0)
    assert board.pressures["port_b"].value == pytest.approx(0.5e5, abs=30.0)
    assert board.pressures["port_a"][1:] == (5.0, 105.0)
    assert board.supply_pressure == pytest.approx(7e5, abs=30.0)
    board.listeners[joint](struct.pack(">fB", 42.5, 1), 5.0, 105.0)
    assert board.angles["shaft"].value == pytest.approx(-math.radians(30.0))


def test_a_reserved_raw_value_is_named_and_is_no_measurement() -> None:
    board = board_of(ELBOW_VENDOR)
    measured = board.identifiers.answers[0]
    hear = board.listeners[measured]
    hear(actual(2.0, 2.0, 7.0, 1), 5.0, 5.0)
    data = struct.pack(">HHHB", 65534, round(2.0 / 0.0005), 14000, 2)
    hear(data + bytes([reference_crc8(b"\x5b" + data)]), 5.01, 5.01)
    assert board.pressures["port_a"].time == 5.0 and board.pressures["port_b"].time == 5.01
    texts = [str(found) for found in board.conditions(5.01, 0.5, 0.05, False)]
    assert "board manifold: fault: pressure port_a: sensor_short" in texts
    hear(actual(2.0, 2.0, 7.0, 3), 5.02, 5.02)
    assert not any(
        found.kind == "board_fault" for found in board.conditions(5.02, 0.5, 0.05, False)
    )


@pytest.mark.parametrize(
    ("data", "error", "text"),
    [
        (actual(2.0, 2.0, 7.0, 1)[:7], FrameLengthError, "has 7 bytes, expected 8"),
        (
            actual(2.0, 2.0, 7.0, 1)[:7] + b"\0",
            FrameCrcError,
            "PVM_Actual of board manifold fails its checksum",
        ),
    ],
)
def test_a_wrong_frame_changes_nothing_and_is_named(
    data: bytes, error: type[Exception], text: str
) -> None:
    board = board_of(ELBOW_VENDOR)
    with pytest.raises(error, match=text):
        board.listeners[board.identifiers.answers[0]](data, 5.0, 5.0)
    assert board.pressures["port_b"].time == -math.inf


def test_a_frame_of_can_fd_has_one_of_its_lengths() -> None:
    text = (
        'VERSION ""\nBS_:\nBU_: A\nBO_ 291 M: 10 A\n SG_ S : 0|8@1+ (1,0) [0|0] "" A\n'
        'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","StandardCAN_FD";\n'
        'BA_DEF_DEF_ "VFrameFormat" "StandardCAN";\nBA_ "VFrameFormat" BO_ 291 3;\n'
    )
    (message,) = cantools.database.load_string(text, "dbc").messages
    assert message.is_fd
    assert frame_length(message) == 12


def test_a_reading_out_of_the_files_range_is_the_condition_of_one_signal() -> None:
    board = board_of(ELBOW_VENDOR)
    hear = board.listeners[board.identifiers.answers[0]]

    def ranges(now: float) -> list[str]:
        found = list(board.conditions(now, 0.5, 0.05, False))
        assert not any("no PVM_Actual" in one.text for one in found)
        return [one.text for one in found if one.kind == "sensor_range"]

    hear(actual(2.0, 2.0, 7.0, 0), 5.0, 5.0)
    hear(actual(16.5, 2.0, 7.0, 1), 5.01, 5.01)
    assert board.pressures["port_a"].time == 5.0
    assert board.pressures["port_b"].time == 5.01
    assert board.counts()["out_of_range"] == 1
    assert not ranges(5.02)
    for count in range(2, 12):
        hear(actual(16.5, 2.0, 7.0, count), 5.0 + 0.01 * count, 5.0)
    assert board.pressures["port_b"].time == pytest.approx(5.11)
    assert ranges(5.12) == [
        "pressure port_a: PVM_Actual.P_Act_A is 16.5, outside the range 0.5 to 16 of the DBC file"
    ]
    hear(actual(2.0, 2.0, 7.0, 12), 5.13, 5.13)
    assert board.pressures["port_a"].time == 5.13
    assert not ranges(5.2)
