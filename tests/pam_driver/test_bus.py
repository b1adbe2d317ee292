"""One suite for every kind of bus, and what only SocketCAN can do."""

from __future__ import annotations

import errno
import os
import socket
import subprocess
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import can
import msgpack
import pytest
from can.interfaces.udp_multicast import UdpMulticastBus

from pam_demo.chain import free_udp_port
from pam_driver.can_bus import bus as bus_module
from pam_driver.can_bus import bus_opening
from pam_driver.can_bus.bus import BusState, CanPort, ReceivedFrame, SendOutcome, open_bus
from pam_driver.can_bus.bus_opening import BusError
from pam_driver.can_bus.identifiers import EXTENDED, number_of
from pam_driver.can_bus.multicast_socket import multicast_socket
from support.reruns import EMULATED

VCAN = os.environ.get("PAM_TEST_CAN_CHANNEL", "vcan0")
NEEDS_VCAN = pytest.mark.skipif(
    not Path("/sys/class/net", VCAN).exists(), reason=f"no interface {VCAN} on this kernel"
)
Maker = Callable[[], CanPort]


def until(ports: CanPort, count: int, timeout: float = 5.0) -> list[ReceivedFrame]:
    """Frames as they come, until there are `count`."""
    frames: list[ReceivedFrame] = []
    deadline = time.monotonic() + timeout
    while len(frames) < count and time.monotonic() < deadline:
        frames += ports.receive_all(time.monotonic())
        time.sleep(0.001)
    return frames


@pytest.fixture(
    params=[
        "virtual",
        pytest.param("udp_multicast", marks=pytest.mark.system),
        pytest.param(
            "socketcan",
            marks=[pytest.mark.vcan, NEEDS_VCAN, pytest.mark.rerun_because(EMULATED)],
        ),
    ]
)
def make_port(request: pytest.FixtureRequest) -> Iterator[Maker]:
    """Opens another end of one bus of each kind."""
    options: dict[str, Any] = {
        "virtual": {"channel": uuid.uuid4().hex},
        "udp_multicast": {"channel": "239.74.163.9", "port": free_udp_port()},
        "socketcan": {"channel": VCAN},
    }[request.param]
    opened = []

    def make() -> CanPort:
        opened.append(open_bus(request.param, **options))
        return opened[-1]

    yield make
    for port in opened:
        port.close()


def test_frames_arrive_complete_in_order_and_stamped(make_port: Maker) -> None:
    sender, receiver = make_port(), make_port()
    sent = [(0x100 + index % 5, bytes(range(index % 9))) for index in range(100)]
    before = time.time()
    for frame_id, data in sent:
        assert sender.send(frame_id, data, 0.0) is SendOutcome.SENT
    heard = until(receiver, 100)
    assert [(frame.frame_id, frame.data) for frame in heard] == sent
    assert all(before - 0.01 <= frame.stamp <= time.time() + 0.01 for frame in heard)
    assert receiver.state is BusState.ERROR_ACTIVE
    assert not receiver.counts and not sender.counts
    assert receiver.bits == sender.bits > 0


def test_an_empty_bus_is_not_waited_for(make_port: Maker) -> None:
    port = make_port()
    assert port.receive_all(0.0) == []


def test_own_frames_are_not_heard(make_port: Maker) -> None:
    sender, receiver = make_port(), make_port()
    sender.send(0x101, b"\1", 0.0)
    assert len(until(receiver, 1)) == 1
    assert sender.receive_all(0.0) == []


def test_the_same_frame_of_another_is_heard(make_port: Maker) -> None:
    """A second driver on the bus must not be taken for an echo."""
    one, other = make_port(), make_port()
    one.send(0x101, b"\1", 0.0)
    assert until(other, 1)
    one.receive_all(0.0)
    other.send(0x101, b"\1", 0.0)
    assert len(until(one, 1)) == 1


def test_a_flood_is_taken_in_portions(make_port: Maker, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bus_module, "MAX_FRAMES_PER_CALL", 50)
    sender, receiver = make_port(), make_port()
    for index in range(80):
        sender.send(0x180, bytes([index]), 0.0)
    heard = until(receiver, 50)
    assert len(heard) == 50
    heard += until(receiver, 30)
    assert [frame.data[0] for frame in heard] == list(range(80))


