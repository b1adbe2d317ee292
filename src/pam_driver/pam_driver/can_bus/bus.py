"""A CAN bus that never blocks and never raises an exception once it is open.

python-can accesses the hardware. Exceptions that it raises while running become counts, a state
and a text for the diagnostics: a frame is dropped when the transmit queue is full, a bus that is
down is used again when it is up, and error frames report the state of the CAN controller. Sources:
Linux `linux/can/error.h`, ISO 11898-1.
"""

from __future__ import annotations

import contextlib
import errno
from collections import Counter, deque
from collections.abc import Collection, Sequence
from enum import IntEnum
from typing import Any, Final

import can
from can.interfaces.udp_multicast import UdpMulticastBus

from pam_driver.can_bus.bitrate import DEFAULT_BITRATE
from pam_driver.can_bus.bus_opening import BusError, bus_name, open_can_bus
from pam_driver.can_bus.identifiers import EXTENDED, FD, number_of
from pam_driver.can_bus.multicast_socket import ReceivedFrame, multicast_socket

__all__ = [
    "MAX_FRAMES_PER_CALL",
    "BusState",
    "CanPort",
    "ReceivedFrame",
    "SendOutcome",
    "open_bus",
]

# A flood of frames must not block the caller: the rest is fetched in the next cycle.
MAX_FRAMES_PER_CALL: Final = 256
_REOPEN_PERIOD: Final = 1.0
_GONE: Final = frozenset({errno.ENODEV, errno.ENXIO, errno.EBADF})
_FULL: Final = frozenset({errno.ENOBUFS, errno.EAGAIN, errno.ENOMEM})

# linux/can/error.h: class bits in the identifier, controller bits in data[1]
_ERR_TX_TIMEOUT, _ERR_CONTROLLER, _ERR_NO_ACK = 0x001, 0x004, 0x020
_ERR_BUS_OFF, _ERR_RESTARTED = 0x040, 0x100
_CONTROLLER_OVERFLOW, _CONTROLLER_WARNING, _CONTROLLER_PASSIVE = 0x03, 0x0C, 0x30
_CONTROLLER_ACTIVE = 0x40


class BusState(IntEnum):
    """State of the CAN controller as its error frames report it; `DOWN` if it cannot send."""

    ERROR_ACTIVE = 0
    ERROR_WARNING = 1
    ERROR_PASSIVE = 2
    BUS_OFF = 3
    DOWN = 4


class SendOutcome(IntEnum):
    """The result of sending a frame."""

    SENT = 0
    QUEUE_FULL = 1
    BUS_DOWN = 2


