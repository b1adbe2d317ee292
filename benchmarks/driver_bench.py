"""Time of one cycle of the driver, by kind of board, for the same two muscles and one joint.

Each cycle receives what the simulated boards have sent within 2 ms, judges it, and commands the
valves; the time of the simulation is not counted. Bus and process are left out.
"""

from __future__ import annotations

import statistics
import time
from collections import deque
from pathlib import Path

from pam_driver.can_bus.bus import BusState, ReceivedFrame, SendOutcome
from pam_driver.driver import Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.pressure_plausibility import PressurePlausibility
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand
from pam_model.rig import load_rig
from pam_model.robot import compose
from pam_sim.simulated_rig import SimulatedRig

CONFIG = Path(__file__).parents[1] / "config"
RIGS = ("elbow", "elbow_vendor_dbc", "elbow_canopen_regulator", "elbow_canopen")
PERIOD = 0.002
CYCLES = 1500


class Line:
    """A bus that delivers at once."""

    state = BusState.ERROR_ACTIVE

    def __init__(self) -> None:
        self.up: list[ReceivedFrame] = []
        self.down: deque[tuple[int, bytes]] = deque()

    def receive_all(self, now: float) -> list[ReceivedFrame]:
        """The frames that have arrived."""
        waiting, self.up = self.up, []
        return waiting

    def send(self, frame_id: int, data: bytes, now: float) -> SendOutcome:
        """Hand a frame to the boards."""
        self.down.append((frame_id, data))
        return SendOutcome.SENT


def cycle_times(name: str) -> tuple[list[float], int]:
    """The times of the cycles while the valves follow commands [s], and frames in one cycle."""
    rig = load_rig(CONFIG / f"{name}.yaml")
    sim, line = SimulatedRig(rig), Line()
    driver = Driver(rig, line, DriverSettings(), PressurePlausibility(compose(rig), PERIOD))
    position, effort = driver.intake.in_units(tuple(0.02 for _ in rig.muscles))
    command = NamedCommand(rig.muscle_names, position, (), effort)
    times, frames, now = [], 0, 0.0
    for cycle in range(CYCLES + 300):
        now += PERIOD
        while line.down:
            sim.on_frame(*line.down.popleft(), now)
        line.up += [ReceivedFrame(*frame, now) for frame in sim.advance(now)]
        if cycle == 200:
            driver.activate(now)
        if cycle > 200:
            driver.set_commands(command, now)
        received = len(line.up)
        start = time.perf_counter()
        driver.cycle(now, now)
        if cycle >= 300:
            times.append(time.perf_counter() - start)
            frames += received + len(line.down)
    if driver.state is not SafetyState.ACTIVE:
        raise SystemExit(f"{name}: {driver.faults}")
    return times, round(frames / CYCLES)


def main() -> None:
    """Print the table; the kinds take turns, and the best of three medians counts."""
    best: dict[str, tuple[float, float, int]] = {}
    for _ in range(3):
        for name in RIGS:
            times, frames = cycle_times(name)
            median = statistics.median(times)
            if name not in best or median < best[name][0]:
                best[name] = median, statistics.quantiles(times, n=100)[98], frames
    print("rig                        median [us]  99 % [us]  frames  over elbow")
    for name, (median, high, frames) in best.items():
        ratio = median / best[RIGS[0]][0]
        print(f"{name:25s}  {1e6 * median:11.1f}  {1e6 * high:9.1f}  {frames:6d}  {ratio:10.2f}")


if __name__ == "__main__":
    main()
