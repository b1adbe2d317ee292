"""The driver's end of a CAN bus in one process, with a CAN controller that can fail."""

from __future__ import annotations

import errno
from collections import deque

import can

from pam_driver.can_bus.identifiers import EXTENDED, FD, number_of

BUS_OFF, RESTARTED, CONTROLLER = 0x40, 0x100, 0x04  # linux/can/error.h


class VirtualCan(can.BusABC):
    """The driver's end of a CAN bus as python-can shows it, with a controller that can fail.

    Attributes
    ----------
    to_boards : deque
        Frames that the driver has sent.
    down, bus_off, full : bool
        The interface is down; the CAN controller is bus-off; the transmit queue is full.
    """

    def __init__(self) -> None:
        self.to_boards: deque[tuple[int, bytes]] = deque()
        self.down = self.bus_off = self.full = False
        self._waiting: deque[can.Message] = deque()

    def deliver(self, frame: tuple[int, bytes], wall: float) -> None:
        """Queue a frame for the driver."""
        if not (self.down or self.bus_off):
            frame_id, data = frame
            message = can.Message(
                wall,
                number_of(frame_id),
                bool(frame_id & EXTENDED),
                is_fd=bool(frame_id & FD),
                data=data,
            )
            self._waiting.append(message)

    def error(self, kind: int, detail: int = 0, wall: float = 0.0) -> None:
        """Queue an error frame of the CAN controller."""
        data = bytes((0, detail, 0, 0, 0, 0, 0, 0))
        self._waiting.append(can.Message(wall, kind, is_error_frame=True, data=data))

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Return the next queued frame."""
        if self.down:
            raise can.CanOperationError("network is down", errno.ENETDOWN)
        return self._waiting.popleft() if self._waiting else None

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Put a frame on the bus."""
        if self.down:
            raise can.CanOperationError("network is down", errno.ENETDOWN)
        if (
            self.full or self.bus_off
        ):  # a CAN controller that is bus-off sends no frame of its queue
            raise can.CanOperationError("no buffer space available", errno.ENOBUFS)
        flags = (EXTENDED if msg.is_extended_id else 0) | (FD if msg.is_fd else 0)
        self.to_boards.append((msg.arbitration_id | flags, bytes(msg.data)))

    def shutdown(self) -> None:
        """There is nothing to close."""