class CanPort:
    """One open bus; made by `open_bus`.

    Attributes
    ----------
    counts : Counter
        How often each kind of event has happened, by name.
    last_offender : dict
        By the same names, the last frame or error that was counted.
    bits : int
        Bits sent and received, without stuff bits; the bus load is computed from them.
    """

    def __init__(
        self,
        options: dict[str, Any],
        bus: can.BusABC,
        extended: Collection[int] | None = (),
        *,
        fd: bool = False,
    ) -> None:
        self.counts: Counter[str] = Counter()
        self.last_offender: dict[str, str] = {}
        self.bits = 0
        self._options = options
        self._bus: can.BusABC | None = bus
        self._extended = None if extended is None else frozenset(extended)
        self._fd = fd
        # a multicast socket also receives the frames that it sends
        self._hears_itself = isinstance(bus, UdpMulticastBus)
        self._socket = multicast_socket(bus)
        self._sent_ids: set[int] = set()
        self._sent: deque[tuple[int, bytes]] = deque(maxlen=1024)
        self._controller = BusState.ERROR_ACTIVE
        self._was_off = False
        self._down = False
        self._gone = False
        self._reopen_at = 0.0

    @property
    def name(self) -> str:
        """Interface and channel as one text."""
        return bus_name(self._options)

    @property
    def state(self) -> BusState:
        """State of the bus, as far as it is known from errors.

        A controller that was bus-off while the last frames arrived counts as bus-off until the
        next are received, although it has recovered.
        """
        if self._down:
            return BusState.DOWN
        return BusState.BUS_OFF if self._was_off else self._controller

    def receive_all(self, now: float) -> list[ReceivedFrame]:
        """All frames that have arrived, oldest first; never waits for one."""
        if self._gone:
            self._reopen(now)
        bus = self._bus
        frames: list[ReceivedFrame] = []
        self._was_off = False
        if bus is None:
            return frames
        for _ in range(MAX_FRAMES_PER_CALL):
            try:
                message = bus.recv(0.0) if self._socket is None else self._socket.read()
            except (can.CanError, OSError, ValueError) as error:
                number = _errno(error)
                if number is None:  # python-can could not decode a packet
                    self._count("malformed", str(error))
                    continue
                self._lost(error, number, now)
                break
            if message is None:
                break
            frame = self._frame_of(message) if isinstance(message, can.Message) else message
            if frame is None:
                continue
            frame_id, data, _ = frame
            if frame_id in self._sent_ids and self._is_echo((frame_id, data)):
                continue
            self.bits += 47 + 8 * len(data)
            known = self._extended
            foreign = frame_id & EXTENDED and known is not None and frame_id not in known
            if foreign or (frame_id & FD and not self._fd):
                kind = "extended_id" if foreign else "remote_or_fd"
                self._count(kind, f"0x{number_of(frame_id):X}")
                continue
            if self._controller is BusState.BUS_OFF:  # a controller that receives is on the bus
                self._controller = BusState.ERROR_ACTIVE
            frames.append(frame)
        else:
            self.counts["receive_backlog"] += 1
        return frames

    def send(self, frame_id: int, data: bytes, now: float) -> SendOutcome:
        """Send a frame, or drop it if it cannot be sent at once."""
        bus = self._bus
        if bus is None or self._gone:
            self.counts["send_bus_down"] += 1
            return SendOutcome.BUS_DOWN
        try:
            if self._socket is not None and not frame_id & FD:
                self._socket.send(frame_id, data)
            else:
                bus.send(_message(frame_id, data), timeout=0.0)
        except (can.CanError, OSError, ValueError) as error:
            number = _errno(error)
            if number is None or number in _FULL:
                self._count("send_queue_full", f"0x{frame_id:X}")
                return SendOutcome.QUEUE_FULL
            self.counts["send_bus_down"] += 1
            self._lost(error, number, now)
            return SendOutcome.BUS_DOWN
        self._down = False
        if self._hears_itself and (self._socket is None or frame_id & FD):
            self._sent_ids.add(frame_id)
            self._sent.append((frame_id, data))
        self.bits += 47 + 8 * len(data)
        return SendOutcome.SENT

    def close(self) -> None:
        """Close the bus; may be called twice."""
        bus, self._bus = self._bus, None
        direct, self._socket = self._socket, None
        if direct is not None:
            direct.close()
        if bus is not None:
            with contextlib.suppress(can.CanError, OSError):
                bus.shutdown()

    def _count(self, kind: str, offender: str) -> None:
        self.counts[kind] += 1
        self.last_offender[kind] = offender

    def _is_echo(self, frame: tuple[int, bytes]) -> bool:
        if frame not in self._sent:
            return False
        self._sent.remove(frame)
        return True

    def _lost(self, error: Exception, number: int, now: float) -> None:
        """Note that the interface is down, or no longer exists."""
        if not self._down:
            self._count("bus_down", str(error))
        self._down = True
        if number in _GONE and not self._gone:
            self._gone = True
            self._reopen_at = now + _REOPEN_PERIOD

    def _reopen(self, now: float) -> None:
        """Open the bus again, since an unplugged adapter returns as a new interface."""
        if now < self._reopen_at:
            return
        self._reopen_at = now + _REOPEN_PERIOD
        try:
            bus = open_can_bus(self._options)
        except BusError as error:
            self.last_offender["bus_down"] = str(error)
            return
        self.close()
        self._bus = bus
        self._socket = multicast_socket(bus)
        self._gone = False
        self._controller = BusState.ERROR_ACTIVE
        self.counts["reopened"] += 1

    def _frame_of(self, message: can.Message) -> ReceivedFrame | None:
        """The data frame in a message of python-can; error and remote frames are counted."""
        if message.is_error_frame:
            self._error_frame(message)
            return None
        if message.is_remote_frame:
            self.bits += 47
            self._count("remote_or_fd", f"0x{message.arbitration_id:X}")
            return None
        return ReceivedFrame(_flagged(message), bytes(message.data), message.timestamp)

    def _error_frame(self, message: can.Message) -> None:
        kind = message.arbitration_id
        detail = message.data[1] if len(message.data) > 1 else 0
        self._count("error_frames", f"class 0x{kind:X}, data {message.data.hex()}")
        if kind & _ERR_NO_ACK:
            self.counts["no_acknowledge"] += 1
        if kind & _ERR_TX_TIMEOUT:
            self.counts["transmit_timeout"] += 1
        if kind & _ERR_RESTARTED:
            self._controller = BusState.ERROR_ACTIVE
        if kind & _ERR_CONTROLLER:
            if detail & _CONTROLLER_OVERFLOW:
                self.counts["controller_overflow"] += 1
            if detail & _CONTROLLER_PASSIVE:
                self._controller = BusState.ERROR_PASSIVE
                self.counts["error_passive"] += 1
            elif detail & _CONTROLLER_WARNING:
                self._controller = BusState.ERROR_WARNING
            elif detail & _CONTROLLER_ACTIVE:
                self._controller = BusState.ERROR_ACTIVE
        if kind & _ERR_BUS_OFF:
            self._controller = BusState.BUS_OFF
            self._was_off = True
            self.counts["bus_off"] += 1


