"""Time from a measurement frame on the bus to the command frame that answers it.

    python benchmarks/latency_bench.py [--seconds 8] [--json]

The simulated rig runs in this process without noise; driver and controller run at 500 Hz, in one
process and in two, with the real-time priority for which the launch files ask.
Now and then the reading of one pressure sensor jumps. The controller answers with a jump of the
valve's command, and a listener on the bus measures the time between the two frames by the stamps of
the kernel. Beside it, in the same run, the least that this way can take: a python-can node that
publishes each frame, a node that publishes each message, and a frame for each of these. "Aligned"
are loops that follow the phase of their inputs (parameters `align` and `loop.align`).
"""

from __future__ import annotations

import itertools
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median, quantiles

from pam_demo.chain import BusChoice, Chain, multicast_bus, private_domain
from pam_demo.demo import node_settings
from pam_driver.boards.pam_board.codec import BoardCodec, Measurement, ValveCommand
from pam_driver.buses import OnlyBus, open_buses
from pam_driver.can_bus.bus import CanPort, open_bus
from pam_model.argument_types import number
from pam_model.command_line import Arguments, Command, Outcome, Parser, run_command
from pam_model.errors import PamError
from pam_model.rig import load_rig
from pam_sim.boards.sensors import SensorQuality
from pam_sim.rig_loop import RigLoop
from pam_sim.simulated_rig import SimulatedRig

ELBOW = Path(__file__).parents[1] / "config/elbow.yaml"
ECHO = Path(__file__).with_name("bare_echo.py")
QUESTION, ANSWER = 0x700, 0x701  # identifiers of the bare echo's frames
CACHED = {"PYTHONDONTWRITEBYTECODE": ""}  # as a user starts nodes: compiled once
TIMEOUT = 120.0  # s
SETTLING = 3.0  # s
JUMP = 4e3  # Pa
PAUSE = (0.04, 0.07)  # s between two jumps
LONGEST = 0.03  # s; an answer that takes longer is none
RATE = 500.0
Samples = list[tuple[float, float]]  # stamp [s] and value


class Jumping:
    """A reading that is shifted now and then."""

    def __init__(self) -> None:
        self.by = 0.0

    def __call__(self, value: float, time: float) -> float:
        """The reading for a value."""
        return value + self.by


@contextmanager
def simulated(bus: BusChoice, jumping: Jumping) -> Iterator[None]:
    """The rig without noise, in a thread of this process."""
    rig = load_rig(ELBOW)
    simulated = SimulatedRig(rig, quality=SensorQuality(0.0, 0.0, 1.0, 1e-6), now=time.monotonic())
    simulated.faults.sensors[0, 0] = jumping
    only = OnlyBus(bus.interface, bus.channel, None, {"port": bus.port})
    priority = int(node_settings(RATE)["rig"]["realtime_priority"])
    ports = open_buses(rig, simulated.wiring, only)
    loop = RigLoop(simulated, ports, 1000.0, realtime_priority=priority)
    loop.start()
    try:
        yield
    finally:
        loop.stop()


def listen(port: CanPort, seconds: float, jumping: Jumping) -> tuple[Samples, Samples]:
    """Pressures and valve commands on the bus, while the reading jumps."""
    codec = BoardCodec.from_dbc()
    pressures: Samples = []
    commands: Samples = []
    draw = random.Random(1)
    end = time.monotonic() + seconds
    jump_at = 0.0
    while (now := time.monotonic()) < end:
        if now >= jump_at:
            jumping.by = 0.0 if jumping.by else JUMP
            jump_at = now + draw.uniform(*PAUSE)
        for frame in port.receive_all(now):
            _, message = codec.decode(frame.frame_id, frame.data)
            if isinstance(message, Measurement):
                pressures.append((frame.stamp, message.pressures[0]))
            elif isinstance(message, ValveCommand):
                commands.append((frame.stamp, message.valves[0]))
        time.sleep(0.005)
    return pressures, commands


def answers(pressures: Samples, commands: Samples) -> list[float]:
    """The times from a measurement that jumps to the first command that does [s]."""
    jumps = [
        after[0]
        for before, after in itertools.pairwise(pressures)
        if abs(after[1] - before[1]) > 0.5 * JUMP
    ]
    windows = []
    for at in jumps:
        earlier = [value for stamp, value in commands if at - 0.01 < stamp <= at]
        later = [(stamp, value) for stamp, value in commands if at < stamp < at + LONGEST]
        if earlier and later:
            windows.append((at, earlier[-1], later))
    # the loop takes the jump back within some 10 ms, so that the last command is as before
    peaks = [max(abs(value - before) for _, value in later) for _, before, later in windows]
    size = median(peaks) if peaks else 0.0
    found = []
    for at, before, later in windows:
        jumped = [stamp for stamp, value in later if abs(value - before) > 0.5 * size]
        if jumped:
            found.append(jumped[0] - at)
    return found


