"""CANopen against software that is not ours: the nodes of the package canopen, over a bus.

`canopen`'s remote node is a master that talks to our twins, and its local node is a slave that our
driver boots. The points of CiA 301 that a master relies on are tested on the twins: boot-up, NMT
states, heartbeat, SDO with abort codes, PDO mapping, EMCY.
"""

from __future__ import annotations

import json
import logging
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import canopen
import pytest
from canopen.sdo.exceptions import SdoAbortedError

from pam_driver.__main__ import main
from pam_driver.boards.canopen.board import CanopenBoard
from pam_driver.boards.canopen.boot import BootStage
from pam_driver.boards.canopen.dictionary import profile_path
from pam_driver.boards.wiring import RigWiring
from pam_driver.can_bus.bus import CanPort, open_bus
from pam_driver.tools.canopen_scan import Identity
from pam_model.rig import Rig, load_rig
from pam_sim.boards.canopen_twin import SimulatedCanopenDevice
from pam_sim.boards.protocol import BoardSettings
from pam_sim.boards.register import twin_called
from support.canopen_device import ELBOW_CANOPEN, ELBOW_REGULATOR, io_module

pytestmark = pytest.mark.system

DEADLINE = 20.0  # s, for a loaded machine; every wait ends as soon as its condition holds


def wait_for(condition: Callable[[], bool], what: str) -> None:
    end = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < end, f"waited in vain for {what}"
        time.sleep(0.002)


@dataclass
class Robot:
    """The twins of a rig on a virtual bus, in a thread of their own."""

    rig: Rig
    port: CanPort
    twins: dict[str, SimulatedCanopenDevice] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._stop = threading.Event()
        self._wiring = RigWiring(self.rig)
        for address, wired in self._wiring.boards.items():
            made = twin_called("canopen")({}).make(wired, BoardSettings(), time.monotonic())
            assert isinstance(made, SimulatedCanopenDevice)
            self.twins[str(address)] = made
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.wait(0.001):
            now = time.monotonic()
            for frame in self.port.receive_all(now):
                for twin in self.twins.values():
                    twin.on_frame(frame.frame_id, frame.data, now)
            for address, wired in self._wiring.boards.items():
                values = [1e5 + 1e5 * place for place in range(len(wired.pressures))]
                angles = [0.5] * len(wired.angles)
                for frame_id, data in self.twins[str(address)].poll(now, values, angles, 7e5):
                    self.port.send(frame_id, data, now)

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self.port.close()


@pytest.fixture
def network(request: pytest.FixtureRequest) -> Iterator[canopen.Network]:
    logging.getLogger("canopen").setLevel(logging.CRITICAL)
    net = canopen.Network()
    net.NOTIFIER_CYCLE = 0.05
    net.connect(interface="virtual", channel=request.node.name)
    yield net
    net.disconnect()


def remote(network: canopen.Network, node: int, profile: str) -> canopen.RemoteNode:
    found = network.add_node(node, str(profile_path(profile)))
    found.sdo.RESPONSE_TIMEOUT = DEADLINE / 4
    return found


@pytest.fixture
def robot(request: pytest.FixtureRequest, network: canopen.Network) -> Iterator[Robot]:
    made = Robot(load_rig(ELBOW_CANOPEN), open_bus("virtual", request.node.name))
    yield made
    made.close()


def aborted(action: Callable[[], object]) -> int:
    with pytest.raises(SdoAbortedError) as caught:
        action()
    return int(caught.value.code)


def test_a_master_that_is_not_ours_reads_and_configures_the_twins(
    network: canopen.Network, robot: Robot
) -> None:
    node = remote(network, 5, "cia401_analogue")
    wait_for(lambda: robot.twins["outputs"].slave.state == 127, "the self test")
    assert node.sdo[0x1000].raw == 0x000C0191
    node.sdo[0x6443][3].raw = 0
    assert node.sdo[0x6443][3].raw == 0
    sdo = node.sdo
    assert aborted(lambda: sdo.upload(0x2000, 0)) == 0x0602_0000, "no such object"
    assert aborted(lambda: sdo.upload(0x6443, 20)) == 0x0609_0011, "no such sub-index"
    assert aborted(lambda: sdo.download(0x1018, 1, bytes(4))) == 0x0601_0002, "read only"
    assert aborted(lambda: sdo.download(0x1017, 0, bytes(4))) == 0x0607_0010, "wrong length"
    mapping = (0x6411_0110).to_bytes(4, "little")
    assert aborted(lambda: sdo.download(0x1601, 1, mapping)) == 0x0800_0022, "the PDO is on"
    assert aborted(lambda: sdo.download(0x1600, 1, b"\x20\x01\x44\x64")) == 0x0604_0041
    sdo.download(0x1600, 1, mapping)


