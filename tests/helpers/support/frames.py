"""Listening to a CAN bus beside the suite: what really goes over it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Self

import can

from pam_demo.chain import BusChoice
from pam_driver.boards.pam_board.codec import BoardCodec, BoardMessage, FrameError
from pam_driver.can_bus.bus_opening import hear_own_group_only


def open_can(bus: BusChoice) -> can.BusABC:
    """The bus by python-can alone."""
    if bus.interface == "udp_multicast":
        opened = can.Bus(interface=bus.interface, channel=bus.channel, port=bus.port, hop_limit=0)
        hear_own_group_only(opened)
        return opened
    return can.Bus(interface=bus.interface, channel=bus.channel)


class FrameListener:
    """Keeps every frame of a bus, decoded: (time received, board, message)."""

    def __init__(self, bus: BusChoice) -> None:
        self.codec = BoardCodec.from_dbc()
        self._bus = open_can(bus)
        self._entries: list[tuple[float, int, BoardMessage]] = []
        self._news = threading.Condition()
        self._ending = False
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        while not self._ending:
            frame = self._bus.recv(0.1)
            if frame is None:
                continue
            try:
                board, message = self.codec.decode(frame.arbitration_id, bytes(frame.data))
            except FrameError:
                continue
            with self._news:
                self._entries.append((time.monotonic(), board, message))
                self._news.notify_all()

    @property
    def now(self) -> float:
        """The clock of the entries' times [s]."""
        return time.monotonic()

    def heard(
        self, kind: type, since: float = 0.0, board: int | None = None
    ) -> list[tuple[float, BoardMessage]]:
        """Messages of one type received after `since`, of one board or all."""
        with self._news:
            return [
                (stamp, message)
                for stamp, sender, message in self._entries
                if isinstance(message, kind)
                and stamp >= since
                and (board is None or board == sender)
            ]

    def wait_for(
        self,
        what: str,
        condition: Callable[[int, BoardMessage], bool],
        timeout: float,
        since: float = 0.0,
    ) -> tuple[float, BoardMessage]:
        """The first entry after `since` for which `condition(board, message)` holds.

        Raises
        ------
        AssertionError
            Saying `what` did not come within `timeout` seconds.
        """
        deadline = time.monotonic() + timeout
        looked = 0
        with self._news:
            while True:
                for stamp, board, message in self._entries[looked:]:
                    if stamp >= since and condition(board, message):
                        return stamp, message
                looked = len(self._entries)
                left = deadline - time.monotonic()
                if left <= 0.0:
                    raise AssertionError(f"{what}: not on the bus within {timeout:g} s")
                self._news.wait(left)

    def close(self) -> None:
        """Stop listening."""
        self._ending = True
        self._thread.join(2.0)
        self._bus.shutdown()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