def test_identifiers_of_29_bits_are_sent_and_handed_on_where_a_board_has_them(
    make_port: Maker,
) -> None:
    sender, receiver = make_port(), make_port()
    wanted, other = 0x18FE0031 | EXTENDED, 0x18FE0032 | EXTENDED
    receiver._extended = frozenset({wanted})
    for frame_id in (other, 0x31, wanted):
        sender.send(frame_id, b"\1\2", 0.0)
    heard = [(frame.frame_id, frame.data) for frame in until(receiver, 2)]
    assert heard == [(0x31, b"\1\2"), (wanted, b"\1\2")]
    assert receiver.counts == {"extended_id": 1}
    assert receiver.last_offender["extended_id"] == "0x18FE0032"
    assert sender.receive_all(0.0) == []


def test_foreign_kinds_of_frame_are_counted_and_passed_over(make_port: Maker) -> None:
    sender, receiver = make_port(), make_port()
    raw = sender._bus
    assert raw is not None
    raw.send(can.Message(arbitration_id=0x12345, is_extended_id=True, data=b"\1"))
    raw.send(can.Message(arbitration_id=0x100, is_extended_id=False, is_remote_frame=True))
    sender.send(0x102, b"\2", 0.0)
    assert [frame.frame_id for frame in until(receiver, 1)] == [0x102]
    assert receiver.counts == {"extended_id": 1, "remote_or_fd": 1}
    assert receiver.last_offender["extended_id"] == "0x12345"


def error_frame(kind: int, detail: int = 0) -> can.Message:
    data = bytes([0, detail, 0, 0, 0, 0, 0, 0])
    return can.Message(arbitration_id=kind, is_extended_id=False, is_error_frame=True, data=data)


@pytest.mark.parametrize(
    ("kind", "detail", "state", "count"),
    [
        (0x040, 0, BusState.BUS_OFF, "bus_off"),
        (0x004, 0x10, BusState.ERROR_PASSIVE, "error_passive"),
        (0x004, 0x20, BusState.ERROR_PASSIVE, "error_passive"),
        (0x004, 0x08, BusState.ERROR_WARNING, "error_frames"),
        (0x004, 0x01, BusState.ERROR_ACTIVE, "controller_overflow"),
        (0x020, 0, BusState.ERROR_ACTIVE, "no_acknowledge"),
        (0x001, 0, BusState.ERROR_ACTIVE, "transmit_timeout"),
    ],
)
def test_error_frames_tell_the_state(
    make_port: Maker, kind: int, detail: int, state: BusState, count: str
) -> None:
    sender, receiver = make_port(), make_port()
    assert sender._bus is not None
    sender._bus.send(error_frame(kind, detail))
    deadline = time.monotonic() + 5.0
    while not receiver.counts and time.monotonic() < deadline:
        assert receiver.receive_all(0.0) == []
    assert receiver.state is state
    assert receiver.counts[count] == 1


@pytest.mark.parametrize("back", [error_frame(0x100), error_frame(0x004, 0x40), None])
def test_bus_off_ends(make_port: Maker, back: can.Message | None) -> None:
    """By the restart the kernel reports, or simply because frames come again."""
    sender, receiver = make_port(), make_port()
    assert sender._bus is not None
    sender._bus.send(error_frame(0x040))
    sender._bus.send(back or can.Message(arbitration_id=0x180, is_extended_id=False, data=b"\1"))
    deadline = time.monotonic() + 5.0
    while time.monotonic() < deadline:
        receiver.receive_all(0.0)
        if receiver.counts["error_frames"] == 2 or receiver.bits:
            break
    assert receiver.counts["bus_off"] == 1
    receiver.receive_all(0.0)
    assert receiver.state is BusState.ERROR_ACTIVE


def test_a_bus_that_was_off_in_passing_is_judged_as_off() -> None:
    bus = FailingBus()
    arrived = [error_frame(0x040), error_frame(0x100)]
    bus.recv = lambda timeout=None: arrived.pop(0) if arrived else None  # type: ignore[method-assign]
    port = CanPort({"interface": "virtual", "channel": "x"}, bus)  # type: ignore[arg-type]
    port.receive_all(0.0)
    assert port.state is BusState.BUS_OFF, "off and on again between two cycles"
    port.receive_all(0.0)
    assert port.state is BusState.ERROR_ACTIVE


def test_a_closed_port_takes_and_gives_nothing(make_port: Maker) -> None:
    port = make_port()
    port.close()
    port.close()
    assert port.receive_all(0.0) == []
    assert port.send(0x100, b"", 0.0) is SendOutcome.BUS_DOWN