def test_a_master_that_is_not_ours_sees_states_heartbeats_and_emergencies(
    network: canopen.Network, robot: Robot
) -> None:
    node = remote(network, 5, "cia401_analogue")
    states: list[int] = []
    emergencies: list[int] = []
    node.nmt.add_heartbeat_callback(states.append)
    node.emcy.add_callback(lambda error: emergencies.append(error.code))
    wait_for(lambda: robot.twins["outputs"].slave.state == 127, "the self test")
    node.sdo[0x1017].raw = 20
    wait_for(lambda: 127 in states, "a heartbeat that says pre-operational")
    node.nmt.state = "OPERATIONAL"
    wait_for(lambda: 5 in states, "a heartbeat that says operational")
    node.nmt.state = "STOPPED"
    wait_for(lambda: 4 in states, "a heartbeat that says stopped")
    robot.twins["outputs"].misbehave("emergency", 0x3000)
    wait_for(lambda: emergencies == [0x3000], "the emergency")
    del states[:]
    node.nmt.state = "RESET"
    wait_for(lambda: 0 in states, "the boot-up message")


def test_pdos_of_the_twins_are_what_a_master_that_is_not_ours_has_mapped(
    network: canopen.Network, robot: Robot
) -> None:
    sensor = remote(network, 6, "cia404_pressure")
    wait_for(lambda: robot.twins["flexor_pressure"].slave.state == 127, "the self test")
    sensor.tpdo.read()
    pdo = sensor.tpdo[2]
    pdo.clear()
    pdo.add_variable(0x6130, 1)
    pdo.trans_type, pdo.event_timer, pdo.enabled = 254, 5, True
    pdo.save()
    sensor.nmt.state = "OPERATIONAL"
    values: list[float] = []
    pdo.add_callback(lambda message: values.append(message[0].raw))
    wait_for(lambda: len(values) > 3, "TPDO2")
    assert values[-1] == pytest.approx(1.0), "1e5 Pa are 1 bar"
    module = remote(network, 5, "cia401_analogue")
    module.rpdo.read()
    module.nmt.state = "OPERATIONAL"
    wait_for(lambda: robot.twins["outputs"].active, "operational")
    command = module.rpdo[2]
    command[0].raw = 16384
    command.transmit()
    wait_for(lambda: robot.twins["outputs"].valve_commands[0] > 2.9e5, "the set point")
    assert robot.twins["outputs"].valve_commands[0] == pytest.approx(3e5, rel=1e-3)


def all_on_one(rig: Rig) -> Rig:
    """The elbow with all signals on one I/O module."""
    ports = dict(zip(rig.muscle_names, ("port_a", "port_b"), strict=True))
    for name, port in ports.items():
        muscle = replace(rig.muscle(name), board="io", channel=port, pressure_sensor=None)
        rig = rig.with_muscle(muscle)
    joint = rig.joints[0]
    assert joint.encoder is not None
    rig = rig.with_joint(replace(joint, encoder=replace(joint.encoder, board="io")))
    return replace(rig, boards={"io": io_module(9)})


