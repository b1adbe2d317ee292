"""The bus between the conformance test and a board: in real time, or any other clock in tests."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Final, NamedTuple, Protocol

from pam_driver.can_bus.bus import CanPort, SendOutcome

_POLL: Final = 0.0005  # s


class HeardFrame(NamedTuple):
    """A frame from the bus, with the time of its arrival on the line's clock [s]."""

    time: float
    frame_id: int
    data: bytes


class Line(Protocol):
    """A bus with a clock."""

    def now(self) -> float:
        """The present time on the clock of the frames [s]."""

    def send(self, frame_id: int, data: bytes) -> bool:
        """Send a frame at once; whether the bus accepted it."""

    def receive(self, until: float) -> Sequence[HeardFrame]:
        """Wait until a time on the clock [s]; return the frames that have arrived."""


class BusLine:
    """A real bus.

    The clock is the wall clock, because python-can stamps frames with it. A delay of this process
    between the arrival of a frame and its reading therefore does not change a measured time.
    """

    def __init__(self, port: CanPort) -> None:
        self._port = port

    def now(self) -> float:
        """The wall clock [s]."""
        return time.time()

    def send(self, frame_id: int, data: bytes) -> bool:
        """Send a frame; False if the transmit queue is full or the bus is down."""
        return self._port.send(frame_id, data, time.monotonic()) is SendOutcome.SENT

    def receive(self, until: float) -> list[HeardFrame]:
        """Wait until a time [s] and return the frames that have arrived."""
        heard: list[HeardFrame] = []
        while True:
            frames = self._port.receive_all(time.monotonic())
            heard += [HeardFrame(frame.stamp, frame.frame_id, frame.data) for frame in frames]
            left = until - time.time()
            if left <= 0.0:
                return heard
            time.sleep(min(left, _POLL))