class FailingBus:
    """A python-can bus whose sending and receiving fail as told."""

    def __init__(self) -> None:
        self.send_error: Exception | None = None
        self.recv_error: Exception | None = None

    def send(self, message: can.Message, timeout: float | None = None) -> None:
        assert timeout == 0.0
        if self.send_error is not None:
            raise self.send_error

    def recv(self, timeout: float | None = None) -> can.Message | None:
        assert timeout == 0.0
        if self.recv_error is not None:
            error, self.recv_error = self.recv_error, None
            raise error
        return None

    def shutdown(self) -> None:
        pass


@pytest.fixture
def failing(monkeypatch: pytest.MonkeyPatch) -> tuple[CanPort, FailingBus]:
    bus = FailingBus()
    monkeypatch.setattr(can, "Bus", lambda **_: bus)
    return open_bus("pcan", "PCAN_USBBUS1"), bus


@pytest.mark.parametrize(
    "error",
    [
        can.CanOperationError("Failed to transmit", errno.ENOBUFS),
        can.CanOperationError("Transmit buffer full"),
        can.CanTimeoutError("timeout"),
        OSError(errno.EAGAIN, "again"),
    ],
)
def test_a_full_queue_drops_and_counts(
    failing: tuple[CanPort, FailingBus], error: Exception
) -> None:
    port, bus = failing
    bus.send_error = error
    assert port.send(0x101, b"\1", 0.0) is SendOutcome.QUEUE_FULL
    assert port.counts == {"send_queue_full": 1}
    assert port.last_offender["send_queue_full"] == "0x101"
    assert port.state is BusState.ERROR_ACTIVE
    bus.send_error = None
    assert port.send(0x101, b"\1", 0.0) is SendOutcome.SENT


def test_a_bus_that_is_down_is_used_again_when_up(failing: tuple[CanPort, FailingBus]) -> None:
    port, bus = failing
    bus.send_error = can.CanOperationError("Failed to transmit", errno.ENETDOWN)
    bus.recv_error = can.CanOperationError("Error receiving", errno.ENETDOWN)
    assert port.receive_all(0.0) == []
    for _ in range(3):
        assert port.send(0x101, b"", 0.0) is SendOutcome.BUS_DOWN
    assert port.state is BusState.DOWN
    assert port.counts == {"bus_down": 1, "send_bus_down": 3}
    bus.send_error = None
    assert port.send(0x101, b"", 0.0) is SendOutcome.SENT
    assert port.state is BusState.ERROR_ACTIVE


def test_an_adapter_that_was_unplugged_is_opened_anew(
    failing: tuple[CanPort, FailingBus], monkeypatch: pytest.MonkeyPatch
) -> None:
    port, bus = failing
    bus.send_error = can.CanOperationError("Failed to transmit", errno.ENODEV)
    assert port.send(0x101, b"", 10.0) is SendOutcome.BUS_DOWN

    def absent(**_: Any) -> can.BusABC:
        raise OSError(errno.ENODEV, "No such device")

    monkeypatch.setattr(can, "Bus", absent)
    assert port.receive_all(12.0) == []
    assert port.state is BusState.DOWN
    assert "No such device" in port.last_offender["bus_down"]
    monkeypatch.setattr(can, "Bus", lambda **_: FailingBus())
    assert port.receive_all(12.5) == []
    assert port.send(0x101, b"", 12.5) is SendOutcome.BUS_DOWN
    assert port.receive_all(13.5) == []
    assert port.send(0x101, b"", 13.5) is SendOutcome.SENT
    assert port.state is BusState.ERROR_ACTIVE
    assert port.counts["reopened"] == 1


PLAIN = {
    "timestamp": 0.0,
    "arbitration_id": 0x101,
    "is_extended_id": False,
    "is_remote_frame": False,
    "is_error_frame": False,
    "channel": None,
    "dlc": 2,
    "data": b"\1\2",
    "is_fd": False,
    "bitrate_switch": False,
    "error_state_indicator": False,
}
UNUSUAL = [
    {},
    {"arbitration_id": 0x800},
    {"arbitration_id": 0x800, "is_extended_id": True},
    {"arbitration_id": -1},
    {"arbitration_id": "1"},
    {"arbitration_id": 2**29, "is_extended_id": True},
    {"dlc": 1},
    {"dlc": 9, "data": bytes(9)},
    {"data": "text"},
    {"data": None},
    {"is_fd": True, "dlc": 12, "data": bytes(12)},
    {"is_remote_frame": True, "dlc": 0, "data": None},
    {"is_error_frame": 1},
    {"unknown": 1},
    {"timestamp": "never"},
]