def test_the_driver_boots_a_local_node_of_canopen_and_exchanges_pdos_with_it(
    network: canopen.Network, request: pytest.FixtureRequest
) -> None:
    local = canopen.LocalNode(9, str(profile_path("cia401_analogue")))
    network.add_node(local)
    (board,) = RigWiring(all_on_one(load_rig(ELBOW_CANOPEN))).make_boards().values()
    assert isinstance(board, CanopenBoard)
    port = open_bus("virtual", request.node.name)

    def cycle() -> None:
        now = time.monotonic()
        for frame in port.receive_all(now):
            if frame.frame_id in board.listeners:
                board.listeners[frame.frame_id](frame.data, now, now)
        for frame_id, data in board.command((0.25, 0.5), now):
            port.send(frame_id, data, now)

    def booted() -> bool:
        cycle()
        return board.boot.stage is BootStage.DONE

    try:
        local.nmt.state = "INITIALISING"
        local.nmt.state = "PRE-OPERATIONAL"
        wait_for(booted, f"the boot: {board.boot.progress}")
        assert local.nmt.state == "OPERATIONAL"
        assert local.sdo[0x1016][1].raw == 127 << 16 | 100
        local.rpdo.read(from_od=False)
        local.tpdo.read(from_od=False)
        assert [variable.name for variable in local.rpdo[1]] == [
            "Write analogue output 16-bit.Analogue output 1",
            "Write analogue output 16-bit.Analogue output 2",
        ]
        full = 32767 * 6.0 / 8.0  # 6 bar of the 8 bar at 10 V

        def arrived() -> bool:
            cycle()
            return local.rpdo[1][1].raw != 0

        wait_for(arrived, "a set point")
        assert [variable.raw for variable in local.rpdo[1]] == pytest.approx(
            [0.25 * full, 0.5 * full], abs=1
        )
        pdo = local.tpdo[1]
        pdo[0].raw = 32767 // 2

        def measured() -> bool:
            pdo.transmit()
            cycle()
            return board.pressures["port_a"].value == pytest.approx(4e5, rel=1e-3)

        wait_for(measured, "a pressure")
        local.emcy.send(0x4210, 0x09)

        def told() -> bool:
            cycle()
            found = board.conditions(time.monotonic(), 0.5, 0.05, False)
            return any("EMCY 0x4210, temperature" in one.text for one in found)

        wait_for(told, "the emergency")
    finally:
        local.nmt.stop_heartbeat()
        port.close()


def test_the_driver_names_what_a_local_node_of_canopen_refuses(
    network: canopen.Network, request: pytest.FixtureRequest
) -> None:
    local = canopen.LocalNode(20, str(profile_path("regulator")))
    del local.object_dictionary[0x1029]
    network.add_node(local)
    boards = RigWiring(load_rig(ELBOW_REGULATOR)).make_boards()
    board = boards["coupler"]
    assert isinstance(board, CanopenBoard)
    port = open_bus("virtual", request.node.name)

    def refused() -> bool:
        now = time.monotonic()
        for frame in port.receive_all(now):
            if frame.frame_id in board.listeners:
                board.listeners[frame.frame_id](frame.data, now, now)
        for frame_id, data in board.command(None, now):
            port.send(frame_id, data, now)
        return board.boot.stage is BootStage.REFUSED

    try:
        wait_for(refused, "the refusal")
        assert board.boot.error == (
            "node 20, writing 0x1029:1 (error behaviour: stopped): abort code 0x06020000, object "
            "does not exist"
        )
    finally:
        local.nmt.stop_heartbeat()
        port.close()


def test_scan_names_the_nodes_of_a_bus_with_their_identity(
    request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = load_rig(ELBOW_CANOPEN)
    known = {**rig.boards["outputs"], "identity": {"vendor": 0x2A, "serial": 7}}
    rig = replace(rig, boards={**rig.boards, "outputs": known})
    robot = Robot(rig, open_bus("virtual", request.node.name))
    local = canopen.LocalNode(40, str(profile_path("cia406_encoder")))
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.05
    network.connect(interface="virtual", channel=request.node.name)
    network.add_node(local)
    try:
        wait_for(lambda: robot.twins["outputs"].slave.state == 127, "the self test")
        words = ["scan", "--interface", "virtual", "--channel", request.node.name]
        assert main([*words, "--duration", "0.1", "--identify", "--json"]) == 0
    finally:
        robot.close()
        network.disconnect()
    nodes = {one["node"]: one for one in json.loads(capsys.readouterr().out)["canopen_nodes"]}
    assert set(nodes) == {5, 6, 7, 8, 40}
    assert (nodes[5]["vendor"], nodes[5]["serial"]) == (0x2A, 7)
    assert nodes[40]["device_type"] == 0x0001_0196
    text = Identity(**nodes[5]).text
    assert text == "CiA 401, I/O module, vendor 0x2A, product 0x0, revision 0x0, serial 0x7"
