"""CANopen devices on real SocketCAN, as tools that are not ours see them.

`candump` of can-utils writes down what is on the bus, and the package `canopen` decodes it: states,
emergencies and PDOs by the EDS files, with the PDO mapping that stands in the recorded SDO frames.
The points of CiA 301 that a reader of the bus can check are checked on every frame.
"""

from __future__ import annotations

import re
import signal
import subprocess
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import canopen
import pytest
import yaml

from pam_driver.boards.canopen.dictionary import profile_path
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand
from support.canopen_device import ELBOW_CANOPEN
from support.kernel_chain import KernelChain, receivers, wait_for_receiver
from support.reruns import EMULATED

pytestmark = [pytest.mark.vcan, pytest.mark.rerun_because(EMULATED)]

PROFILES = {5: "cia401_analogue", 6: "cia404_pressure", 7: "cia404_pressure", 8: "cia406_encoder"}
HOST = 127
EMERGENCY = 0x3000  # voltage, CiA 301
AIR = NamedCommand(("elbow_flexor", "elbow_extensor"), (), (), (1.2e5, 0.8e5))
OPERATIONAL, STOPPED, READY = 5, 4, 127
LINE = re.compile(r"\((\d+\.\d+)\) \w+ ([0-9A-F]+)#([0-9A-F]*)")
DOWNLOADS = {0x23: 4, 0x27: 3, 0x2B: 2, 0x2F: 1}  # expedited, with the number of bytes


@dataclass
class Seen:
    """What candump has written down, and what canopen makes of it."""

    frames: list[tuple[int, bytes]]
    nodes: set[int] = field(default_factory=set)
    states: dict[int, list[int]] = field(default_factory=lambda: defaultdict(list))
    emergencies: list[tuple[int, int]] = field(default_factory=list)
    values: dict[tuple[int, str], list[float]] = field(default_factory=lambda: defaultdict(list))

    def of(self, identifier: int) -> list[bytes]:
        return [data for frame_id, data in self.frames if frame_id == identifier]


def written(frames: list[tuple[int, bytes]], node: int) -> dict[tuple[int, int], int]:
    """The objects of a node that the recorded SDO requests have set."""
    found = {}
    for frame_id, data in frames:
        if frame_id == 0x600 + node and data[0] in DOWNLOADS:
            length = DOWNLOADS[data[0]]
            index, sub = int.from_bytes(data[1:3], "little"), data[3]
            found[index, sub] = int.from_bytes(data[4 : 4 + length], "little")
    return found


def follow(seen: Seen, node: canopen.RemoteNode, maps: Any, base: int) -> None:
    """Decode the PDOs of a node by the mapping that was written at boot."""
    objects = written(seen.frames, node.id)
    for pdo in maps.values():
        count = objects.get((pdo.map_array.od.index, 0), 0)
        if not count:
            continue
        pdo.clear()
        for sub in range(1, count + 1):
            entry = objects[pdo.map_array.od.index, sub]
            pdo.add_variable(entry >> 16, entry >> 8 & 0xFF, entry & 0xFF)
        number = (pdo.map_array.od.index & 0xF) + 1
        pdo.cob_id, pdo.enabled = base + 0x100 * (number - 1) + node.id, True

        def keep(message: Any, node_id: int = node.id) -> None:
            for variable in message:
                seen.values[node_id, f"{variable.index:X}"].append(variable.raw)

        pdo.add_callback(keep)
        pdo.subscribe()


def decode(text: str) -> Seen:
    """What `canopen` makes of a log of candump."""
    lines = LINE.findall(text)
    seen = Seen([(int(number, 16), bytes.fromhex(data)) for _, number, data in lines])
    network = canopen.Network()
    for number, profile in PROFILES.items():
        node = network.add_node(number, str(profile_path(profile)))
        node.nmt.add_heartbeat_callback(seen.states[number].append)

        def keep(error: Any, number: int = number) -> None:
            seen.emergencies.append((number, error.code))

        node.emcy.add_callback(keep)
        follow(seen, node, node.tpdo, 0x180)
        follow(seen, node, node.rpdo, 0x200)
    for (stamp, _, _), (frame_id, data) in zip(lines, seen.frames, strict=True):
        network.notify(frame_id, bytearray(data), float(stamp))
    seen.nodes = set(network.scanner.nodes)
    return seen


@pytest.fixture
def rig_file(tmp_path: Path) -> Path:
    """The example, whose encoder measures at each SYNC."""
    document = yaml.safe_load(ELBOW_CANOPEN.read_text())
    document["/**"]["ros__parameters"]["boards"]["encoder"]["transmission"] = "sync"
    path = tmp_path / "rig.yaml"
    path.write_text(yaml.safe_dump(document))
    return path


