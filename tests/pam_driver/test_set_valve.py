"""The command set: one valve follows for a moment, after a question, and then everything vents."""

from __future__ import annotations

import io
import json
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from pam_driver.__main__ import main
from pam_driver.boards.pam_board.codec import BoardCodec, ValveCommand
from pam_driver.can_bus.bus import CanPort, open_bus
from pam_model.rig import load_rig
from pam_sim.rig_loop import RigLoop
from pam_sim.simulated_rig import SimulatedRig
from support.canopen_device import ELBOW_CANOPEN
from support.rigs import ELBOW

pytestmark = pytest.mark.system

VALVES = {ELBOW: ("0", "0"), ELBOW_CANOPEN: ("outputs", "flexor")}


@pytest.fixture(params=list(VALVES), ids=lambda path: path.stem)
def robot(request: pytest.FixtureRequest) -> Iterator[tuple[Path, str, RigLoop]]:
    """A simulated elbow on a virtual bus: its rig file, the bus, and the loop."""
    path, channel = request.param, request.node.name
    loop = RigLoop(
        SimulatedRig(load_rig(path)), open_bus("virtual", channel), 500.0, truth_rate=100.0
    )
    loop.start()
    yield path, channel, loop
    loop.stop()


def words(path: Path, channel: str, percent: str, *more: str) -> list[str]:
    bus = ["--interface", "virtual", "--channel", channel]
    return ["set", str(path), *VALVES[path], percent, *bus, *more]


@pytest.mark.sampled("one of the two muscles", cases=1)
def test_only_the_named_muscle_fills_and_it_is_vented_afterwards(
    robot: tuple[Path, str, RigLoop], capsys: pytest.CaptureFixture[str]
) -> None:
    path, channel, loop = robot
    assert main(words(path, channel, "10", "--yes", "--json", "--duration", "0.5")) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["muscle"] == "elbow_flexor"
    assert document["pressure_before"] < 1e4
    assert document["pressure_highest"] > 2e4
    flexor, extensor = loop.truth.pressures
    assert flexor < 2e4
    assert extensor < 1e4


@pytest.mark.sampled("one of the two cases", cases=1)
def test_above_the_limit_it_vents_at_once_and_says_so(
    robot: tuple[Path, str, RigLoop], capsys: pytest.CaptureFixture[str]
) -> None:
    path, channel, _ = robot
    more = ("--yes", "--check", "--duration", "10", "--limit", "50000")
    assert main(words(path, channel, "60", *more)) == 1
    assert "kPa, the limit is 50.0 kPa" in capsys.readouterr().err


@pytest.mark.sampled("one of the three answers", cases=1)
@pytest.mark.parametrize("answer", ["no\n", "", "y\n"])
def test_nothing_is_sent_unless_someone_types_yes(
    answer: str,
    request: pytest.FixtureRequest,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    far_end = open_bus("virtual", request.node.name)
    monkeypatch.setattr("sys.stdin", io.StringIO(answer))
    assert main(words(ELBOW, request.node.name, "10")) == 2
    assert capsys.readouterr().err.endswith("error: not confirmed; nothing was sent\n")
    assert far_end.receive_all(0.0) == []
    far_end.close()


@pytest.mark.sampled("one of the three mistakes", cases=1)
@pytest.mark.parametrize(
    ("valve", "percent", "expected"),
    [
        (
            ("outputs", "elbow"),
            "10",
            "outputs elbow: no such valve in the rig file; it has outputs flexor (elbow_flexor), "
            "outputs extensor (elbow_extensor)",
        ),
        (("outputs", "flexor"), "-10", "-10 %: the valve of elbow_flexor takes 0 to 100 %"),
        (("outputs", "flexor"), "110", "110 %: the valve of elbow_flexor takes 0 to 100 %"),
    ],
)
def test_a_valve_or_value_that_does_not_exist_is_refused(
    valve: tuple[str, str], percent: str, expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["set", str(ELBOW_CANOPEN), *valve, percent, "--yes"]) == 2
    assert capsys.readouterr().err == f"error: {expected}\n"


def test_it_refuses_while_a_driver_commands_the_boards(
    request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    driver: CanPort = open_bus("virtual", request.node.name)
    codec, stop = BoardCodec.from_dbc(), threading.Event()
    frame_id, data = codec.encode(0, ValveCommand((0.0, 0.0), (False, False), 1))

    def command() -> None:
        while not stop.wait(0.01):
            driver.send(frame_id, data, 0.0)

    thread = threading.Thread(target=command)
    thread.start()
    try:
        assert main(words(ELBOW, request.node.name, "10", "--yes")) == 2
    finally:
        stop.set()
        thread.join()
        heard = driver.receive_all(0.0)
        driver.close()
    assert "another driver commands the boards of this rig" in capsys.readouterr().err
    assert heard == []
