"""A simulated rig on a CAN bus in real time: what the program and the node share."""

from __future__ import annotations

import gc
import random
import time
from collections import deque
from collections.abc import Callable
from functools import partial

from pam_driver.bus import CanPort
from pam_model.errors import PamError
from pam_ros.periodic import PeriodicLoop
from pam_sim.fault_injection import inject, mend, parse_injection
from pam_sim.faults.frame_faults import FaultyPort, FrameFaults
from pam_sim.simulated_rig import GroundTruth, SimulatedRig


class RigLoop:
    """Serves a simulated rig to a bus from a thread of its own.

    Parameters
    ----------
    rig : SimulatedRig
        The rig; belongs to this loop from now on.
    port : CanPort
        An open bus; closed by `stop`.
    rate : float
        Turns per second [Hz].
    truth_rate : float, optional
        How often `truth` is brought up to date [Hz]; 0 for never.

    Attributes
    ----------
    truth : GroundTruth
        The true state.
    truth_time : float
        Its wall-clock time [s].
    sim, frames, now
        What faults act on, see `fault_injection.Stage`.
    """

    def __init__(
        self,
        rig: SimulatedRig,
        port: CanPort,
        rate: float,
        truth_rate: float = 0.0,
        realtime_priority: int = 0,
    ) -> None:
        self.sim = self._rig = rig
        self.frames = FrameFaults()
        self.now = time.monotonic()
        self._port = FaultyPort(port, self.frames)
        self._later: list[tuple[float, Callable[[], None]]] = []
        self._asked: deque[Callable[[], None]] = deque()
        self._draw = random.Random(0)
        self._loop = PeriodicLoop(self._turn, 1.0 / rate, "simulated rig", realtime_priority)
        self.truth: GroundTruth = rig.ground_truth()
        self.truth_time = time.time()
        self._truth_every = max(1, round(rate / truth_rate)) if truth_rate > 0.0 else 0
        self._turns = 0
        self._drained_at = self.now

    def at(self, time: float, action: Callable[[], None]) -> None:
        """Do something at a time [s]; from the loop's own thread or before it starts."""
        self._later.append((time, action))

    def inject(self, text: str) -> None:
        """Bring a fault about in the next turn: `name value=0.3`, see `parse_injection`.

        Raises
        ------
        PamError
            For a text that is none.
        """
        name, values = parse_injection(text)
        self._asked.append(lambda: inject(self, name, values, self._draw))

    def schedule(self, text: str) -> None:
        """Faults at seconds from now: `3.5 supply_lost share=0.2; 8 encoder_stuck`.

        Raises
        ------
        PamError
            For an entry that is none.
        """
        start = time.monotonic()
        for entry in filter(None, (part.strip() for part in text.split(";"))):
            when, _, fault = entry.partition(" ")
            try:
                seconds = float(when)
            except ValueError:
                raise PamError(f"faults: {entry!r} must be seconds name value=number") from None
            parse_injection(fault)
            self.at(start + seconds, partial(self.inject, fault))

    def mend(self) -> None:
        """Take every fault back in the next turn."""
        self._asked.append(lambda: mend(self))

    def start(self) -> None:
        """Begin to serve."""
        self._rig.begin(time.monotonic())
        # a full collection would stop the loop for longer than a driver waits for a pressure
        gc.collect()
        gc.freeze()
        self._loop.start()

    def share_priority(self) -> None:
        """Let the host run the threads beside the loop's before other programs' as well."""
        self._loop.share_priority()

    def stop(self) -> None:
        """End the thread and give the bus back."""
        try:
            self._loop.stop()
        finally:
            self._port.close()

    def check(self) -> None:
        """Raise what ended the thread, if anything did."""
        self._loop.check()

    def report(self) -> dict[str, float]:
        """How well time was kept, and what the bus said."""
        statistics = self._loop.statistics
        return {
            "turns": statistics.cycles,
            "late turns": statistics.late,
            "skipped turns": statistics.skipped,
            "worst lateness [s]": statistics.worst_lateness,
            "time lost [s]": self._rig.lost_time,
            **{f"bus {name}": count for name, count in sorted(self._port.counts.items())},
        }

    def _turn(self, now: float) -> None:
        self.now = now
        if self._turns == 0:
            self._rig.begin(now)
        while self._asked:
            self._asked.popleft()()
        for entry in [entry for entry in self._later if entry[0] <= now]:
            self._later.remove(entry)
            entry[1]()
        # as in the driver: bounds the age when the wall clock steps
        longest, self._drained_at = now - self._drained_at, now
        wall_now = time.time()
        for frame in self._port.receive_all(now):
            age = min(max(wall_now - frame.stamp, 0.0), longest)
            self._rig.on_frame(frame.frame_id, frame.data, now, age)
        for frame_id, data in self._rig.advance(now):
            self._port.send(frame_id, data, now)
        self._turns += 1
        if self._truth_every and self._turns % self._truth_every == 0:
            self.truth, self.truth_time = self._rig.ground_truth(), time.time()
