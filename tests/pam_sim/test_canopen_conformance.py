"""The points of CiA 301 on which a master relies, on the simulated slave, frame by frame.

docs/canopen_standard.md lists them. The expected bytes are those of the standard, written by hand.
"""

from __future__ import annotations

import struct

import pytest

from pam_driver.boards.canopen.dictionary import Dictionary, ObjectName, profile_path
from pam_sim.boards.canopen_slave import SimulatedSlave

NODE = 5
START, STOP, PRE_OPERATIONAL, RESET, RESET_COMMUNICATION = 1, 2, 128, 129, 130
BOOT_TIME = 0.05


class Bus:
    """One slave, and the frames that it sends."""

    def __init__(self) -> None:
        dictionary = Dictionary(profile_path("cia401_analogue"), NODE).as_canopen()
        self.now = 0.0
        self.slave = SimulatedSlave(NODE, dictionary, {}, BOOT_TIME, self.now)

    def run(self, seconds: float) -> list[tuple[int, bytes]]:
        """What it sends during some time."""
        sent = []
        for _ in range(round(seconds / 0.001)):
            self.now += 0.001
            self.slave.poll(self.now)
            self.slave.tpdos(self.now)
            sent += self.slave.frames()
        return sent

    def send(self, frame_id: int, *data: int) -> list[tuple[int, bytes]]:
        """What it sends at once after a frame."""
        self.slave.on_frame(frame_id, bytes(data), self.now)
        return self.slave.frames()

    def nmt(self, command: int, node: int = NODE) -> None:
        assert self.send(0x000, command, node) == [], "NMT is not acknowledged"

    def asked(self, specifier: int, index: int, sub: int, data: bytes = b"") -> bytes:
        """The answer to an SDO request."""
        request = struct.pack("<BHB4s", specifier, index, sub, data)
        ((frame_id, answer),) = self.send(0x600 + NODE, *request)
        assert frame_id == 0x580 + NODE and len(answer) == 8
        assert answer[1:4] == request[1:4], "the answer names the object"
        return answer

    def write(self, index: int, sub: int, data: bytes) -> None:
        specifier = 0x23 | (4 - len(data)) << 2
        assert self.asked(specifier, index, sub, data) == struct.pack("<BHB4x", 0x60, index, sub)

    def state(self) -> int:
        """What the next heartbeat says."""
        self.write(0x1017, 0, struct.pack("<H", 10))
        ((_, data), *_) = [one for one in self.run(0.03) if one[0] == 0x700 + NODE]
        return data[0]


@pytest.fixture
def bus() -> Bus:
    made = Bus()
    assert made.run(BOOT_TIME + 0.01) == [(0x705, b"\x00")]
    return made


def test_boot_up_is_one_heartbeat_with_0_and_then_the_node_is_silent(bus: Bus) -> None:
    assert bus.run(1.0) == [], "no heartbeat before 0x1017 is written, and no PDO"


def test_before_its_boot_up_a_node_answers_nothing() -> None:
    bus = Bus()
    assert bus.send(0x605, 0x40, 0x00, 0x10, 0x00, 0, 0, 0, 0) == []
    bus.nmt(START)
    bus.run(BOOT_TIME + 0.01)
    assert bus.state() == 127


def test_a_heartbeat_has_one_byte_with_the_state_and_its_period(bus: Bus) -> None:
    bus.write(0x1017, 0, struct.pack("<H", 20))
    beats = bus.run(0.2)
    assert set(beats) == {(0x705, bytes([127]))}
    assert 9 <= len(beats) <= 11
    for command, state in ((START, 5), (STOP, 4), (PRE_OPERATIONAL, 127), (START, 5)):
        bus.nmt(command)
        beats = [data for frame_id, data in bus.run(0.05) if frame_id == 0x705]
        assert set(beats) == {bytes([state])}
    bus.write(0x1017, 0, bytes(2))
    assert [one for one in bus.run(0.2) if one[0] == 0x705] == []


def test_nmt_obeys_the_own_number_and_0_and_no_other(bus: Bus) -> None:
    bus.nmt(START, NODE + 1)
    assert bus.state() == 127
    bus.nmt(START, 0)
    assert bus.state() == 5
    bus.send(0x000, STOP)
    assert bus.state() == 5, "a command of one byte is none"


@pytest.mark.parametrize("command", [RESET, RESET_COMMUNICATION])
def test_a_reset_forgets_what_was_configured_and_ends_with_a_boot_up(
    bus: Bus, command: int
) -> None:
    bus.write(0x1017, 0, struct.pack("<H", 20))
    bus.nmt(START)
    bus.nmt(command)
    assert bus.run(0.3) == [(0x705, b"\x00")]


def measures_at(bus: Bus, transmission: int) -> None:
    """Map the first analogue input to TPDO1, with a period of 5 ms."""
    bus.write(0x1800, 1, struct.pack("<I", 0x8000_0185))
    bus.write(0x1A00, 0, b"\x00")
    bus.write(0x1A00, 1, struct.pack("<I", 0x6401_0110))
    bus.write(0x1A00, 0, b"\x01")
    bus.write(0x1800, 2, bytes([transmission]))
    bus.write(0x1800, 5, struct.pack("<H", 5))
    bus.write(0x1800, 1, struct.pack("<I", 0x185))
    bus.slave.store(ObjectName(0x6401, 1), 0x1234)


