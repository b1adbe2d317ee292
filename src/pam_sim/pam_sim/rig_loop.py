"""Runs a simulated rig on a CAN bus in real time; used by the program and by the node."""

from __future__ import annotations

import gc
import random
import time
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial

from pam_driver.can_bus.bus import CanPort
from pam_model.bounds import within
from pam_model.errors import PamError
from pam_ros.periodic import PeriodicLoop
from pam_sim.fault_injection import inject, mend, parse_injection
from pam_sim.faults.frame_faults import FaultyPort, FrameFaults
from pam_sim.simulated_rig import GroundTruth, SimulatedRig


class RigLoop:
    """Connects a simulated rig with a bus, in a thread of its own.

    Parameters
    ----------
    rig : SimulatedRig
        The rig; only this loop may use it from now on.
    ports : CanPort, or mapping of str to CanPort
        An open bus, or those of the rig by name; closed by `stop`.
    rate : float
        Turns per second [Hz].
    truth_rate : float, optional
        How often `truth` is updated [Hz]; 0 for never.
    realtime_priority : int, optional
        Requested real-time priority of the thread, see `pam_ros.periodic.take_priority`.

    Attributes
    ----------
    truth : GroundTruth
        The true state.
    truth_time : float
        Its wall-clock time [s].
    sim, frames, now
        The objects on which faults act, see `fault_stage.FaultStage`.
    """

    def __init__(
        self,
        rig: SimulatedRig,
        ports: CanPort | Mapping[str, CanPort],
        rate: float,
        truth_rate: float = 0.0,
        realtime_priority: int = 0,
    ) -> None:
        self.sim = self._rig = rig
        self.frames = FrameFaults()
        self.now = time.monotonic()
        named = ports if isinstance(ports, Mapping) else {"": ports}
        self._ports = {name: FaultyPort(port, self.frames, name) for name, port in named.items()}
        self._later: list[tuple[float, Callable[[], None]]] = []
        self._asked: deque[Callable[[], None]] = deque()
        self._draw = random.Random(0)
        within("rate", rate, unit="Hz", above=0.0)
        self._loop = PeriodicLoop(self._turn, 1.0 / rate, "simulated rig", realtime_priority)
        self.truth: GroundTruth = rig.ground_truth()
        self.truth_time = time.time()
        self._truth_every = max(1, round(rate / truth_rate)) if truth_rate > 0.0 else 0
        self._turns = 0
        self._drained_at = self.now

    def at(self, time: float, action: Callable[[], None]) -> None:
        """Call `action` at a time [s]; for use in the loop's thread or before it starts."""
        self._later.append((time, action))

    def inject(self, text: str) -> None:
        """Inject a fault in the next turn: `name value=0.3`, see `parse_injection`.

        Raises
        ------
        PamError
            For a text that does not describe a fault.
        """
        name, values = parse_injection(text, self._rig.rig)
        self._asked.append(lambda: inject(self, name, values, self._draw))

    def schedule(self, text: str) -> None:
        """Inject faults at times from now [s]: `3.5 supply_lost share=0.2; 8 encoder_stuck`.

        Raises
        ------
        PamError
            For an entry that does not describe a time and a fault.
        """
        start = time.monotonic()
        for entry in filter(None, (part.strip() for part in text.split(";"))):
            when, _, fault = entry.partition(" ")
            try:
                seconds = float(when)
            except ValueError:
                raise PamError(f"faults: {entry!r}: expected SECONDS NAME VALUE=NUMBER") from None
            parse_injection(fault, self._rig.rig)
            self.at(start + seconds, partial(self.inject, fault))

    def mend(self) -> None:
        """End every fault in the next turn."""
        self._asked.append(lambda: mend(self))

    def start(self) -> None:
        """Start the thread."""
        self._rig.begin(time.monotonic())
        # a full garbage collection would pause the loop for longer than the driver's time-out
        gc.collect()
        gc.freeze()
        self._loop.start()

    def share_priority(self) -> None:
        """Give a real-time priority to the other threads too, if the loop's thread has one."""
        self._loop.share_priority()

    def stop(self) -> None:
        """End the thread and close the bus."""
        try:
            self._loop.stop()
        finally:
            for port in self._ports.values():
                port.close()

    def check(self) -> None:
        """Raise the exception that ended the thread, if there was one."""
        self._loop.check()

    def report(self) -> dict[str, float]:
        """The timing of the loop, and the counts of the bus."""
        statistics = self._loop.statistics
        return {
            "turns": statistics.cycles,
            "late turns": statistics.late,
            "skipped turns": statistics.skipped,
            "worst lateness [s]": statistics.worst_lateness,
            "time lost [s]": self._rig.lost_time,
            **{
                f"bus {bus} {name}".replace("  ", " "): count
                for bus, port in self._ports.items()
                for name, count in sorted(port.counts.items())
            },
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
        # bounds the age when the wall clock steps, as in the driver
        longest, self._drained_at = now - self._drained_at, now
        wall_now = time.time()
        for bus, port in self._ports.items():
            for frame in port.receive_all(now):
                age = min(max(wall_now - frame.stamp, 0.0), longest)
                self._rig.on_frame(frame.frame_id, frame.data, now, age, bus)
        for bus, (frame_id, data) in self._rig.advance_buses(now):
            self._ports[bus].send(frame_id, data, now)
        self._turns += 1
        if self._truth_every and self._turns % self._truth_every == 0:
            self.truth, self.truth_time = self._rig.ground_truth(), time.time()