@pytest.fixture
def candump(bus: Any, tmp_path: Path) -> Iterator[Any]:
    """Starts candump; calling it ends candump and returns its log."""
    path = tmp_path / "candump.log"
    before = receivers(bus.channel)
    with path.open("w") as out:
        process = subprocess.Popen(["candump", "-L", bus.channel], stdout=out)
    wait_for_receiver(bus.channel, before)

    def log() -> str:
        process.send_signal(signal.SIGINT)
        process.wait(60.0)
        return path.read_text()

    yield log
    if process.poll() is None:
        process.kill()
        process.wait()


def check_dialogue(seen: Seen, node: int) -> None:
    """Each SDO request has 8 bytes and an answer for the same object, without an abort."""
    asked, answered = seen.of(0x600 + node), seen.of(0x580 + node)
    assert {len(data) for data in (*asked, *answered)} == {8}
    objects = [data[1:4] for data in asked]  # one that is asked again was not answered at first
    new = [one for place, one in enumerate(objects) if objects[place - 1 : place] != [one]]
    assert [data[1:4] for data in answered] == new
    assert all(data[0] != 0x80 for data in answered), f"node {node}"
    assert (0x1017, 0) in written(seen.frames, node)


def test_tools_that_are_not_ours_read_every_frame_of_boot_motion_and_emergency(
    bus: Any, rig_file: Path, candump: Any
) -> None:
    chain = KernelChain(rig_file, bus.channel)
    try:
        chain.run_until(SafetyState.VENTED)
        chain.run(1.0)
        chain.driver.activate(chain.now)
        chain.run(0.5, AIR)
        assert chain.driver.state is SafetyState.ACTIVE, chain.driver.faults
        pressures = chain.pressures()
        assert min(pressures) > 4e4
        chain.rig.boards["outputs"].misbehave("emergency", EMERGENCY)
        chain.run(0.05, AIR)
        assert chain.driver.state is SafetyState.FAULT
        assert "node 5: EMCY 0x3000" in str(chain.driver.faults[0])
        chain.run(0.1)
    finally:
        chain.close()
    seen = decode(candump())

    # heartbeat and NMT: each node is started once by the driver and says so, after its boot-up
    assert seen.nodes >= set(PROFILES)
    for node in PROFILES:
        assert {len(data) for data in seen.of(0x700 + node)} == {1}
        states = seen.states[node]
        assert states[0] == 0, f"boot-up of node {node}"
        assert READY in states, f"node {node}"
        assert OPERATIONAL in states[states.index(READY) :], f"node {node}"
        assert set(states) <= {0, READY, OPERATIONAL, STOPPED}
        assert bytes([1, node]) in seen.of(0x000)
    assert {len(data) for data in seen.of(0x000)} == {2}
    assert {data[0] for data in seen.of(0x000)} <= {1, 2, 0x80, 0x81, 0x82}
    assert set(seen.of(0x700 + HOST)) == {bytes([OPERATIONAL])}

    # SYNC without a counter; the encoder answers each of them
    assert set(seen.of(0x080)) == {b""}
    angles = len(seen.of(0x188))
    assert 0.8 * angles <= len(seen.of(0x080))

    for node in PROFILES:
        check_dialogue(seen, node)

    # EMCY
    assert seen.emergencies == [(5, EMERGENCY)]
    assert {len(data) for data in seen.of(0x085)} == {8}

    # PDOs: canopen decodes what the driver has measured [bar, 1e-3 bar], and the set points
    flexor, extensor = seen.values[6, "6130"], seen.values[7, "9130"]
    assert max(flexor) == pytest.approx(1e-5 * pressures[0], rel=0.1)
    assert max(extensor) == pytest.approx(1e-2 * pressures[1], rel=0.1)
    outputs = seen.values[5, "6411"]
    assert max(outputs) == pytest.approx(1.2e5 / 6e5 * 32767, rel=0.01)
    assert outputs[-1] == outputs[0] == 0
    assert len(seen.values[8, "6004"]) == angles

    # nothing has an identifier outside the predefined connection set of these nodes
    own = {0x000, 0x080, 0x700 + HOST}
    bases = (0x080, 0x180, 0x200, 0x280, 0x300, 0x380, 0x400, 0x480, 0x500, 0x580, 0x600, 0x700)
    own |= {base + node for base in bases for node in PROFILES}
    assert {frame_id for frame_id, _ in seen.frames} <= own