def measured_chain(seconds: float, *, align: bool, together: bool) -> list[float]:
    """The times of the suite's nodes [s], whose loops follow each other's phase or not.

    With `together`, driver and controller share one process and one cycle.

    Raises
    ------
    PamError
        If too few jumps are answered.
    """
    bus, jumping = multicast_bus(), Jumping()
    with (
        simulated(bus, jumping),
        Chain([ELBOW], bus, {**private_domain(), **CACHED}) as chain,
    ):
        settings: dict[str, bool | int | float | str] = {
            **node_settings(RATE)["driver"], "plausibility": False, "align": align,
        }  # fmt: skip
        controller = {**node_settings(RATE)["controller"], "loop.align": align}
        if together:
            driver = chain.start_robot({"driver": settings, "controller": controller})
        else:
            chain.start("controller", controller).wait_for_output("worst at", TIMEOUT)
            driver = chain.start("driver", settings)
        driver.wait_for_output("active:", TIMEOUT)
        time.sleep(SETTLING)
        port = open_bus(bus.interface, bus.channel, port=bus.port)
        try:
            pressures, commands = listen(port, seconds, jumping)
            found = answers(pressures, commands)
        finally:
            port.close()
        chain.check()
    if len(found) < 10:
        raise PamError(f"only {len(found)} jumps were answered; is the machine busy?")
    return found


def measured_echo(seconds: float) -> list[float]:
    """The times of the bare nodes [s]."""
    bus = multicast_bus()
    environment = {**os.environ, **private_domain(), **CACHED}
    roles = (["controller"], ["driver", bus.channel, str(bus.port)])
    nodes = [
        subprocess.Popen([sys.executable, str(ECHO), *role], env=environment) for role in roles
    ]
    port = open_bus(bus.interface, bus.channel, port=bus.port)
    ear = open_bus(bus.interface, bus.channel, port=bus.port)
    ending = threading.Event()
    asked: dict[int, float] = {}
    found: list[float] = []

    def take() -> None:
        for frame in ear.receive_all(0.0):
            if frame.frame_id == QUESTION:
                asked[frame.data[0]] = frame.stamp
            elif frame.frame_id == ANSWER and frame.data[0] in asked:
                found.append(frame.stamp - asked.pop(frame.data[0]))

    try:
        begin = time.monotonic()
        while not found:  # the nodes find each other
            if time.monotonic() - begin > TIMEOUT:
                raise PamError("the bare nodes do not answer")
            port.send(QUESTION, b"\x00", 0.0)
            time.sleep(0.05)
            take()
        time.sleep(1.0)
        take()
        found.clear()
        end = time.monotonic() + seconds
        count = 0
        while time.monotonic() < end:
            count = (count + 1) % 256
            port.send(QUESTION, bytes([count]), 0.0)
            ending.wait(random.uniform(0.008, 0.012))
            take()
    finally:
        for node in nodes:
            node.send_signal(signal.SIGINT)
        for node in nodes:
            node.wait(TIMEOUT)
        port.close()
        ear.close()
    return found


def _figures(times: list[float]) -> dict[str, float]:
    return {"p50_ms": 1e3 * median(times), "p99_ms": 1e3 * quantiles(times, n=100)[98]}


def _declare(parser: Parser) -> None:
    parser.add_argument(
        "--seconds",
        type=number("s", least=3.0, most=600.0),
        default=8.0,
        help="time of each measurement (default: %(default)s)",
    )


def _run(given: Arguments) -> Outcome:
    """Measure and print."""
    measured = {
        "one process": measured_chain(given.seconds, align=False, together=True),
        "one process, aligned": measured_chain(given.seconds, align=True, together=True),
        "three processes": measured_chain(given.seconds, align=False, together=False),
        "three processes, aligned": measured_chain(given.seconds, align=True, together=False),
        "bare echo": measured_echo(given.seconds),
    }
    rows = {name: {**_figures(times), "answers": len(times)} for name, times in measured.items()}
    for name, row in rows.items():
        print(f"{name:25s} p50 {row['p50_ms']:6.2f} ms   p99 {row['p99_ms']:6.2f} ms   "
              f"{row['answers']} answers")  # fmt: skip
    return Outcome(rows)


BENCH = Command("latency", "from a measurement frame to the command frame", _declare, _run)

if __name__ == "__main__":
    sys.exit(run_command(BENCH, "python benchmarks/latency_bench.py"))
