"""Driver and simulated boards over real SocketCAN, and what the usual CAN tools show of it.

Both ends live in the test's process and follow a clock of its own, so that an emulated processor
can run it; the frames go through the kernel.
"""

from __future__ import annotations

import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pam_driver.bus import open_bus
from pam_driver.codec import BoardCodec, BoardState
from pam_driver.command_intake import NamedCommand
from pam_driver.driver import Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety_state import SafetyState
from pam_model.rig import load_rig
from pam_sim.simulated_rig import SimulatedRig

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.vcan

PERIOD = 0.01  # s
NAMES = ("elbow_flexor", "elbow_extensor")
SHOWN = {
    "ValveCommand": ("Valve0", "Valve1", "Enable0", "Counter", "Crc"),
    "Measurement": ("Pressure0", "Pressure1", "Position"),
    "Status": ("State", "SupplyPressure"),
    "Heartbeat": ("Uptime", "ProtocolVersion"),
}


class Chain:
    """A driver and a simulated rig, each with a socket of its own."""

    def __init__(self, rig_path: Path, channel: str) -> None:
        rig, codec = load_rig(rig_path), BoardCodec.from_dbc()
        self.ports = [open_bus("socketcan", channel) for _ in range(2)]
        self.rig = SimulatedRig(rig, codec=codec, rate=1.0 / PERIOD, step=0.001)
        self.driver = Driver(rig, codec, self.ports[0], DriverSettings())
        self.now = 0.0

    def run(self, seconds: float, fractions: tuple[float, float] | None = None) -> None:
        for _ in range(round(seconds / PERIOD)):
            self.now += PERIOD
            for frame in self.ports[1].receive_all(self.now):
                self.rig.on_frame(frame.frame_id, frame.data, self.now)
            for frame_id, data in self.rig.advance(self.now):
                self.ports[1].send(frame_id, data, self.now)
            if fractions is not None:
                self.driver.set_commands(NamedCommand(NAMES, fractions), self.now)
            self.driver.cycle(self.now, 0.0)

    def pressures(self) -> tuple[float, ...]:
        return self.driver.cycle(self.now, 0.0).pressures

    def close(self) -> None:
        for port in self.ports:
            port.close()


def test_air_moves_over_socketcan_vents_after_and_candump_shows_it(bus, rig_path) -> None:
    chain = Chain(rig_path, bus.channel)
    dump = subprocess.Popen(
        ["candump", "-n", "150", bus.channel], stdout=subprocess.PIPE, text=True
    )
    try:
        time.sleep(2.0)  # until candump listens
        chain.run(0.5)
        chain.driver.activate(chain.now)
        chain.run(0.5, (0.2, 0.1))
        assert chain.driver.state is SafetyState.ACTIVE
        assert min(chain.pressures()) > 2e4
        raw, _ = dump.communicate(timeout=60.0)

        # commands end: driver and board vent, and stay so
        chain.run(1.5)
        assert chain.driver.state is SafetyState.FAULT
        assert max(chain.pressures()) < 3e3
        assert chain.rig.boards[0].state is not BoardState.ACTIVE
        chain.run(0.2, (0.5, 0.5))
        assert max(chain.pressures()) < 3e3
    finally:
        dump.kill()
        chain.close()

    decoded = subprocess.run(
        [sys.executable, "-m", "cantools", "decode", str(ROOT / "config" / "pam_board.dbc")],
        input=raw, capture_output=True, text=True, timeout=300.0, check=True,
    ).stdout  # fmt: skip
    assert "Unknown frame id" not in decoded
    for name, signals in SHOWN.items():
        blocks = re.findall(rf"{name}\((.*?)\)", decoded, re.DOTALL)
        assert blocks, f"{name} is not among the decoded frames:\n{decoded[:2000]}"
        for signal in signals:
            assert f"{signal}:" in blocks[0]
    pressures = [float(text) for text in re.findall(r"Pressure0: (-?[\d.]+) Pa", decoded)]
    assert max(pressures) > 1e4