def _message(frame_id: int, data: bytes) -> can.Message:
    """A data frame as a message of python-can."""
    is_fd = frame_id & FD != 0
    return can.Message(
        arbitration_id=number_of(frame_id),
        data=data,
        is_extended_id=frame_id >= EXTENDED,
        is_fd=is_fd,
        bitrate_switch=is_fd,
    )


def _flagged(message: can.Message) -> int:
    """The identifier of a message with the flags of `identifiers`."""
    extended = EXTENDED if message.is_extended_id else 0
    return message.arbitration_id | extended | (FD if message.is_fd else 0)


def open_bus(
    interface: str,
    channel: str,
    *,
    bitrate: int = DEFAULT_BITRATE,
    accept: Sequence[int] = (),
    extended: Collection[int] | None = (),
    fd: bool = False,
    **options: Any,
) -> CanPort:
    """Open a CAN bus with python-can.

    Parameters
    ----------
    interface : str
        "socketcan", "udp_multicast", "virtual" or another interface of python-can.
    channel : str
        "can0", a multicast group or another name, as the interface requires.
    bitrate : int
        [bit/s]; ignored by SocketCAN, whose bitrate is set with `ip link`.
    accept : sequence of int
        Identifiers to receive where the kernel can filter (SocketCAN); all if empty.
    extended : collection of int, or None
        Identifiers of 29 bits, with `EXTENDED`, that `receive_all` returns; others are counted.
        None: all are returned.
    fd : bool, optional
        Send and receive CAN FD frames; else a received one is counted.
    **options
        Further options of that interface, as python-can names them.

    Raises
    ------
    BusError
        If there is no such bus, or it is not up.
    """
    arguments: dict[str, Any] = {**options, "interface": interface, "channel": channel}
    if fd and interface != "virtual":
        arguments["fd"] = True
    if interface == "udp_multicast":
        arguments["hop_limit"] = 0  # never leaves this machine
    elif interface == "socketcan":
        if accept:
            # other interfaces filter in software, and `recv(0)` then stops at a foreign frame
            arguments["can_filters"] = [
                {
                    "can_id": number_of(frame_id),
                    "can_mask": 0x1FFF_FFFF if frame_id & EXTENDED else 0x7FF,
                    "extended": bool(frame_id & EXTENDED),
                }
                for frame_id in accept
            ]
    else:
        arguments["bitrate"] = bitrate
    return CanPort(arguments, open_can_bus(arguments), extended, fd=fd)


def _errno(error: BaseException) -> int | None:
    """The system's error number that caused python-can's error, if there is one."""
    code = getattr(error, "error_code", None)
    if isinstance(code, int):
        return code
    for cause in (error, error.__cause__):
        if isinstance(cause, OSError) and cause.errno is not None:
            return cause.errno
        if isinstance(cause, ValueError) and "descriptor" in str(cause):
            return errno.EBADF
    return None