def meaning(frame: ReceivedFrame | can.Message | None) -> object:
    """What a frame says, whoever has read it."""
    if isinstance(frame, ReceivedFrame):
        return frame.frame_id, frame.data, False, False, False
    if frame is None:
        return None
    number = frame.arbitration_id | (EXTENDED if frame.is_extended_id else 0)
    kind = bool(frame.is_error_frame), frame.is_remote_frame, frame.is_fd
    return number, bytes(frame.data), *kind


@pytest.mark.system
@pytest.mark.parametrize("change", UNUSUAL, ids=str)
def test_every_packet_means_what_it_means_to_python_can(change: dict[str, object]) -> None:
    """The reader of multicast frames is faster, and neither kinder nor stricter."""
    number = free_udp_port()
    bus = can.Bus(interface="udp_multicast", channel="239.74.163.9", port=number, hop_limit=0)
    reader = multicast_socket(bus)
    if reader is None:
        pytest.skip("this system has no stamps in nanoseconds")
    packet = msgpack.packb({**PLAIN, **change}, use_bin_type=True)
    assert isinstance(bus, UdpMulticastBus)
    found = []
    for read in (reader.read, lambda: bus.recv(0.0)):
        bus._multicast._socket.sendto(packet, ("239.74.163.9", number))
        deadline = time.monotonic() + 5.0
        meant: object = None
        while meant is None and time.monotonic() < deadline:
            try:
                meant = meaning(read())
            except can.CanOperationError:
                meant = "refused"
        found.append(meant)
    assert found[0] == found[1] is not None
    reader.close()
    bus.shutdown()


@pytest.mark.system
@pytest.mark.parametrize("frame_id", [0x101, 0x12345 | EXTENDED])
def test_what_is_sent_is_a_frame_of_python_can(frame_id: int) -> None:
    number = free_udp_port()
    bus = can.Bus(interface="udp_multicast", channel="239.74.163.9", port=number, hop_limit=0)
    port = open_bus("udp_multicast", "239.74.163.9", port=number)
    assert port.send(frame_id, b"\1\2\3", 0.0) is SendOutcome.SENT
    heard = bus.recv(5.0)
    assert heard is not None
    sent = can.Message(
        arbitration_id=number_of(frame_id), is_extended_id=frame_id >= EXTENDED, data=b"\1\2\3"
    )
    assert heard.equals(sent, timestamp_delta=None)
    bus.shutdown()
    port.close()


@pytest.mark.system
def test_a_packet_that_is_no_frame_is_counted() -> None:
    number = free_udp_port()
    port = open_bus("udp_multicast", "239.74.163.9", port=number)
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
    sender.sendto(b"\xc1no frame", ("239.74.163.9", number))
    deadline = time.monotonic() + 5.0
    while not port.counts and time.monotonic() < deadline:
        port.receive_all(0.0)
    assert port.counts == {"malformed": 1}
    assert port.state is BusState.ERROR_ACTIVE
    sender.close()
    port.close()


def test_multicast_never_leaves_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    given: dict[str, Any] = {}
    monkeypatch.setattr(can, "Bus", lambda **options: given.update(options))
    monkeypatch.setattr(bus_opening, "hear_own_group_only", lambda bus: None)
    open_bus("udp_multicast", "239.74.163.9", hop_limit=8)
    assert given["hop_limit"] == 0


@pytest.mark.system
@pytest.mark.parametrize(
    "groups", [("239.74.163.7", "239.74.163.8"), ("ff15::7a63:7", "ff15::7a63:8")]
)
def test_two_multicast_groups_on_one_port_do_not_hear_each_other(groups: tuple[str, str]) -> None:
    number = free_udp_port()
    try:
        ours, theirs = (open_bus("udp_multicast", group, port=number) for group in groups)
    except BusError as error:
        if ":" in groups[0]:
            pytest.skip(f"no IPv6 multicast on this machine: {error}")
        raise
    listener = open_bus("udp_multicast", groups[0], port=number)
    for index in range(20):
        assert theirs.send(0x100, bytes([index]), 0.0) is SendOutcome.SENT
        assert ours.send(0x101, bytes([index]), 0.0) is SendOutcome.SENT
    heard = until(listener, 20)
    heard += until(listener, 1, timeout=0.2)
    assert [frame.frame_id for frame in heard] == [0x101] * 20
    for port in (ours, theirs, listener):
        port.close()


