"""Driver and simulated boards over real SocketCAN, and what the usual CAN tools show of it.

Both ends live in the test's process and follow a clock of its own, so that an emulated processor
can run it; the frames go through the kernel.

vcan has an interface and a queue but no controller. So the interface really goes down and up, the
queue really refuses frames (a queue without room, by `tc`), and error frames really come from the
kernel's socket layer; but what a controller would report, bus-off and restart, is put on the bus by
a raw socket, and what it would do, neither send nor hear, is brought about beside it.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from pam_driver.boards.pam_board.codec import BoardState
from pam_driver.can_bus.bus import BusState
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand
from support.kernel_chain import PERIOD, KernelChain, receivers, wait_for_receiver
from support.reruns import EMULATED

ROOT = Path(__file__).parents[2]
pytestmark = [pytest.mark.vcan, pytest.mark.rerun_because(EMULATED)]

NAMES = ("elbow_flexor", "elbow_extensor")
AIR = (0.2, 0.1)
OWN = "vcan94"
BUS_OFF, RESTARTED, CONTROLLER, NO_ACKNOWLEDGE = 0x040, 0x100, 0x004, 0x020  # linux/can/error.h
WARNING, PASSIVE = 0x08, 0x20
SHOWN = {
    "ValveCommand": ("Valve0", "Valve1", "Enable0", "Counter", "Crc"),
    "Measurement": ("Pressure0", "Pressure1", "Position"),
    "Status": ("State", "SupplyPressure"),
    "Heartbeat": ("Uptime", "ProtocolVersion"),
}


class Chain(KernelChain):
    """With one board of this project, whose state is watched as well."""

    def run(self, seconds: float, fractions: tuple[float, float] | None = None) -> None:  # type: ignore[override]
        super().run(seconds, None if fractions is None else NamedCommand(NAMES, fractions))

    def make_move(self) -> None:
        """Clear, activate, and let air in."""
        self.driver.clear_faults(self.now)
        self.run_until(SafetyState.VENTED)
        self.driver.activate(self.now)
        self.run(0.4, AIR)
        assert self.moves()

    def moves(self) -> bool:
        active = self.driver.state is SafetyState.ACTIVE
        return active and self.rig.boards[0].state is BoardState.ACTIVE

    def reasons(self) -> set[str]:
        """Kinds of the faults that are latched."""
        return {fault.kind for fault in self.driver.faults}

    def assert_vented_and_latched(self) -> None:
        """Commands come and the bus is well again, and nothing moves before someone allows it."""
        self.run(0.5, AIR)
        assert self.driver.state is SafetyState.FAULT
        assert self.rig.boards[0].state is not BoardState.ACTIVE
        assert all(
            command == valve.vented
            for command, valve in zip(
                self.rig.boards[0].valve_commands, self.rig.boards[0].valves, strict=True
            )
        )


def test_air_moves_over_socketcan_vents_after_and_candump_shows_it(bus, rig_path) -> None:
    chain = Chain(rig_path, bus.channel)
    before = receivers(bus.channel)
    dump = subprocess.Popen(
        ["candump", "-n", "150", bus.channel], stdout=subprocess.PIPE, text=True
    )
    try:
        wait_for_receiver(bus.channel, before)
        chain.run(0.5)
        chain.driver.activate(chain.now)
        chain.run(0.5, (0.2, 0.1))
        assert chain.driver.state is SafetyState.ACTIVE
        assert min(chain.pressures()) > 2e4
        raw, _ = dump.communicate(timeout=60.0)

        # commands end: driver and board vent, and stay so
        chain.run_until(SafetyState.FAULT)
        chain.run(0.5)
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


def run_tool(*command: str) -> None:
    subprocess.run(command, check=True, timeout=60)


def make_queue(room: bool) -> None:
    """A transmit queue without room refuses each frame, as one does that nobody empties."""
    if room:
        run_tool("tc", "qdisc", "del", "dev", OWN, "root")
    else:
        run_tool("tc", "qdisc", "add", "dev", OWN, "root", "pfifo", "limit", "0")


@pytest.fixture
def own_vcan() -> Iterator[str]:
    """An interface that a test may spoil."""
    run_tool("ip", "link", "add", "dev", OWN, "type", "vcan")
    run_tool("ip", "link", "set", OWN, "up")
    yield OWN
    subprocess.run(["ip", "link", "del", OWN], check=False, timeout=60)


@pytest.fixture
def chain(own_vcan: str, rig_path: Path) -> Iterator[Chain]:
    """Air moves; `sensor_timeout` is long, for boards and driver share a queue here."""
    chain = Chain(rig_path, own_vcan, DriverSettings(sensor_timeout=0.4, loop_delay_limit=0.4))
    chain.run(0.5)
    chain.make_move()
    yield chain
    chain.close()


def put_error(kind: int, detail: int = 0) -> None:
    """An error frame as a controller's driver would put it into the kernel."""
    data = bytes((0, detail, 0, 0, 0, 0, 0, 0))
    message = can.Message(arbitration_id=kind, is_extended_id=False, is_error_frame=True, data=data)
    with can.Bus(interface="socketcan", channel=OWN) as bus:
        bus.send(message)


def test_an_interface_that_goes_down_vents_and_moves_again_only_when_allowed(
    chain: Chain, own_vcan: str
) -> None:
    run_tool("ip", "link", "set", own_vcan, "down")
    chain.run(2 * PERIOD, AIR)
    assert "bus_down" in chain.reasons()
    chain.run(0.15, AIR)
    assert chain.rig.boards[0].state is BoardState.FAULT  # by its watchdog: nothing can be sent
    run_tool("ip", "link", "set", own_vcan, "up")
    chain.assert_vented_and_latched()
    chain.make_move()


def test_bus_off_vents_and_the_restart_alone_moves_nothing(chain: Chain) -> None:
    put_error(BUS_OFF)
    make_queue(room=False)
    chain.rig_is_heard = False
    chain.run(2 * PERIOD, AIR)
    assert chain.ports[0].state is BusState.BUS_OFF
    assert chain.reasons() == {"bus_off"}
    chain.run(0.15, AIR)
    assert chain.rig.boards[0].state is BoardState.FAULT
    make_queue(room=True)
    put_error(RESTARTED)
    chain.run(PERIOD, AIR)
    assert chain.ports[0].state is BusState.ERROR_ACTIVE
    chain.rig_is_heard = True
    chain.assert_vented_and_latched()
    chain.make_move()


def test_error_frames_are_counted_and_ridden_through(chain: Chain) -> None:
    for kind, detail in ((CONTROLLER, WARNING), (NO_ACKNOWLEDGE, 0), (CONTROLLER, PASSIVE)):
        put_error(kind, detail)
        chain.run(0.05, AIR)
    assert chain.moves()
    port = chain.ports[0]
    assert port.counts["error_frames"] == 3
    assert port.counts["no_acknowledge"] == port.counts["error_passive"] == 1
    assert port.state is BusState.ERROR_PASSIVE


def test_a_queue_that_is_full_for_a_moment_is_counted(chain: Chain) -> None:
    make_queue(room=False)
    chain.run(0.04, AIR)
    make_queue(room=True)
    chain.run(0.2, AIR)
    assert chain.moves()
    assert chain.ports[0].counts["send_queue_full"] >= 4


def test_a_queue_that_stays_full_vents(chain: Chain) -> None:
    make_queue(room=False)
    chain.run(0.15, AIR)
    assert "send_blocked" in chain.reasons()
    assert chain.rig.boards[0].state is BoardState.FAULT
    make_queue(room=True)
    chain.assert_vented_and_latched()
    chain.make_move()
