"""A robot with several buses: read from the rig file, opened, driven, and refused where wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from pam_driver.boards.weaker_promises import weaker_promises
from pam_driver.boards.wiring import RigWiring
from pam_driver.buses import OnlyBus, open_buses
from pam_driver.can_bus.bus import CanPort
from pam_driver.can_bus.bus_opening import BusError
from pam_driver.can_bus.identifiers import EXTENDED, FD
from pam_driver.driver import Driver
from pam_driver.driver_diagnostics import DriverDiagnostics
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand
from pam_model.errors import RigError
from pam_model.rig import Bus, load_rig, save_rig
from pam_ros.periodic import LoopStatistics
from pam_sim.boards.sensors import SensorQuality
from pam_sim.simulated_rig import SimulatedRig
from support.canopen_device import io_module
from support.rigs import CONFIG
from support.weak_device import rig_with_sensors_apart, weak_rig

TWO_BUSES = CONFIG / "two_buses.yaml"
ONLY = OnlyBus("virtual", "unused")


def rig_file(folder: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """The example with two buses, with changes."""
    tree = yaml.safe_load(TWO_BUSES.read_text())
    change(tree["/**"]["ros__parameters"])
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump(tree))
    return path


def on_virtual_buses(channel: str) -> Callable[[dict[str, Any]], None]:
    def change(tree: dict[str, Any]) -> None:
        for name, bus in tree["buses"].items():
            bus |= {"interface": "virtual", "channel": f"{channel} {name}"}
        tree["boards"]["manifold"]["dbc"] = str(CONFIG / "pneumatic_manifold.dbc")

    return change


def test_a_rig_with_several_buses_is_read_and_written(tmp_path: Path) -> None:
    rig = load_rig(TWO_BUSES)
    assert rig.buses["vendor"] == Bus("socketcan", "can1", 1_000_000)
    save_rig(rig, tmp_path / "again.yaml")
    assert load_rig(tmp_path / "again.yaml") == rig
    assert RigWiring(rig).buses == ("boards", "vendor")
    assert load_rig(CONFIG / "elbow.yaml").buses == {}


def test_the_driver_moves_a_robot_that_mixes_kinds_on_two_buses(
    tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    """Over real ports: each frame stays on its bus, and both joints move."""
    rig = load_rig(rig_file(tmp_path, on_virtual_buses(request.node.name)))
    # these steps of the valves move the joints faster than a person's arm
    quick = tuple(replace(joint, max_velocity=50.0) for joint in rig.joints)
    rig = replace(rig, joints=quick)
    simulated = SimulatedRig(rig, quality=SensorQuality(0.0, 0.0, 0.0, 0.0))
    wiring = RigWiring(rig)
    ours, theirs = open_buses(rig, wiring, ONLY), open_buses(rig, simulated.wiring, ONLY)
    try:
        driver = Driver(rig, ours, DriverSettings(), wiring=wiring)
        seen = _move(driver, simulated, theirs)
        assert seen == {"boards": {0x80, 0x100}, "vendor": {EXTENDED | 0x18FF1010}}
        diagnostics = DriverDiagnostics(driver, ours, dict.fromkeys(ours, 1e6))
        names = [s.name for s in diagnostics.statuses(LoopStatistics(0, 0, 0, 0.0), 1.0)]
        assert names[1:3] == ["pam_driver: bus boards", "pam_driver: bus vendor"]
        theirs["vendor"].send(0x123, b"", 9.0)
        driver.cycle(9.0, 9.0)
        counts = {
            name: counter["unknown_id"] for name, (counter, _) in driver.errors_by_bus.items()
        }
        assert counts == {"boards": 0, "vendor": 1}
        assert driver.frame_errors["unknown_id"] == 1
    finally:
        for port in (*ours.values(), *theirs.values()):
            port.close()


def test_the_driver_moves_a_robot_with_a_valve_board_and_canopen_on_two_buses(
    tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    """Both use the same range of identifiers, each on its bus; on one bus they are refused."""

    def change(tree: dict[str, Any]) -> None:
        on_virtual_buses(request.node.name)(tree)
        tree["boards"]["upper_arm"]["number"] = 5
        tree["boards"]["manifold"] = {**io_module(5), "bus": "vendor"}

    rig = load_rig(rig_file(tmp_path, change))
    quick = tuple(replace(joint, max_velocity=50.0) for joint in rig.joints)
    rig = replace(rig, joints=quick)
    simulated = SimulatedRig(rig, quality=SensorQuality(0.0, 0.0, 0.0, 0.0))
    wiring = RigWiring(rig)
    ours, theirs = open_buses(rig, wiring, ONLY), open_buses(rig, simulated.wiring, ONLY)
    try:
        seen = _move(Driver(rig, ours, DriverSettings(), wiring=wiring), simulated, theirs)
        assert seen == {"boards": {0x085, 0x105}, "vendor": {0x000, 0x205, 0x605, 0x77F}}
    finally:
        for port in (*ours.values(), *theirs.values()):
            port.close()
    boards = {name: {**section, "bus": "boards"} for name, section in rig.boards.items()}
    with pytest.raises(RigError, match="board manifold: board upper_arm uses identifier 0x185"):
        RigWiring(replace(rig, boards=boards)).make_boards()


def _move(
    driver: Driver, simulated: SimulatedRig, theirs: dict[str, CanPort]
) -> dict[str, set[int]]:
    """Half a second of motion; returns which frames each bus carried to the boards."""
    rig = driver.rig
    agonists = {joint.agonist for joint in rig.joints}
    high = tuple(0.3 if muscle.name in agonists else 0.05 for muscle in rig.muscles)
    seen: dict[str, set[int]] = {name: set() for name in theirs}
    now = 0.0

    def run(seconds: float, fractions: tuple[float, ...] | None) -> None:
        nonlocal now
        for _ in range(round(seconds / 0.002)):
            now += 0.002
            for bus, port in theirs.items():
                for frame in port.receive_all(now):
                    seen[bus].add(frame.frame_id)
                    simulated.on_frame(frame.frame_id, frame.data, now, bus=bus)
            for bus, (frame_id, data) in simulated.advance_buses(now):
                theirs[bus].send(frame_id, data, now)
            if fractions is not None:
                position, effort = driver.intake.in_units(fractions)
                driver.set_commands(NamedCommand(rig.muscle_names, position, (), effort), now)
            driver.cycle(now, now + 1e9)

    run(0.3, None)
    driver.activate(now)
    run(0.1, tuple(0.0 for _ in rig.muscles))
    before = simulated.ground_truth().positions
    run(0.4, high)
    after = simulated.ground_truth().positions
    assert all(b - a > 0.05 for a, b in zip(before, after, strict=True))
    assert driver.state is SafetyState.ACTIVE, driver.faults
    driver.vent_at_once(now)
    run(0.01, None)
    return seen


def no_such_bus(tree: dict[str, Any]) -> None:
    tree["boards"]["manifold"]["bus"] = "vendors"


def no_bus_named(tree: dict[str, Any]) -> None:
    del tree["boards"]["manifold"]["bus"]


def numbered_board(tree: dict[str, Any]) -> None:
    tree["shoulder"]["encoder"]["board"] = 0


def one_channel_twice(tree: dict[str, Any]) -> None:
    tree["buses"]["vendor"]["channel"] = "can0"


def bitrate_in_kilobit(tree: dict[str, Any]) -> None:
    tree["buses"]["vendor"]["bitrate"] = 500


def channel_that_is_no_text(tree: dict[str, Any]) -> None:
    tree["buses"]["vendor"]["channel"] = 1


def unknown_key(tree: dict[str, Any]) -> None:
    tree["buses"]["vendor"]["chanel"] = "can1"


def fd_misspelt(tree: dict[str, Any]) -> None:
    tree["buses"]["vendor"]["fd"] = "on"


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (no_such_bus, "boards.manifold.bus = vendors: buses has no section of this name; did you"),
        (no_bus_named, "boards.manifold.bus: the rig has the buses boards, vendor, so a section"),
        (
            numbered_board,
            "board 0: the rig has the buses boards, vendor, so a section under boards",
        ),
        (one_channel_twice, "buses.vendor.channel = can0: boards is the same channel"),
        (bitrate_in_kilobit, "buses.vendor.bitrate = 500 bit/s: must be from 10000 to 1e+06 bit/s"),
        (channel_that_is_no_text, "buses.vendor.channel = 1: must be a text"),
        (unknown_key, "buses.vendor.chanel: unknown key; did you mean channel?"),
        (fd_misspelt, "buses.vendor.fd = 'on': must be true or false"),
    ],
)
def test_wrong_buses_are_refused_in_one_line(
    change: Callable[[dict[str, Any]], None], expected: str, tmp_path: Path
) -> None:
    with pytest.raises(RigError) as caught:
        RigWiring(load_rig(rig_file(tmp_path, change)))
    assert expected in str(caught.value)


def test_identifiers_of_canopen_are_refused_where_canopen_devices_share_the_bus() -> None:
    rig = load_rig(TWO_BUSES)
    shared = {name: replace(bus, canopen=True) for name, bus in rig.buses.items()}
    with pytest.raises(RigError) as caught:
        RigWiring(replace(rig, buses=shared)).make_boards()
    lines = str(caught.value).splitlines()
    assert [line.split(",")[0] for line in lines] == [
        "board upper_arm: identifier 0x100 is TIME of CANopen",
        "board upper_arm: identifier 0x080 is SYNC of CANopen",
    ]
    assert all(line.endswith("says that CANopen devices share this bus") for line in lines)


def test_frames_of_can_fd_pass_a_bus_that_has_them(request: pytest.FixtureRequest) -> None:
    data = bytes(range(12))
    rig = load_rig(TWO_BUSES)
    for fd, expected in ((True, [(0x123 | FD, data)]), (False, [])):
        bus = Bus("virtual", f"{request.node.name} {fd}", fd=fd)
        fast = replace(rig, buses={"boards": bus, "vendor": bus})
        wiring = RigWiring(fast)
        ours, theirs = (open_buses(fast, wiring, ONLY)["vendor"] for _ in range(2))
        theirs.send(0x123 | FD, data, 0.0)
        assert [frame[:2] for frame in ours.receive_all(0.0)] == expected
        assert ours.counts["remote_or_fd"] == (0 if fd else 1)


def test_frames_of_can_fd_need_a_bus_that_the_rig_file_describes(tmp_path: Path) -> None:
    rig = weak_rig(tmp_path)
    with pytest.raises(BusError, match="message 0x310 is a CAN FD frame: describe the bus in the"):
        open_buses(rig, RigWiring(rig), ONLY)
    slow = replace(rig, buses={"io": Bus("virtual", "x")})
    with pytest.raises(RigError, match=r"0x310 is a CAN FD frame, and buses\.io\.fd is false"):
        RigWiring(slow).make_boards()


def test_what_a_board_does_not_promise_is_said_with_what_makes_up_for_it() -> None:
    (board,) = RigWiring(load_rig(CONFIG / "elbow_vendor_dbc.yaml")).make_boards().values()
    board.promises = strong = replace(board.promises, keeps_host_fault=True)
    assert weaker_promises(board) == []
    board.promises = replace(strong, watchdog=None, measures_supply=False)
    lines = weaker_promises(board)
    assert len(lines) == 2
    assert lines[0].startswith("no watchdog: ") and "; instead: a dump valve" in lines[0]
    assert all("\n" not in line for line in lines)


def test_a_device_needs_promises_only_for_what_it_does(tmp_path: Path) -> None:
    """No watchdog is asked of a sensor, and no counter of a device that only drives valves."""
    boards = RigWiring(rig_with_sensors_apart(tmp_path)).make_boards()
    of_valves, of_sensors = (weaker_promises(boards[name]) for name in ("valves", "sensors_0"))
    assert any(line.startswith("no watchdog") for line in of_valves)
    assert any("an unplugged device is not noticed" in line for line in of_valves)
    assert not any("counter" in line for line in of_valves)
    assert [line.split(":")[0] for line in of_sensors] == [
        "no fault report",
        "no counter in the measurements",
        "no uptime",
    ]


def test_a_pressure_sensor_on_another_board_is_read_written_and_wired(tmp_path: Path) -> None:
    rig = rig_with_sensors_apart(tmp_path)
    save_rig(rig, tmp_path / "rig.yaml")
    assert load_rig(tmp_path / "rig.yaml") == rig
    wiring = RigWiring(rig)
    assert wiring.muscles[2:] == (("valve_board", 0), ("valve_board", 1))
    assert wiring.sensors[2:] == (("sensors_1", "left"), ("sensors_1", "right"))
    muscle = rig.muscles[3]
    twice = replace(muscle, pressure_sensor=rig.muscles[2].pressure_sensor)
    with pytest.raises(
        RigError, match=r"elbow_extensor\.pressure_sensor: elbow_flexor already uses"
    ):
        RigWiring(rig.with_muscle(twice))
    tree = yaml.safe_load((tmp_path / "rig.yaml").read_text())
    del tree["/**"]["ros__parameters"]["elbow_flexor"]["pressure_sensor"]["channel"]
    (tmp_path / "torn.yaml").write_text(yaml.safe_dump(tree))
    with pytest.raises(RigError, match=r"elbow_flexor\.pressure_sensor\.channel: missing; a pr"):
        load_rig(tmp_path / "torn.yaml")
