"""Sends and reads the frames of a multicast bus without python-can's message objects.

python-can waits with select before every frame, and makes and checks an object for it, which
together takes three times as long as reading the frame. What is not an ordinary data frame is
still handed to python-can, so that its checks decide. The packets are those of python-can.

A multicast socket also receives the packets that it sends. They are recognised before they are
unpacked.
"""

from __future__ import annotations

import contextlib
import os
import socket
import struct
import sys
from typing import Any, Final, NamedTuple

import can
from can.interfaces.udp_multicast import UdpMulticastBus

from pam_driver.can_bus.identifiers import EXTENDED, number_of

_LARGEST: Final = 4096  # bytes; a frame of python-can has about 200
_STAMP: Final = struct.Struct("@ll")  # struct timespec
_ANCILLARY: Final = socket.CMSG_SPACE(_STAMP.size) if hasattr(socket, "CMSG_SPACE") else 0
_KEYS: Final = 11  # of an ordinary frame
_MOST_ON_THE_WAY: Final = 1024  # own packets; more have been lost


class ReceivedFrame(NamedTuple):
    """A data frame; `stamp` is wall-clock time [s].

    The identifier has 11 bits, or 29 bits and the flag `EXTENDED`; that of a CAN FD frame has the
    flag `FD`.
    """

    frame_id: int
    data: bytes
    stamp: float


class MulticastSocket:
    """The socket of an open bus; `close` leaves the bus open.

    Parameters
    ----------
    bus : UdpMulticastBus
        The bus; its socket must give stamps in nanoseconds, as on Linux.
    """

    def __init__(self, bus: UdpMulticastBus) -> None:
        # python-can needs it for this interface alone
        from msgpack import packb, unpackb  # type: ignore[import-untyped]  # noqa: PLC0415

        self._pack, self._unpack = packb, unpackb
        self._socket = socket.socket(fileno=os.dup(bus.fileno()))
        self._destination = bus._multicast._send_destination
        self._own: dict[bytes, int] = {}

    def send(self, frame_id: int, data: bytes) -> None:
        """Send a classic data frame; never waits.

        Raises
        ------
        OSError
            If it cannot be sent now.
        """
        packet = self._pack(
            {
                "timestamp": 0.0,
                "arbitration_id": number_of(frame_id),
                "is_extended_id": frame_id >= EXTENDED,
                "is_remote_frame": False,
                "is_error_frame": False,
                "channel": None,
                "dlc": len(data),
                "data": data,
                "is_fd": False,
                "bitrate_switch": False,
                "error_state_indicator": False,
            }
        )
        self._socket.sendto(packet, socket.MSG_DONTWAIT, self._destination)
        own = self._own
        if len(own) > _MOST_ON_THE_WAY:
            own.clear()
        own[packet] = own.get(packet, 0) + 1

    def read(self) -> ReceivedFrame | can.Message | None:
        """The next frame of another that has arrived; None if there is none.

        Raises
        ------
        can.CanOperationError
            If the packet is no frame.
        OSError
            If the socket cannot be read.
        """
        while True:
            try:
                packet, ancillary, _, _ = self._socket.recvmsg(
                    _LARGEST, _ANCILLARY, socket.MSG_DONTWAIT
                )
            except BlockingIOError:
                return None
            if not self._is_own(packet):
                break
        if not ancillary:
            raise can.CanOperationError("a packet without the time of its arrival")
        seconds, nanoseconds = _STAMP.unpack(ancillary[0][2])
        stamp = seconds + 1e-9 * nanoseconds
        try:
            fields = self._unpack(packet)
            return _ordinary(fields, stamp) or can.Message(
                check=True, **{**fields, "timestamp": stamp}
            )
        except Exception as error:  # msgpack and python-can raise many kinds
            raise can.CanOperationError("could not unpack received message") from error

    def _is_own(self, packet: bytes) -> bool:
        """Whether this socket has sent the packet; each one counts once."""
        count = self._own.get(packet)
        if count is None:
            return False
        if count > 1:
            self._own[packet] = count - 1
        else:
            del self._own[packet]
        return True

    def close(self) -> None:
        """Close this socket."""
        with contextlib.suppress(OSError):
            self._socket.close()


def multicast_socket(bus: can.BusABC) -> MulticastSocket | None:
    """The socket, if the bus is of this kind and the system has what is needed."""
    # a subclass may have its own ways to send and read
    if type(bus) is not UdpMulticastBus or not sys.platform.startswith("linux"):
        return None
    if not getattr(bus._multicast, "timestamp_nanosecond", False):
        return None
    return MulticastSocket(bus)


def _ordinary(fields: dict[str, Any], stamp: float) -> ReceivedFrame | None:
    """The frame, if it is a data frame in which nothing is unusual."""
    data, number = fields["data"], fields["arbitration_id"]
    extended, is_fd = fields["is_extended_id"], fields["is_fd"]
    if (
        len(fields) != _KEYS
        or type(data) is not bytes
        or type(number) is not int
        or fields["is_error_frame"] is not False
        or fields["is_remote_frame"] is not False
        or is_fd is not False
        or type(extended) is not bool
        or len(data) > 8
        or fields["dlc"] != len(data)
        or not 0 <= number < (0x2000_0000 if extended else 0x800)
    ):
        return None
    return ReceivedFrame(number | EXTENDED if extended else number, data, stamp)
