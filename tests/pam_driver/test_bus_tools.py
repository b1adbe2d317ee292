"""The commands scan and monitor: who sends on a bus, and what a robot's boards measure."""

from __future__ import annotations

import json
import struct
import threading
import time
from collections.abc import Iterator

import pytest

from pam_driver.__main__ import main
from pam_driver.boards.pam_board.codec import BoardCodec
from pam_driver.boards.wiring import RigWiring
from pam_driver.can_bus.bus import CanPort, ReceivedFrame, open_bus
from pam_driver.can_bus.identifiers import EXTENDED, FD
from pam_driver.tools.monitor import Monitor
from pam_driver.tools.scan import FrameRecord, name_senders, record
from pam_model.rig import load_rig
from pam_sim.boards.sensors import SensorQuality
from pam_sim.simulated_rig import SimulatedRig
from support.rigs import CONFIG, ELBOW

pytestmark = pytest.mark.system

BAD_NEWS = 1


@pytest.fixture
def chatter(request: pytest.FixtureRequest) -> Iterator[tuple[str, CanPort]]:
    """A simulated elbow that sends on a virtual bus in another thread; and its end of the bus."""
    channel = request.node.name
    port = open_bus("virtual", channel)
    simulated = SimulatedRig(load_rig(ELBOW), quality=SensorQuality(0.0, 0.0, 0.0, 0.0))
    stop = threading.Event()
    start = time.monotonic()

    def run() -> None:
        while not stop.wait(0.005):
            now = time.monotonic() - start
            for frame_id, data in simulated.advance(now):
                port.send(frame_id, data, now)
            port.send(0x705, b"\x05", now)
            port.send(EXTENDED | 0x18FF0102, struct.pack(">HH", 7, int(1e3 * now)), now)

    thread = threading.Thread(target=run)
    thread.start()
    yield channel, port
    stop.set()
    thread.join()
    port.close()


def test_scan_names_boards_canopen_nodes_and_unknown_frames_and_sends_nothing(
    chatter: tuple[str, CanPort], capsys: pytest.CaptureFixture[str]
) -> None:
    channel, far_end = chatter
    words = ["scan", "--interface", "virtual", "--channel", channel, "--duration", "0.6"]
    assert main([*words, "--json", "--check"]) == 0
    found = {one["identifier"]: one for one in json.loads(capsys.readouterr().out)["frames"]}
    assert found["0x180"]["sender"] == "board 0 (pam_board), Measurement"
    assert found["0x700"]["sender"].startswith("board 0 (pam_board), Heartbeat: prot")
    assert found["0x705"]["sender"] == "CANopen node 5, operational"
    unknown = found["0x18FF0102"]
    assert unknown["sender"] == "unknown" and unknown["length"] == 4
    assert set(unknown["changing_bytes"]) <= {2, 3} and 3 in unknown["changing_bytes"]
    assert far_end.receive_all(0.0) == []


def test_a_bus_without_a_frame_is_bad_news(
    request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["scan", "--interface", "virtual", "--channel", request.node.name]
    assert main([*words, "--duration", "0.05", "--check"]) == BAD_NEWS
    assert "no frame was received on virtual" in capsys.readouterr().err


def test_a_rate_and_the_bytes_that_change_are_found(codec: BoardCodec) -> None:
    records: dict[int, FrameRecord] = {}
    payloads = [bytes([1, tick % 2, 9]) for tick in range(11)]
    record([ReceivedFrame(0x123 | FD, p, 0.02 * i) for i, p in enumerate(payloads)], records)
    record([ReceivedFrame(0x180, bytes(8), 0.0)], records)
    measurement, one = name_senders(records.values(), codec)
    assert (one.identifier, one.sender, one.changing_bytes) == ("0x123 FD", "unknown", (1,))
    assert one.rate == pytest.approx(50.0)
    assert measurement.sender == "unknown", "without a heartbeat, 0x180 may be of any device"


def test_monitor_decodes_by_the_rig_file_and_sends_nothing(
    chatter: tuple[str, CanPort], capsys: pytest.CaptureFixture[str]
) -> None:
    channel, far_end = chatter
    words = ["monitor", str(ELBOW), "--interface", "virtual", "--channel", channel]
    assert main([*words, "--duration", "0.8", "--period", "0.2", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    # the CANopen node uses an identifier of this project's boards
    assert document["conditions"] == ["frame 0x705: Heartbeat has 1 bytes, expected 8"]
    assert document["pressures"]["elbow_flexor"] == pytest.approx(0.0, abs=5e3)
    assert document["angles"]["elbow"] == pytest.approx(0.0, abs=0.1)
    assert far_end.receive_all(0.0) == []


def test_monitor_says_which_board_is_missing(
    request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = str(CONFIG / "elbow_vendor_dbc.yaml")
    words = ["monitor", rig, "--interface", "virtual", "--channel", request.node.name]
    assert main([*words, "--duration", "0.1", "--period", "0.05", "--check"]) == BAD_NEWS
    shown = capsys.readouterr()
    assert "elbow_flexor -  elbow_extensor -  elbow -" in shown.out
    assert "board manifold: no PVM_Actual, no PVM_Joint, no PVM_Status for 0.5 s" in shown.err


def test_the_bus_of_a_rig_that_describes_its_buses_is_not_an_option(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["monitor", str(CONFIG / "two_buses.yaml"), "--channel", "can7"]) == 2
    expected = "error: --channel: the rig file describes its buses (boards, vendor); change"
    assert capsys.readouterr().err.startswith(expected)


def test_a_monitor_has_no_way_to_send() -> None:
    class Deaf:
        state = None

        def receive_all(self, now: float) -> list[ReceivedFrame]:
            return []

    rig = load_rig(ELBOW)
    monitor = Monitor(rig, RigWiring(rig), {"": Deaf()})
    monitor.receive(1.0, 1.0)
    assert monitor.pressures(1.0) == {"elbow_flexor": None, "elbow_extensor": None}
