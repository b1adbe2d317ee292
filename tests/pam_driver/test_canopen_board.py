"""A CANopen device and the driver: boot, faults, what the outputs do when the host is gone."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pam_driver.boards.canopen.board import CanopenBoard
from pam_driver.boards.canopen.boot import BootStage
from pam_driver.boards.canopen.dictionary import ObjectName, profile_path
from pam_driver.boards.protocol import Condition, Frame
from pam_driver.boards.wiring import RigWiring
from pam_driver.driver import ActivationError
from pam_driver.safety.states import SafetyState
from pam_driver.tools.monitor import Monitor
from pam_model.errors import RigError
from pam_model.rig import Rig, load_rig
from pam_sim.boards.canopen_twin import SimulatedCanopenDevice
from pam_sim.boards.protocol import BoardSettings
from pam_sim.boards.register import twin_called
from support.canopen_device import ELBOW_CANOPEN, ELBOW_REGULATOR
from support.mapped_device import nested

from .arm_bench import ArmBench
from .simulated_robot import Robot

NMT_STOP = b"\x02\x05"
Change = Callable[[dict[str, Any]], None]


def rig_with(change: Change, board: str = "outputs", path: Path = ELBOW_CANOPEN) -> Rig:
    rig = load_rig(path)
    sections = nested(rig.boards)
    change(sections[board])
    return replace(rig, boards=sections)


def robot_with(change: Change, board: str = "outputs") -> Robot:
    return Robot(rig_with(change, board))


def twin(robot: Robot, board: str = "outputs") -> SimulatedCanopenDevice:
    found = robot.sim.boards[board]
    assert isinstance(found, SimulatedCanopenDevice)
    return found


def board(robot: Robot, name: str = "outputs") -> CanopenBoard:
    found = robot.driver.boards[name]
    assert isinstance(found, CanopenBoard)
    return found


def conditions(robot: Robot, name: str = "outputs") -> list[Condition]:
    return list(board(robot, name).conditions(robot.now, 0.5, 0.05, False))


def moving(path: Path = ELBOW_CANOPEN) -> Robot:
    robot = Robot(load_rig(path))
    robot.move()
    return robot


def vented(robot: Robot) -> bool:
    return all(
        command == valve.vented
        for one in robot.sim.boards.values()
        for command, valve in zip(one.valve_commands, one.valves, strict=True)
    )


@pytest.mark.parametrize("path", [ELBOW_CANOPEN, ELBOW_REGULATOR], ids=lambda path: path.stem)
def test_the_boot_configures_the_watchdog_and_starts_with_vented_outputs(path: Path) -> None:
    robot = Robot(load_rig(path))
    name = next(iter(robot.sim.boards))
    slave = twin(robot, name).slave
    if path == ELBOW_CANOPEN:  # as someone has left the module
        for sub in (1, 2):
            slave.store(ObjectName(0x6443, sub), 0)
            slave.store(ObjectName(0x6444, sub), 20_000)
    robot.run(0.3)
    assert slave.number(0x1016, 1) == 127 << 16 | 100
    assert slave.number(0x1029, 1) == 2
    if path == ELBOW_CANOPEN:
        assert [slave.number(0x6443, sub) for sub in (1, 2)] == [1, 1]
        assert [slave.number(0x6444, sub) for sub in (1, 2)] == [0, 0]
    assert all(one.active for one in robot.sim.boards.values()) and vented(robot)
    assert robot.driver.missing_boards(robot.now) == []
    robot.move()
    assert not vented(robot)


@pytest.mark.parametrize("path", [ELBOW_CANOPEN, ELBOW_REGULATOR], ids=lambda path: path.stem)
def test_outputs_go_to_zero_when_the_process_of_the_driver_is_killed(path: Path) -> None:
    robot = moving(path)
    killed = robot.now
    while not vented(robot):
        robot.now += 0.001
        robot.sim.advance(robot.now)
        assert robot.now - killed < 0.2
    assert 0.09 < robot.now - killed <= 0.102


def test_without_error_mode_the_outputs_stay_and_no_watchdog_is_promised() -> None:
    """The weaker promise is true: the twin keeps its last set point, as the driver says."""

    def says_nothing(section: dict[str, Any]) -> None:
        section["outputs_off_on_error"] = False

    robot = Robot(rig_with(says_nothing, "coupler", ELBOW_REGULATOR))
    robot.move()
    for _ in range(300):
        robot.now += 0.001
        robot.sim.advance(robot.now)
    assert not vented(robot)
    assert board(robot, "coupler").promises.watchdog is None


def test_a_refused_object_is_named_with_node_object_and_abort_code_in_words() -> None:
    robot = Robot(load_rig(ELBOW_CANOPEN))
    twin(robot).misbehave("sdo_abort", 0x6443)
    robot.run(0.5)
    expected = (
        "board outputs: fault: node 5, writing 0x6443:1 (error mode of the output): abort code "
        "0x08000020, data cannot be transferred or stored to the application"
    )
    assert expected in [str(one) for one in conditions(robot)]
    with pytest.raises(ActivationError, match="node 5, writing 0x6443:1"):
        robot.driver.activate(robot.now)
    twin(robot).misbehave("mended", 0.0)
    robot.run(0.5)
    assert board(robot).boot.stage is BootStage.REFUSED, "nobody has cleared the fault"
    robot.driver.clear_faults(robot.now)
    robot.run(0.3)
    assert conditions(robot) == []
    robot.move()


def test_an_output_that_can_only_be_set_by_pdo_is_no_reason_to_refuse_the_device() -> None:
    robot = Robot(load_rig(ELBOW_CANOPEN))
    twin(robot).misbehave("sdo_abort", 0x6411)
    robot.run(0.4)
    assert conditions(robot) == []
    assert "writing 0x6411:1 (vented set point)" in str(board(robot).report().values)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({ObjectName(0x1018, 1): 0x59}, "node 5, object 0x1018:1 (vendor of the identity) is 0x59"),
        (
            {ObjectName(0x1000): 0x0002_0194},
            "node 5, object 0x1000:0 (device profile by cia401_analogue.eds) is 0x194, expected "
            "0x191",
        ),
    ],
)
def test_another_device_than_the_rig_file_says_is_refused(
    values: dict[ObjectName, int], expected: str
) -> None:
    def expects(section: dict[str, Any]) -> None:
        section["identity"] = {"vendor": 0x2A, "serial": 77}

    robot = robot_with(expects)
    for name, value in values.items():
        twin(robot).slave.store(name, value)
    robot.run(0.4)
    (found,) = conditions(robot)
    assert found.kind == "board_fault" and expected in found.text
    assert not robot.sim.boards["outputs"].active


def test_a_sensor_that_is_set_to_another_unit_is_refused() -> None:
    robot = Robot(load_rig(ELBOW_CANOPEN))
    twin(robot, "flexor_pressure").slave.store(ObjectName(0x6131, 1), 0x00AB_0000)
    robot.run(0.4)
    (found,) = conditions(robot, "flexor_pressure")
    assert "node 6, object 0x6131:1 (unit of 0x6130:1: bar) is 0xAB0000, expected 0x4E0000" in str(
        found
    )


def test_an_emergency_in_motion_vents_and_names_the_device_and_the_error() -> None:
    robot = moving()
    twin(robot, "encoder").misbehave("emergency", 0x5000)
    robot.run(0.01)
    assert robot.driver.state is SafetyState.FAULT
    (fault,) = robot.driver.faults
    assert str(fault) == (
        "board encoder: fault: node 8: EMCY 0x5000, device hardware; error register generic"
    )
    assert vented(robot)
    robot.run(0.3)
    assert conditions(robot, "encoder"), "it stays until someone clears it"
    robot.driver.clear_faults(robot.now)
    robot.run(0.5)
    assert conditions(robot, "encoder") == []


def test_a_device_that_reboots_in_motion_is_a_fault_and_is_configured_again() -> None:
    robot = moving()
    robot.sim.restart_board("outputs", robot.now)
    robot.run(0.1, command=False)
    assert robot.driver.state is SafetyState.FAULT
    assert "board outputs: node 5 has restarted (boot-up)" in [
        str(one) for one in robot.driver.faults
    ]
    robot.run(0.3)
    assert twin(robot).active and vented(robot)
    assert twin(robot).slave.number(0x1016, 1) == 127 << 16 | 100
    robot.driver.clear_faults(robot.now)
    robot.move()


def test_after_the_heartbeat_was_lost_the_device_stays_off_until_faults_are_cleared() -> None:
    robot = moving()
    robot.loses = lambda frame_id, data: frame_id == 0x77F
    robot.run(0.2)
    robot.loses = lambda frame_id, data: False
    assert robot.driver.state is SafetyState.FAULT
    (fault,) = [one for one in robot.driver.faults if one.subject == "board outputs"]
    assert "EMCY 0x8130, heartbeat of the host lost" in fault.text
    robot.run(0.5)
    assert not twin(robot).active
    assert any("left the state operational: stopped" in str(one) for one in conditions(robot))
    robot.driver.clear_faults(robot.now)
    robot.run(0.4)
    assert twin(robot).active
    robot.move()


def test_a_host_that_stalls_before_any_valve_was_opened_needs_no_person() -> None:
    robot = Robot(load_rig(ELBOW_CANOPEN))
    robot.run(0.3)
    robot.loses = lambda frame_id, data: True
    robot.run(0.2)
    assert not twin(robot).active
    robot.loses = lambda frame_id, data: False
    robot.run(0.4)
    assert twin(robot).active and conditions(robot) == []
    robot.move()


def test_an_unplugged_device_is_named_with_node_and_frames() -> None:
    robot = moving()
    robot.sim.faults.frozen["encoder"] = math.inf
    robot.run(0.3)
    assert robot.driver.state is SafetyState.FAULT
    robot.run(0.4)
    assert "board encoder: node 8: no heartbeat (0x708) for 0.25 s, no TPDO1 for 0.5 s" in [
        str(one) for one in conditions(robot, "encoder")
    ]


def test_a_device_that_does_not_answer_is_asked_again_and_found_when_it_is_plugged_in() -> None:
    robot = Robot(load_rig(ELBOW_CANOPEN))
    robot.sim.faults.frozen["outputs"] = math.inf
    robot.run(1.2)
    (lost,) = conditions(robot)
    assert "no heartbeat (0x705)" in lost.text
    assert "no answer within 3 times 100 ms" in board(robot).boot.error or "step 1" in str(
        board(robot).report()
    )
    assert robot.driver.missing_boards(robot.now) == ["board outputs"]
    robot.sim.faults.frozen.clear()
    robot.run(1.5)
    assert conditions(robot) == [] or {one.kind for one in conditions(robot)} == {"board_restarted"}
    robot.move()


def test_a_pdo_of_the_wrong_length_is_counted_and_named_with_its_objects() -> None:
    robot = Robot(load_rig(ELBOW_REGULATOR))
    robot.run(0.3)
    before = dict(board(robot, "coupler").pressures)
    robot.hears(0x194, b"\x01\x02\x03")
    assert robot.driver.last_frame_error["wrong_length"] == (
        "frame 0x194: TPDO1 of node 20 (0x2301:1, 0x2301:2) has 3 bytes, expected 4"
    )
    assert board(robot, "coupler").pressures == before


def test_the_device_refuses_a_set_point_of_the_wrong_length_with_an_emergency() -> None:
    robot = moving()
    robot.sim.on_frame(0x205, b"\xff\x7f\xff", robot.now)
    robot.run(0.01)
    assert robot.driver.state is SafetyState.FAULT
    assert "EMCY 0x8210, PDO not processed due to its length" in str(robot.driver.faults[0])


def test_another_device_that_uses_an_identifier_of_the_node_is_named() -> None:
    robot = Robot(load_rig(ELBOW_CANOPEN))
    robot.run(0.3)
    robot.hears(0x705, bytes(8))  # a heartbeat of a valve board of this project
    (found,) = conditions(robot)
    assert str(found) == (
        "board outputs: fault: frame 0x705: heartbeat of node 5 has 8 bytes, expected 1: another "
        "device may use this identifier"
    )
    robot.run(1.1)
    assert conditions(robot) == []


def plug_in_a_second(robot: Robot, name: str) -> None:
    """Another device of the same kind with the same node number, as both come from the maker."""
    wired = robot.sim.wired[name]
    other = twin_called("canopen")({}).make(wired, BoardSettings(), robot.now)
    hears, advance = robot.sim.on_frame, robot.sim.advance

    def on_frame(frame_id: int, data: bytes, now: float) -> None:
        hears(frame_id, data, now)
        other.on_frame(frame_id, data, now)

    def both(now: float) -> list[Frame]:
        pressures, angles = [0.0] * len(wired.pressures), [0.0] * len(wired.angles)
        return [*advance(now), *other.poll(now, pressures, angles, 7e5)]

    robot.sim.on_frame, robot.sim.advance = on_frame, both  # type: ignore[assignment]


@pytest.mark.parametrize("running", [False, True])
def test_two_devices_with_the_same_node_number_are_refused(running: bool) -> None:
    robot = Robot(load_rig(ELBOW_CANOPEN))
    if running:
        robot.run(0.3)
        assert conditions(robot, "flexor_pressure") == []
    plug_in_a_second(robot, "flexor_pressure")
    robot.run(0.6)
    assert "fault: two devices answer as node 6: give one of them another node number" in " ".join(
        one.text for one in conditions(robot, "flexor_pressure")
    )
    with pytest.raises(ActivationError, match="two devices answer as node 6"):
        robot.driver.activate(robot.now)


def test_a_device_that_answers_late_is_one_device() -> None:
    """A request that was repeated has two answers."""
    robot = Robot(load_rig(ELBOW_CANOPEN))
    late: list[tuple[float, Frame]] = []
    advance = robot.sim.advance

    def delayed(now: float) -> list[Frame]:
        found = advance(now)
        late.extend((now + 0.15, frame) for frame in found if frame[0] == 0x586)
        due = [frame for time, frame in late if time <= now]
        late[:] = [entry for entry in late if entry[0] > now]
        return [frame for frame in found if frame[0] != 0x586] + due

    robot.sim.advance = delayed  # type: ignore[method-assign]
    robot.run(12.0)
    assert board(robot, "flexor_pressure").boot.stage is BootStage.DONE
    robot.move()


def test_a_device_that_measures_nothing_can_be_stopped_to_vent() -> None:
    def stops(section: dict[str, Any]) -> None:
        section["vent"] = "stop"

    robot = robot_with(stops)
    robot.move()
    robot.sent.clear()
    robot.driver.vent_at_once(robot.now)
    assert NMT_STOP in [data for _, frame_id, data in robot.sent if frame_id == 0]
    assert vented(robot) and not twin(robot).active
    robot.run(0.3)
    assert conditions(robot) == [] and not twin(robot).active
    robot.run(1.0)
    robot.driver.activate(robot.now)
    robot.run(0.1, command=True)
    assert twin(robot).active and not vented(robot)
    assert robot.driver.state is SafetyState.ACTIVE, robot.driver.faults


def test_measurements_follow_sync_if_the_rig_file_says_so() -> None:
    def by_sync(section: dict[str, Any]) -> None:
        section["transmission"] = "sync"

    robot = robot_with(by_sync, "encoder")
    robot.move()
    slave = twin(robot, "encoder").slave
    assert slave.number(0x1800, 2) == 1 and slave.number(0x1800, 5) == 0
    robot.sent.clear()
    robot.run(0.1, command=True)
    assert sum(frame_id == 0x080 for _, frame_id, _ in robot.sent) == 50
    assert board(robot, "encoder").angles["shaft"].time == pytest.approx(robot.now, abs=0.005)


def fixed_mapping(section: dict[str, Any]) -> None:
    section["pdo_mapping"] = "read"


def test_a_fixed_mapping_is_taken_from_the_eds_file_and_checked() -> None:
    robot = robot_with(fixed_mapping, "encoder")
    robot.move()
    writes = [data for _, frame_id, data in robot.sent if frame_id == 0x608 and data[0] & 0x20]
    assert not [data for data in writes if data[2] in (0x1A, 0x16)], "the mapping is not written"
    other = robot_with(fixed_mapping, "encoder")
    twin(other, "encoder").slave.store(ObjectName(0x1A00, 1), 0x6004_0010)
    other.run(0.4)
    (found,) = conditions(other, "encoder")
    assert (
        "node 8, object 0x1A00:1 (mapping of TPDO1) is 0x60040010, expected 0x60040020"
        in found.text
    )


def test_a_maker_s_eds_file_is_found_beside_the_rig_file_and_its_identity_is_checked(
    tmp_path: Path,
) -> None:
    text = profile_path("cia406_encoder").read_text()
    named = text.replace(
        "ParameterName=Vendor-ID\nObjectType=0x7\nDataType=0x0007\nAccessType=ro\nDefaultValue=0",
        "ParameterName=Vendor-ID\nObjectType=0x7\nDataType=0x0007\nAccessType=ro\nDefaultValue=0x11",
    )
    assert named != text
    (tmp_path / "encoder.eds").write_text(named)
    rig_text = ELBOW_CANOPEN.read_text().replace("profile: cia406_encoder", "eds: encoder.eds")
    (tmp_path / "rig.yaml").write_text(rig_text)
    robot = Robot(load_rig(tmp_path / "rig.yaml"))
    robot.move()
    other = Robot(load_rig(tmp_path / "rig.yaml"))
    twin(other, "encoder").slave.store(ObjectName(0x1018, 1), 0x12)
    other.run(0.4)
    assert "(vendor of the identity) is 0x12, expected 0x11" in conditions(other, "encoder")[0].text


def module_with_16_bits(folder: Path, error_value: str = "") -> Path:
    """The rig with an I/O module whose EDS file has 0x6443 and 0x6444 with 16 bits."""
    parts = re.split(r"(?=^\[)", profile_path("cia401_analogue").read_text(), flags=re.MULTILINE)
    changed = [
        re.sub("DataType=0x000[45]", "DataType=0x0006", part)
        if re.match(r"\[644[34]sub[1-9]", part)
        else part
        for part in parts
    ]
    assert changed != parts
    (folder / "module.eds").write_text("".join(changed))
    text = ELBOW_CANOPEN.read_text().replace("profile: cia401_analogue", "eds: module.eds")
    if error_value:
        first = 'object: "0x6411:1", '
        text = text.replace(first, f"{first}error_value: {error_value}, ")
    (folder / "rig.yaml").write_text(text)
    return folder / "rig.yaml"


def test_the_error_value_has_the_size_that_the_eds_file_says(tmp_path: Path) -> None:
    """Some modules have 16 bits where CiA 401 has 32; 4 bytes would be refused (0x06070010)."""
    robot = Robot(load_rig(module_with_16_bits(tmp_path)))
    robot.move()
    assert twin(robot).slave.values[ObjectName(0x6444, 1)] == bytes(2)
    assert twin(robot).slave.values[ObjectName(0x6443, 1)] == b"\x01\x00"


def test_an_error_value_that_does_not_fit_is_refused(tmp_path: Path) -> None:
    expected = "error_value = 65536: 0x6444:1 has 16 bits without sign"
    with pytest.raises(RigError, match=expected):
        RigWiring(load_rig(module_with_16_bits(tmp_path, "65536")))


def test_a_monitor_decodes_without_configuring_anything() -> None:
    robot = moving()
    wiring = RigWiring(robot.rig)

    class Ear:
        state = robot.state

        def receive_all(self, now: float) -> list[Any]:
            return heard

    heard = [robot.received(*frame) for frame in robot.sim.advance(robot.now + 0.004)]
    monitor = Monitor(robot.rig, wiring, {"": Ear()})  # it has no way to send
    monitor.receive(robot.now, robot.now + 1e3)
    assert monitor.angles(robot.now)["elbow"] == pytest.approx(
        robot.sim.ground_truth().positions[0], abs=0.01
    )
    assert all(value is not None for value in monitor.pressures(robot.now).values())


def test_what_is_weaker_than_a_valve_board_is_said_in_the_words_of_canopen() -> None:
    from pam_driver.boards.weaker_promises import weaker_promises

    boards = RigWiring(load_rig(ELBOW_CANOPEN)).make_boards()
    lines = weaker_promises(boards["outputs"])
    assert any(
        line.startswith("no latch of its own: it stays off until the driver") for line in lines
    )
    assert not any("watchdog:" in line for line in lines)
    sensor = weaker_promises(boards["encoder"])
    assert len(sensor) == 1 and sensor[0].startswith("no counter in the measurements")


@pytest.mark.parametrize("path", [ELBOW_CANOPEN, ELBOW_REGULATOR], ids=lambda path: path.stem)
def test_a_robot_of_canopen_devices_follows_a_motion_without_a_false_fault(path: Path) -> None:
    """The chain of driver, frames, twins and plant, with all checks of the driver on."""
    arm = ArmBench(load_rig(path))
    arm.hold([2.5e5, 2.5e5], 1.5)
    positions = []
    for tick in range(1500):
        swing = 0.8e5 * math.sin(2.0 * math.pi * 0.5 * tick * 0.002)
        arm.wanted = [2.5e5 + swing, 2.5e5 - swing]
        arm.step(0.002)
        truth = arm.truth
        measured = [samples.value for samples in arm.driver.boards["encoder"].angles.values()]
        assert measured == pytest.approx(truth.positions, abs=0.02)
        positions.append(truth.positions[0])
    assert arm.driver.state is SafetyState.ACTIVE, arm.driver.faults
    assert max(positions) > 0.2 and min(positions) < -0.2
    assert arm.truth.pressures == pytest.approx(arm.wanted, abs=3e4)


def test_a_new_process_of_the_driver_takes_running_devices_over_and_opens_nothing() -> None:
    robot = moving()
    robot.start_driver()  # as after kill -9
    robot.sent.clear()
    robot.run(0.4)
    assert (0, NMT_STOP) in [frame[1:] for frame in robot.sent]
    assert twin(robot).active and vented(robot)
    assert robot.driver.state in {SafetyState.VENTING, SafetyState.VENTED}
    assert conditions(robot) == []
    robot.run(2.0)
    robot.move()


def test_pdos_that_nobody_uses_are_turned_off() -> None:
    robot = Robot(load_rig(ELBOW_CANOPEN))
    slave = twin(robot).slave
    on_after_power_up = [slave.number(index, 1) < 0x8000_0000 for index in (0x1401, 0x1801)]
    assert on_after_power_up == [True, True]
    robot.run(0.3)
    for index in (0x1401, 0x1402, 0x1800, 0x1801, 0x1802):
        assert int(slave.number(index, 1)) >> 31 == 1, hex(index)
    assert slave.number(0x1400, 1) == 0x205


def test_a_person_who_clears_faults_allows_the_next_start_by_itself() -> None:
    robot = moving()
    robot.driver.vent_at_once(robot.now)
    robot.run(1.0)
    robot.driver.clear_faults(robot.now)
    robot.run(0.1)
    robot.loses = lambda frame_id, data: frame_id == 0x77F
    robot.run(0.2)
    robot.loses = lambda frame_id, data: False
    robot.run(0.4)
    assert twin(robot).active and conditions(robot) == []
