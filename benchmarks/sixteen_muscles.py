"""A driver of 16 muscles on two buses at 500 Hz: late cycles, and the time of a cycle.

Four joints have valve boards of this project, four have CANopen regulators and encoders. The rig is
simulated in another process, over loopback multicast. Both loops ask for a real-time priority, as
on a robot and in the demo, so that other work of the computer does not count; the first line says
whether they got it. A cycle is late if it begins more than 1 ms after its time.
"""

from __future__ import annotations

import argparse
import copy
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Final

import yaml

from pam_driver.boards.wiring import RigWiring
from pam_driver.buses import OnlyBus, open_buses
from pam_driver.driver import ActivationError, Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.pressure_plausibility import PressurePlausibility
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand
from pam_model.rig import load_rig
from pam_model.robot import compose
from pam_ros.periodic import PeriodicLoop

CONFIG: Final = Path(__file__).parents[1] / "config"
PERIOD: Final = 0.002
JOINTS: Final = 8
PATIENCE: Final = 60.0  # s, until the rig's process answers
FILL: Final = 0.05  # of full scale
PRIORITY: Final = 20  # of the driver; that of the rig is higher, since real boards wait for nobody
BUSES: Final = {
    name: {"interface": "udp_multicast", "channel": channel, "bitrate": 1_000_000}
    for name, channel in (("boards", "239.74.163.61"), ("canopen", "239.74.163.62"))
}


def rig_file(folder: Path) -> Path:
    """A rig of eight elbows on two buses."""
    whole = yaml.safe_load((CONFIG / "elbow_canopen_regulator.yaml").read_text())
    elbow: dict[str, Any] = whole["/**"]["ros__parameters"]
    shared = {key: value for key, value in elbow.items() if "elbow" not in key}
    robot: dict[str, Any] = {**shared, "buses": BUSES, "boards": {}, "joints": []}
    for number in range(JOINTS):
        name = f"joint{number}"
        joint = copy.deepcopy(elbow["elbow"])
        joint["muscles"] = [f"{name}_flexor", f"{name}_extensor"]
        muscles = [copy.deepcopy(elbow[f"elbow_{side}"]) for side in ("flexor", "extensor")]
        if number < JOINTS // 2:
            robot["boards"][f"board{number}"] = {
                "kind": "pam_board", "number": number, "bus": "boards",
            }  # fmt: skip
            joint["encoder"] = {"board": f"board{number}", "channel": 0}
            for channel, muscle in enumerate(muscles):
                muscle.update(board=f"board{number}", channel=channel)
        else:
            for kind, node in (("coupler", 10 + number), ("encoder", 30 + number)):
                section = copy.deepcopy(elbow["boards"][kind])
                robot["boards"][f"{kind}{number}"] = {**section, "node": node, "bus": "canopen"}
            joint["encoder"]["board"] = f"encoder{number}"
            for muscle in muscles:
                muscle["board"] = f"coupler{number}"
        robot["joints"].append(name)
        robot[name] = joint
        robot.update(zip(joint["muscles"], muscles, strict=True))
    path = folder / "sixteen_muscles.yaml"
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": robot}}, sort_keys=False))
    return path


def measure(path: Path, seconds: float) -> None:
    """Drive the rig for some time and print what was measured."""
    rig = load_rig(path)
    wiring = RigWiring(rig)
    ports = open_buses(rig, wiring, OnlyBus("", ""))
    driver = Driver(
        rig, ports, DriverSettings(), PressurePlausibility(compose(rig), PERIOD), wiring
    )
    position, effort = driver.intake.in_units(tuple(FILL for _ in rig.muscles))
    command = NamedCommand(rig.muscle_names, position, (), effort)
    times: list[tuple[float, float]] = []

    def turn(now: float) -> None:
        start, busy = time.perf_counter(), time.thread_time()
        if driver.state in {SafetyState.READY, SafetyState.ACTIVE}:
            driver.set_commands(command, now)
        driver.cycle(now, time.time())
        times.append((time.perf_counter() - start, time.thread_time() - busy))

    loop = PeriodicLoop(turn, PERIOD, "driver", PRIORITY)
    loop.start()
    try:
        end = time.monotonic() + PATIENCE
        while driver.state is not SafetyState.READY and driver.state is not SafetyState.ACTIVE:
            loop.check()
            try:
                driver.activate(time.monotonic())
            except ActivationError as error:
                if time.monotonic() > end:
                    raise SystemExit(f"no activation: {error}") from None
                time.sleep(0.1)
        time.sleep(1.0)
        times.clear()
        before = loop.statistics
        cycles, late, skipped = before.cycles, before.late, before.skipped
        time.sleep(seconds)
        after = loop.statistics
        done, state = list(times), driver.state
        shown = [after.cycles - cycles, after.late - late, after.skipped - skipped]
        driver.vent_at_once(time.monotonic())
    finally:
        loop.stop()
        for port in ports.values():
            port.close()
    if state is not SafetyState.ACTIVE:
        raise SystemExit("; ".join(str(fault) for fault in driver.faults))
    print(
        f"{len(rig.muscles)} muscles, {len(driver.boards)} devices on {len(ports)} buses, "
        f"real-time priority {loop.statistics.priority or 'refused'}"
    )
    for name, values in zip(("cycle", "of it processor"), zip(*done, strict=True), strict=True):
        median, high = statistics.median(values), statistics.quantiles(values, n=100)[98]
        print(f"{name}: median {1e6 * median:.0f} us, 99 % {1e6 * high:.0f} us")
    print(f"{shown[0]} cycles at 500 Hz: {shown[1]} late, {shown[2]} skipped")


def main() -> None:
    """Simulate the rig in another process and drive it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0, help="(default: %(default)s)")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = rig_file(Path(folder))
        command = [sys.executable, "-m", "pam_sim", "rig", "--rig", str(path), "--rate", "500"]
        command += ["--realtime-priority", str(PRIORITY + 1)]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        try:
            measure(path, given.seconds)
        finally:
            process.terminate()
            process.wait()


if __name__ == "__main__":
    main()
