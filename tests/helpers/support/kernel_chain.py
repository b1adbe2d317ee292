"""A driver and a simulated rig in one process, on a clock of their own, over real SocketCAN."""

from __future__ import annotations

import time
from pathlib import Path

from pam_driver.can_bus.bus import open_bus
from pam_driver.driver import Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand
from pam_model.rig import load_rig
from pam_sim.simulated_rig import SimulatedRig
from support.commands import offer

PERIOD = 0.01  # s
RECEIVERS = Path("/proc/net/can/rcvlist_all")


def receivers(channel: str) -> int:
    """How many sockets receive everything from an interface; the kernel has a line for each."""
    return sum(line.split()[:1] == [channel] for line in RECEIVERS.read_text().splitlines())


def wait_for_receiver(channel: str, before: int) -> None:
    """Wait until more sockets than before receive everything from an interface."""
    end = time.monotonic() + 60.0
    while receivers(channel) <= before:
        assert time.monotonic() < end, "candump has opened no socket"
        time.sleep(0.05)


class KernelChain:
    """Each end has a socket of its own; the frames go through the kernel.

    Parameters
    ----------
    rig_path : Path
        The rig file.
    channel : str
        The CAN interface.
    settings : DriverSettings, optional
        Of the driver.
    """

    def __init__(
        self, rig_path: Path, channel: str, settings: DriverSettings | None = None
    ) -> None:
        rig = load_rig(rig_path)
        self.ports = [open_bus("socketcan", channel) for _ in range(2)]
        self.rig = SimulatedRig(rig, rate=1.0 / PERIOD, step=0.001)
        self.driver = Driver(rig, self.ports[0], settings or DriverSettings())
        self.rig_is_heard = True
        self.now = 0.0

    def run(self, seconds: float, command: NamedCommand | None = None) -> None:
        """Let time pass; with a command, it is given in each cycle."""
        for _ in range(round(seconds / PERIOD)):
            self.now += PERIOD
            for frame in self.ports[1].receive_all(self.now):
                self.rig.on_frame(frame.frame_id, frame.data, self.now)
            for frame_id, data in self.rig.advance(self.now):
                if self.rig_is_heard:
                    self.ports[1].send(frame_id, data, self.now)
            if command is not None:
                offer(self.driver, command, self.now)
            self.driver.cycle(self.now, 0.0)

    def run_until(self, state: SafetyState) -> None:
        """Muscles need time to become empty."""
        end = self.now + 6.0
        self.run(0.2)
        while self.driver.state is not state:
            assert self.now < end, self.driver.state
            self.run(0.1)

    def pressures(self) -> tuple[float, ...]:
        """The measured pressures [Pa gauge]."""
        return self.driver.cycle(self.now, 0.0).pressures

    def close(self) -> None:
        """Close both sockets."""
        for port in self.ports:
            port.close()
