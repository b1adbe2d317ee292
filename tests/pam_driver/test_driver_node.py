"""The driver node as a process: over multicast everywhere, over SocketCAN where there is vcan."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy.parameter
from lifecycle_msgs.msg import Transition
from rcl_interfaces.srv import SetParameters
from sensor_msgs.msg import JointState

from pam_demo.chain import free_udp_port, private_domain
from pam_driver.boards.pam_board.codec import (
    BoardCode,
    BoardCodec,
    BoardFault,
    BoardState,
    Measurement,
)
from pam_driver.boards.pam_board.dbc import default_dbc_path
from support.reruns import EMULATED, HOST_STALLS

from .node_bench import ELBOW, NAMES, PATIENCE, DriverProcess, RealTimeBoard, RosPeer

VCAN = os.environ.get("PAM_TEST_CAN_CHANNEL", "vcan0")
NEEDS_VCAN = pytest.mark.skipif(
    not Path("/sys/class/net", VCAN).exists(), reason=f"no interface {VCAN} on this kernel"
)
# An emulated processor is too slow for these nodes: there tests/system/test_vcan.py does it.
OVER_VCAN = pytest.param(
    "socketcan", marks=[pytest.mark.system, NEEDS_VCAN, pytest.mark.rerun_because(EMULATED)]
)
BUSES = [pytest.param("udp_multicast", marks=pytest.mark.system), OVER_VCAN]


class Bench:
    """One driver process with its board and a ROS peer."""

    def __init__(self, folder: Path, kind: str, codec: BoardCodec) -> None:
        self.domain = int(private_domain()["ROS_DOMAIN_ID"])
        self.folder = folder
        self.bus: dict[str, Any] = {"interface": kind, "channel": VCAN}
        if kind == "udp_multicast":
            self.bus |= {"channel": "239.74.163.9", "port": free_udp_port()}
        self.board = RealTimeBoard(codec, self.bus)
        self.peer = RosPeer(self.domain)
        self.drivers: list[DriverProcess] = []

    def start(self, **options: Any) -> DriverProcess:
        place = self.folder / str(len(self.drivers))
        driver = DriverProcess(place, self.domain, self.bus, **options)
        self.drivers.append(driver)
        return driver

    def move(self) -> None:
        """Command until air moves."""
        self.peer.position = [0.25, -0.25]
        self.peer.until(lambda: self.board.air[0] > 0.2, "moving air")

    def vented(self) -> bool:
        return self.board.air == (0.0, 0.0) and self.board.state is not BoardState.ACTIVE

    def close(self) -> None:
        for driver in self.drivers:
            driver.end()
        self.board.stop()
        self.peer.close()


@pytest.fixture
def make_bench(tmp_path: Path, codec: BoardCodec) -> Iterator[Callable[[str], Bench]]:
    benches = []

    def make(kind: str) -> Bench:
        benches.append(Bench(tmp_path, kind, codec))
        return benches[-1]

    yield make
    for bench in benches:
        bench.close()


@pytest.mark.parametrize("kind", BUSES)
def test_from_frames_to_topics_and_back(make_bench: Callable[[str], Bench], kind: str) -> None:
    bench = make_bench(kind)
    bench.board.pressures, bench.board.position = [15_000.0, 5_000.0], 0.5
    bench.start()
    peer = bench.peer
    peer.until(lambda: all(peer.heard.values()), "a message on every topic")
    bench.move()
    assert peer.lifecycle() == "active"
    pressure, joint = peer.heard["pressure_states"][-1], peer.heard["joint_states"][-1]
    assert list(pressure.name) == NAMES
    assert list(pressure.effort) == [15_000.0, 5_000.0]
    assert list(joint.name) == ["elbow"]
    assert joint.position[0] == pytest.approx(0.5, abs=1e-6)
    assert len(joint.velocity) == 1
    age = time.time() - (pressure.header.stamp.sec + 1e-9 * pressure.header.stamp.nanosec)
    assert -0.1 < age < PATIENCE
    assert peer.heard["elbow_flexor/pressure"][-1].fluid_pressure == 116_325.0
    sent = peer.heard["sent_valve_commands"]
    assert list(sent[0].position) == [-1.0, -1.0]
    peer.until(lambda: list(sent[-1].position) == peer.position, "commands as sent")
    assert list(sent[-1].name) == NAMES
    assert not sent[-1].effort
    peer.until(lambda: peer.diagnostics("pam_driver: board 0"), "diagnostics")
    values = {pair.key: pair.value for pair in peer.diagnostics("pam_driver: board 0").values}
    assert values["supply pressure [Pa absolute]"] == "701320"


@pytest.mark.sampled(
    "one of the two signals, which one function answers", alike=lambda kind, number: kind
)
@pytest.mark.parametrize("kind", BUSES)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_vents_and_ends_with_0(
    make_bench: Callable[[str], Bench], kind: str, number: signal.Signals
) -> None:
    bench = make_bench(kind)
    driver = bench.start()
    bench.move()
    driver.send(number)
    if number is signal.SIGINT:
        driver.send(number)  # from the terminal, and handed on by launch
    assert driver.wait() == 0
    bench.peer.until(bench.vented, "vented")
    codes = [command.code for command in bench.board.board_commands]
    assert BoardCode.VENT in codes
    assert not any(bench.board.commands[-1].enable)
    assert "Traceback" not in driver.errors


@pytest.mark.parametrize("kind", BUSES)
def test_after_kill_the_board_vents_by_itself(
    make_bench: Callable[[str], Bench], kind: str
) -> None:
    bench = make_bench(kind)
    driver = bench.start()
    bench.move()
    driver.send(signal.SIGKILL)
    driver.wait()
    bench.peer.until(lambda: bench.board.state is BoardState.FAULT, "the board's watchdog")
    assert bench.vented()
    assert bench.board.faults == BoardFault.WATCHDOG
    # a new driver finds the latch, does not move, and gets it off when told to
    again = bench.start(parameters={"startup_timeout": 2.0})
    bench.peer.until(lambda: "watchdog" in again.errors, "the fault by name")
    assert bench.vented()
    # the killed driver's services are still listed: wait until the peer hears the new driver
    bench.peer.heard["pressure_states"].clear()
    bench.peer.until(lambda: bench.peer.heard["pressure_states"], "the new driver")
    assert bench.peer.trigger("clear_faults").success
    bench.peer.until(lambda: bench.board.state is BoardState.VENTED, "cleared")
    assert bench.vented()
    # the driver has to hear of it first
    bench.peer.until(lambda: bench.peer.change(Transition.TRANSITION_ACTIVATE), "active again")
    bench.move()


@pytest.mark.system
@pytest.mark.rerun_because(HOST_STALLS)
def test_a_latched_fault_outlives_a_killed_driver_until_it_is_cleared(
    make_bench: Callable[[str], Bench],
) -> None:
    """A supervisor that starts the driver again must not move the arm after a fault."""
    bench = make_bench("udp_multicast")
    killed = bench.start()
    bench.move()
    bench.board.pressures = [7e5, 1e5]  # over-pressure, which the driver notices and the board not
    bench.peer.until(lambda: BoardFault.HOST in bench.board.faults, "the fault, kept by the board")
    assert bench.vented()
    bench.board.pressures = [0.0, 0.0]
    killed.send(signal.SIGKILL)
    killed.wait()
    bench.board.commands.clear()
    again = bench.start()  # it activates by itself, and commands are still published
    bench.peer.until(lambda: "start-up is cancelled" in again.errors, "the refusal to start")
    assert bench.board.commands
    assert not any(any(command.enable) for command in bench.board.commands)
    # the killed driver's services are still listed: wait until the peer hears the new driver
    bench.peer.heard["pressure_states"].clear()
    bench.peer.until(lambda: bench.peer.heard["pressure_states"], "the new driver")
    assert not bench.peer.change(Transition.TRANSITION_ACTIVATE)
    assert "keeps a fault that the driver latched earlier" in again.errors
    assert bench.vented()
    assert bench.peer.trigger("clear_faults").success
    bench.peer.until(lambda: bench.board.state is BoardState.VENTED, "the fault cleared")
    bench.peer.until(lambda: bench.peer.change(Transition.TRANSITION_ACTIVATE), "activation")
    bench.peer.until(lambda: bench.board.air[0] > 0.2, "moving air")


@pytest.mark.system
@pytest.mark.rerun_because(HOST_STALLS)
def test_a_moving_driver_refuses_simulated_time_and_its_measurements_grow_old(
    make_bench: Callable[[str], Bench],
) -> None:
    """A clock that nobody publishes would keep the last measurement young for ever."""
    bench = make_bench("udp_multicast")
    bench.start()
    bench.move()
    simulated = rclpy.parameter.Parameter("use_sim_time", value=True).to_parameter_msg()
    request = SetParameters.Request(parameters=[simulated])
    (answer,) = bench.peer.call(SetParameters, "/pam_driver/set_parameters", request).results
    assert not answer.successful
    assert "use_sim_time" in answer.reason
    assert bench.board.air[0] > 0.2
    bench.board.silent = {Measurement}
    bench.peer.until(bench.vented, "the stop")
    bench.peer.until(lambda: BoardFault.HOST in bench.board.faults, "a latched fault")


@pytest.mark.system
@pytest.mark.rerun_because(HOST_STALLS)
def test_vent_service_then_activation(make_bench: Callable[[str], Bench]) -> None:
    bench = make_bench("udp_multicast")
    bench.start()
    bench.move()
    assert bench.peer.trigger("vent").success
    bench.peer.until(bench.vented, "vented")
    bench.peer.until(lambda: bench.peer.lifecycle() == "inactive", "inactive")
    assert bench.vented()  # commands still come
    # a transition that the state does not have is answered, and the node lives on
    assert not bench.peer.change(Transition.TRANSITION_CLEANUP + 97)
    assert not bench.peer.change(Transition.TRANSITION_DEACTIVATE)
    # refused until the muscles have been measured empty for a moment
    bench.peer.until(lambda: bench.peer.change(Transition.TRANSITION_ACTIVATE), "active again")
    bench.move()
    assert bench.peer.change(Transition.TRANSITION_DEACTIVATE)
    bench.peer.until(bench.vented, "vented")
    assert bench.peer.change(Transition.TRANSITION_CLEANUP)
    assert bench.peer.lifecycle() == "unconfigured"
    assert not bench.peer.trigger("vent").success
    assert bench.peer.change(Transition.TRANSITION_CONFIGURE)
    bench.peer.until(
        lambda: bench.peer.change(Transition.TRANSITION_ACTIVATE), "active after a new start"
    )
    bench.move()


def nan(message: JointState) -> None:
    message.position[1] = float("nan")


def wrong_size(message: JointState) -> None:
    message.position.append(0.0)


def unknown_name(message: JointState) -> None:
    message.name = ["elbow_flexor", "knee"]


def wrong_field(message: JointState) -> None:
    message.effort, message.position = message.position, []


def stale(message: JointState) -> None:
    message.header.stamp.sec -= 10


BAD_MESSAGES: dict[str, tuple[Callable[[JointState], None], str]] = {
    "NaN": (nan, "elbow_extensor: nan is not a finite number"),
    "wrong size": (wrong_size, "3 values in position, expected 2"),
    "unknown name": (unknown_name, "knee"),
    "wrong field": (wrong_field, "takes position"),
    "stale": (stale, "old, command_timeout is"),
}


@pytest.mark.sampled("one bad message; test_command_intake refuses every kind", cases=1)
@pytest.mark.system
@pytest.mark.rerun_because(HOST_STALLS)
@pytest.mark.parametrize("name", BAD_MESSAGES)
def test_bad_commands_are_named_and_end_vented(
    make_bench: Callable[[str], Bench], name: str
) -> None:
    change, expected = BAD_MESSAGES[name]
    bench = make_bench("udp_multicast")
    driver = bench.start()
    bench.move()
    bench.peer.make = change
    bench.peer.until(bench.vented, "vented")
    status = "pam_driver: valve_commands"

    def told() -> bool:
        found = bench.peer.diagnostics(status)
        return found is not None and expected in found.message

    bench.peer.until(told, f"{expected!r} in the diagnostics")
    bench.peer.until(lambda: expected in driver.errors, "the reason in the log")
    bench.peer.make = None
    bench.peer.until(lambda: bench.peer.lifecycle() == "inactive", "inactive")
    assert not bench.peer.change(Transition.TRANSITION_ACTIVATE)  # latched
    assert bench.vented()


@pytest.mark.system
def test_garbage_on_the_bus_is_counted_not_fatal(make_bench: Callable[[str], Bench]) -> None:
    bench = make_bench("udp_multicast")
    driver = bench.start()
    bench.move()
    for frame_id, data in ((0x180, b"\1"), (0x280, b"\xff" * 8), (0x100, b"\2" * 8), (0x55, b"")):
        bench.board.port.send(frame_id, data, 0.0)

    def told() -> bool:
        found = bench.peer.diagnostics("pam_driver: bus")
        values = {pair.key: pair.value for pair in found.values} if found else {}
        kinds = ("wrong_length", "out_of_range", "bad_crc", "unknown_id")
        return all(values.get(kind) == "1" for kind in kinds) and (
            "0x180" in values["wrong_length, last"]
        )

    bench.peer.until(told, "counts in the diagnostics")
    assert driver.process.poll() is None
    assert bench.board.air[0] > 0.2


@pytest.mark.system
@pytest.mark.rerun_because(HOST_STALLS)
def test_a_missing_board_is_named_and_nothing_waits(make_bench: Callable[[str], Bench]) -> None:
    bench = make_bench("udp_multicast")
    bench.board.stop()
    driver = bench.start(parameters={"startup_timeout": 1.0})
    bench.peer.until(lambda: "no answer from board 0" in driver.errors, "the board by name")
    assert not bench.peer.change(Transition.TRANSITION_ACTIVATE)
    driver.send(signal.SIGINT)
    assert driver.wait() == 0


@pytest.mark.parametrize("kind", BUSES)
def test_a_board_that_falls_silent_is_a_fault(
    make_bench: Callable[[str], Bench], kind: str
) -> None:
    bench = make_bench(kind)
    driver = bench.start()
    bench.move()
    bench.board.stop()
    bench.peer.until(lambda: "no pressure for 1 s" in driver.errors, "the fault by name")
    bench.peer.until(lambda: bench.peer.lifecycle() == "inactive", "inactive")


def bad_unit(text: str) -> str:
    return text.replace("supply_pressure: 701325.0", "supply_pressure: 7.01325")


def bad_key(text: str) -> str:
    return text.replace("pulley_radius:", "pulley_radious:")


def no_board(text: str) -> str:
    return text.replace("board: 0\n      channel: 1", "channel: 1")


def same_channel(text: str) -> str:
    return text.replace("board: 0\n      channel: 1", "board: 0\n      channel: 0")


BAD_STARTS: dict[str, tuple[dict[str, Any], Callable[[str], str] | None, str]] = {
    "absent bus": ({"bus.interface": "socketcan", "bus.channel": "can93"}, None, "can93"),
    "unknown bus": ({"bus.interface": "telepathy"}, None, "telepathy"),
    "absent DBC": ({"bus.dbc": "/none.dbc"}, None, "/none.dbc: cannot be read"),
    "bad options": ({"bus.options": "fast"}, None, "bus.options"),
    "rate": ({"rate": 5000.0}, None, "rate = 5000 Hz"),
    "unknown parameter": ({"command_timout": 0.1}, None, "command_timout"),
    "bar": ({}, bad_unit, "supply_pressure"),
    "wrong key": ({}, bad_key, "pulley_radious"),
    "no YAML": ({}, lambda text: "a: [1", "params file"),
    "no board": ({}, no_board, "elbow_extensor"),
    "same channel": ({}, same_channel, "channel 0"),
}


@pytest.mark.sampled("three bad starts; the words of each are held where it is checked", cases=3)
@pytest.mark.parametrize("name", BAD_STARTS)
def test_a_bad_start_is_one_message_and_no_movement(
    make_bench: Callable[[str], Bench], name: str, tmp_path: Path
) -> None:
    parameters, change, expected = BAD_STARTS[name]
    bench = make_bench("udp_multicast")
    rig = tmp_path / "rig.yaml"
    text = ELBOW.read_text()
    rig.write_text(change(text) if change else text)
    assert change is None or rig.read_text() != text
    bench.peer.position = [1.0, 1.0]
    driver = bench.start(rig=rig, parameters=parameters)
    assert driver.wait() == 2
    errors = driver.errors.strip()
    assert expected in errors
    assert "Traceback" not in errors
    assert any(line.startswith("error: ") for line in errors.splitlines())
    assert bench.vented()
    assert not any(any(command.enable) for command in bench.board.commands)


def test_a_bad_dbc_ends_the_process(make_bench: Callable[[str], Bench], tmp_path: Path) -> None:
    bench = make_bench("udp_multicast")
    dbc = tmp_path / "board.dbc"
    dbc.write_text(default_dbc_path().read_text().replace(" Position ", " Angle "))
    driver = bench.start(parameters={"bus.dbc": dbc})
    assert driver.wait() == 2
    assert driver.errors.strip() == f"error: {dbc}: Measurement.Position is missing"
    assert not bench.board.commands


@pytest.mark.system
@NEEDS_VCAN
def test_candump_shows_the_driver_s_frames(make_bench: Callable[[str], Bench]) -> None:
    """What any CAN tool sees, decoded by cantools with the DBC."""
    if shutil.which("candump") is None:
        pytest.skip("candump is not installed")
    import cantools

    bench = make_bench("socketcan")
    bench.board.pressures = [15_000.0, 5_000.0]
    bench.start()
    bench.move()
    dump = subprocess.run(
        ["candump", "-L", "-n", "200", VCAN],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=True,
    )
    database = cantools.database.load_file(default_dbc_path())
    seen: dict[str, dict[str, Any]] = {}
    for line in dump.stdout.splitlines():
        frame_id, _, data = line.split()[2].partition("#")
        message = database.get_message_by_frame_id(int(frame_id, 16))
        seen[message.name] = message.decode(bytes.fromhex(data))
    assert seen["Measurement"]["Pressure0"] == 150_000
    assert seen["ValveCommand"]["Valve0"] == pytest.approx(0.25, abs=2e-5)
    assert str(seen["ValveCommand"]["Enable0"]) == "enable"