@pytest.mark.system
def test_what_another_group_sent_while_the_bus_was_opened_is_discarded() -> None:
    number = free_udp_port()
    other = open_bus("udp_multicast", "239.74.163.8", port=number)
    late = can.Bus(interface="udp_multicast", channel="239.74.163.7", port=number, hop_limit=0)
    other.send(0x100, b"early", 0.0)
    assert late.recv(1.0) is not None  # the fault that the next call mends
    other.send(0x100, b"early", 0.0)
    time.sleep(0.05)
    bus_opening.hear_own_group_only(late)
    other.send(0x100, b"late", 0.0)
    assert late.recv(0.2) is None
    late.shutdown()
    other.close()


@pytest.mark.parametrize(
    ("interface", "channel", "expected"),
    [
        ("socketcan", "can93", "socketcan can93: no such interface"),
        ("socketcan", "", "no such interface"),
        ("socketcan", "../lo", "no such interface"),
        ("socketcan", "lo", "is no CAN interface"),
        ("telepathy", "x", "telepathy x cannot be opened"),
        ("udp_multicast", "10.0.0.1", "udp_multicast 10.0.0.1 cannot be opened"),
        ("udp_multicast", "no.such.host.invalid", "cannot be opened"),
    ],
)
def test_an_absent_bus_is_named(interface: str, channel: str, expected: str) -> None:
    with pytest.raises(BusError, match=expected) as caught:
        open_bus(interface, channel)
    assert "\n" not in str(caught.value)


def ip_link(*arguments: str) -> None:
    subprocess.run(["ip", "link", *arguments], check=True, timeout=20)


@pytest.fixture
def own_vcan() -> Iterator[str]:
    """A vcan interface that a test may take down."""
    name = "vcan93"
    ip_link("add", "dev", name, "type", "vcan")
    yield name
    subprocess.run(["ip", "link", "del", name], check=False, timeout=20)


@pytest.mark.vcan
@NEEDS_VCAN
class TestSocketCan:
    def test_an_interface_that_is_down_is_not_opened(self, own_vcan: str) -> None:
        with pytest.raises(BusError, match=f"{own_vcan}: interface is down; try: sudo ip link"):
            open_bus("socketcan", own_vcan)

    def test_down_and_up_again(self, own_vcan: str) -> None:
        ip_link("set", own_vcan, "up")
        port, other = open_bus("socketcan", own_vcan), open_bus("socketcan", own_vcan)
        ip_link("set", own_vcan, "down")
        port.receive_all(0.0)
        assert port.send(0x100, b"\1", 0.0) is SendOutcome.BUS_DOWN
        assert port.state is BusState.DOWN
        ip_link("set", own_vcan, "up")
        other.receive_all(0.0)
        assert port.send(0x100, b"\2", 0.0) is SendOutcome.SENT
        assert port.state is BusState.ERROR_ACTIVE
        assert [frame.data for frame in until(other, 1)] == [b"\2"]
        port.close()
        other.close()

    def test_unplugged_and_plugged_in_again(self, own_vcan: str) -> None:
        ip_link("set", own_vcan, "up")
        port = open_bus("socketcan", own_vcan)
        ip_link("del", own_vcan)
        now = time.monotonic()
        port.receive_all(now)
        assert port.send(0x100, b"\1", now) is SendOutcome.BUS_DOWN
        ip_link("add", "dev", own_vcan, "type", "vcan")
        ip_link("set", own_vcan, "up")
        port.receive_all(now + 1.5)
        assert port.send(0x100, b"\1", now + 1.5) is SendOutcome.SENT
        port.close()

    def test_the_kernel_filters(self) -> None:
        sender = open_bus("socketcan", VCAN)
        receiver = open_bus("socketcan", VCAN, accept=[0x180, 0x280])
        for frame_id in (0x181, 0x180, 0x100, 0x280):
            sender.send(frame_id, b"\1", 0.0)
        assert [frame.frame_id for frame in until(receiver, 2)] == [0x180, 0x280]
        assert receiver.receive_all(0.0) == []
        sender.close()
        receiver.close()
