"""A CAN bus that loses, delays, repeats, reorders and corrupts frames, in either direction.

It is placed between a bus and its user: `pass_on` takes one frame and returns the frames that
arrive instead, `due` returns the frames whose delay has ended. The caller provides the time.
"""

from __future__ import annotations

import heapq
import random
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

from pam_driver.can_bus.bus import CanPort, ReceivedFrame, SendOutcome

Direction = Literal["up", "down"]
Frame = tuple[int, bytes]
KINDS: Final = (
    "lost", "late", "jitter", "gaps", "repeated", "replayed", "reordered", "corrupted",
    "wrong_length", "foreign",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class FrameFault:
    """A fault of frames for a limited time."""

    kind: str  # one of KINDS
    direction: Direction  # "up" from the boards, "down" to them
    # share of the frames that are affected, 0 to 1; for foreign frames, their number per frame
    share: float
    # delay of late frames, longest delay with jitter, length of a gap, delay of frames that others
    # overtake, and how old a frame is when it is replayed [s]
    delay: float
    until: float  # when the fault ends [s]
    period: float = 1.0  # time from the beginning of one gap to that of the next [s]
    only: frozenset[int] = frozenset()  # the identifiers whose frames are affected; empty for all

    def hits(self, frame_id: int, direction: Direction) -> bool:
        """Whether it may affect a frame."""
        return direction == self.direction and (not self.only or frame_id in self.only)


class FrameFaults:
    """The faults of one bus.

    Parameters
    ----------
    seed : int
        Seed of the random choice of the affected frames.

    Attributes
    ----------
    faults : list of FrameFault
        The present faults; a fault may be appended at any time.
    hit : int
        Number of affected frames.
    """

    def __init__(self, seed: int = 0) -> None:
        self.faults: list[FrameFault] = []
        self.hit = 0
        self._random = random.Random(seed)
        self._held: dict[tuple[str, Direction], list[tuple[float, int, Frame]]] = {}
        self._order = 0
        self._latest: dict[Direction, float] = {"up": 0.0, "down": 0.0}

    def pass_on(self, frame: Frame, direction: Direction, now: float, bus: str = "") -> list[Frame]:
        """The frames that arrive now on a bus instead of a frame."""
        if not self.faults:
            return [frame]
        self.faults = [fault for fault in self.faults if now < fault.until]
        frames = [frame]
        for fault in self.faults:
            if fault.hits(frame[0], direction) and self._random.random() < fault.share:
                self.hit += 1
                frames = [out for one in frames for out in self._spoil(one, fault, now, bus)]
        return frames

    def due(self, direction: Direction, now: float, bus: str = "") -> list[Frame]:
        """The delayed frames that arrive now on a bus."""
        held, frames = self._held.get((bus, direction), []), []
        while held and held[0][0] <= now:
            frames.append(heapq.heappop(held)[2])
        return frames

    def _spoil(self, frame: Frame, fault: FrameFault, now: float, bus: str) -> list[Frame]:
        identifier, data = frame
        draw = self._random
        gap = fault.kind == "gaps" and (fault.until - now) % fault.period < fault.delay
        if fault.kind == "lost" or gap:
            return []
        if fault.kind in {"late", "reordered", "jitter", "replayed"}:
            arrives = now + fault.delay
            if fault.kind == "jitter":  # frames of a bus do not overtake each other
                arrives = max(now + draw.random() * fault.delay, self._latest[fault.direction])
                self._latest[fault.direction] = arrives
            self._order += 1
            entry = (arrives, self._order, frame)
            heapq.heappush(self._held.setdefault((bus, fault.direction), []), entry)
            return [frame] if fault.kind == "replayed" else []
        if fault.kind in {"repeated", "gaps"}:
            return [frame] * (2 if fault.kind == "repeated" else 1)
        if fault.kind == "corrupted":
            word = int.from_bytes(data, "little")
            for _ in range(draw.randint(1, 4)):
                word ^= 1 << draw.randrange(8 * len(data))
            return [(identifier, word.to_bytes(len(data), "little"))]
        if fault.kind == "wrong_length":
            length = draw.choice([n for n in range(9) if n != len(data)])
            return [(identifier, (data + bytes(8))[:length])]
        return [frame, (draw.randrange(0x800), draw.randbytes(draw.randint(0, 8)))]


class FaultyPort:
    """The rig's connection to a bus with faults; `RigLoop` uses it in place of a CanPort."""

    def __init__(self, port: CanPort, faults: FrameFaults, bus: str = "") -> None:
        self._bus = bus
        self._port = port
        self._faults = faults
        self.counts = port.counts

    def receive_all(self, now: float) -> Sequence[ReceivedFrame]:
        """The frames that have arrived, with faults."""
        frames = []
        for frame in self._port.receive_all(now):
            for identifier, data in self._faults.pass_on(frame[:2], "down", now, self._bus):
                frames.append(ReceivedFrame(identifier, data, frame.stamp))
        frames += [
            ReceivedFrame(*frame, time.time()) for frame in self._faults.due("down", now, self._bus)
        ]
        return frames

    def send(self, frame_id: int, data: bytes, now: float) -> SendOutcome:
        """Send a frame, with faults."""
        for frame in self._faults.due("up", now, self._bus):
            self._port.send(*frame, now)
        for frame in self._faults.pass_on((frame_id, data), "up", now, self._bus):
            self._port.send(*frame, now)
        return SendOutcome.SENT

    def close(self) -> None:
        """Close the bus."""
        self._port.close()