def test_a_node_measures_in_operational_alone_and_a_stopped_one_answers_no_sdo(bus: Bus) -> None:
    measures_at(bus, 254)
    assert bus.run(0.1) == []
    bus.nmt(START)
    sent = bus.run(0.1)
    assert 19 <= len(sent) <= 21 and set(sent) == {(0x185, b"\x34\x12")}
    bus.nmt(STOP)
    assert bus.run(0.1) == []
    assert bus.send(0x605, 0x40, 0x00, 0x10, 0x00, 0, 0, 0, 0) == []
    bus.nmt(PRE_OPERATIONAL)
    assert bus.run(0.1) == []
    assert bus.asked(0x40, 0x1000, 0)[4:] == struct.pack("<I", 0x000C_0191)


def test_an_expedited_upload_says_how_many_bytes_count(bus: Bus) -> None:
    assert bus.asked(0x40, 0x1001, 0)[0] == 0x4F
    assert bus.asked(0x40, 0x1017, 0)[0] == 0x4B
    assert bus.asked(0x40, 0x1000, 0)[0] == 0x43


def aborts(bus: Bus) -> dict[str, tuple[int, bytes]]:
    """By case the abort code that the standard demands, and the answer."""
    entries = bus.slave.object_dictionary
    entries[0x6444][1].max, entries[0x6444][1].min = 30_000, -30_000
    entries[0x6443][2].access_type = "wo"
    long = struct.pack("<I", 40_000)
    bus.write(0x1400, 1, struct.pack("<I", 0x8000_0205))  # off
    found = {
        "no such object": (0x0602_0000, bus.asked(0x40, 0x2000, 0)),
        "no such sub-index": (0x0609_0011, bus.asked(0x40, 0x6443, 20)),
        "write to read only": (0x0601_0002, bus.asked(0x23, 0x1018, 1)),
        "read of write only": (0x0601_0001, bus.asked(0x40, 0x6443, 2)),
        "wrong length": (0x0607_0010, bus.asked(0x23, 0x1017, 0)),
        "value too high": (0x0609_0031, bus.asked(0x23, 0x6444, 1, long)),
        "value too low": (
            0x0609_0032,
            bus.asked(0x23, 0x6444, 1, struct.pack("<i", -40_000)),
        ),
        "object cannot be mapped": (
            0x0604_0041,
            bus.asked(0x23, 0x1600, 1, struct.pack("<I", 0x6444_0120)),
        ),
    }
    for sub in range(1, 6):
        bus.write(0x1600, sub, struct.pack("<I", 0x6411_0010 | sub << 8))
    found["PDO longer than 8 bytes"] = (0x0604_0042, bus.asked(0x2F, 0x1600, 0, b"\x05"))
    bus.write(0x1600, 0, b"\x04")
    bus.write(0x1400, 1, struct.pack("<I", 0x205))
    mapping = struct.pack("<I", 0x6411_0110)
    found["mapping of a PDO that is on"] = (0x0800_0022, bus.asked(0x23, 0x1600, 1, mapping))
    return found


def test_each_abort_code_is_the_one_of_the_standard(bus: Bus) -> None:
    found = aborts(bus)
    answers = {name: (answer[0], answer[4:]) for name, (_, answer) in found.items()}
    assert answers == {name: (0x80, struct.pack("<I", code)) for name, (code, _) in found.items()}
    assert len(found) == 10


def test_an_emergency_has_8_bytes_and_is_kept_in_0x1001_and_0x1003(bus: Bus) -> None:
    bus.slave.emergency(0x4210, 0x09, b"\x01")
    assert bus.slave.frames() == [(0x085, bytes.fromhex("1042090100000000"))]
    assert bus.asked(0x40, 0x1001, 0)[4] == 0x09
    assert bus.asked(0x40, 0x1003, 1)[4:6] == b"\x10\x42"


@pytest.mark.parametrize(("behaviour", "state"), [(0, 127), (1, 5), (2, 4)])
def test_a_lost_heartbeat_of_the_host_is_an_emergency_and_0x1029_decides_the_state(
    bus: Bus, behaviour: int, state: int
) -> None:
    bus.write(0x1016, 1, struct.pack("<I", 127 << 16 | 100))
    bus.write(0x1029, 1, bytes([behaviour]))
    bus.write(0x1017, 0, struct.pack("<H", 10))
    bus.nmt(START)
    assert [one for one in bus.run(0.3) if one[0] == 0x085] == [], "it was not heard yet"
    bus.send(0x77F, 5)
    before = [data for frame_id, data in bus.run(0.09) if frame_id == 0x085]
    after = [data for frame_id, data in bus.run(0.02) if frame_id == 0x085]
    assert (before, [data[:3] for data in after]) == ([], [b"\x30\x81\x11"])
    beats = [data for frame_id, data in bus.run(0.05) if frame_id == 0x705]
    assert set(beats) == {bytes([state])}


def test_a_pdo_of_type_1_is_sent_with_each_sync_and_only_then(bus: Bus) -> None:
    measures_at(bus, 1)
    bus.nmt(START)
    assert bus.run(0.1) == []
    for _ in range(3):
        bus.send(0x080)
        assert bus.run(0.005) == [(0x185, b"\x34\x12")]


def test_a_set_point_is_taken_in_operational_alone_and_with_its_length(bus: Bus) -> None:
    """RPDO2 of an I/O module has the first four analogue outputs (CiA 401)."""
    assert bus.slave.on_frame(0x305, b"\x01" * 8, bus.now) == {}
    bus.nmt(START)
    taken = bus.slave.on_frame(0x305, b"\x01" * 8, bus.now)
    assert taken == {ObjectName(0x6411, sub): 0x0101 for sub in range(1, 5)}
    assert bus.send(0x305, 1) == [(0x085, bytes.fromhex("1082110000000000"))]
