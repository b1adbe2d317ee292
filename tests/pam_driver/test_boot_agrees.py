"""What the boot of a CANopen device refuses, the check of the rig refuses first.

The device is the LocalNode of the package canopen with the same EDS file, on a bus in memory.
"""

from __future__ import annotations

import itertools
import logging
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import canopen
import pytest

from pam_driver.boards.canopen.board import CanopenBoard
from pam_driver.boards.canopen.boot import BootStage
from pam_driver.boards.canopen.dictionary import profile_path
from pam_driver.boards.canopen.host import Host
from pam_driver.boards.canopen.reader import CanopenDeviceReader
from pam_driver.boards.protocol import WiredBoard
from pam_driver.boards.wiring import RigWiring
from pam_model.rig import load_rig
from support.canopen_device import ELBOW_CANOPEN

NODE: Final = {"encoder": 8, "outputs": 5, "flexor_pressure": 6}
PROFILE: Final = {
    "encoder": "cia406_encoder",
    "outputs": "cia401_analogue",
    "flexor_pressure": "cia404_pressure",
}


class Periodic:
    """A heartbeat that nobody sends: the test sends it with the cycle."""

    def stop(self) -> None:
        """Nothing."""

    def update(self, data: object) -> None:
        """Nothing."""


class DeviceOnBus:
    """A device after its EDS file; `answers` are its frames since the last cycle."""

    def __init__(self, node: int, eds: Path) -> None:
        self.answers: list[tuple[int, bytes]] = []
        self._network = canopen.Network()
        network: Any = self._network
        network.send_message = lambda can_id, data, remote=False: self.answers.append(
            (can_id, bytes(data))
        )
        network.send_periodic = lambda *args, **keys: Periodic()
        self._node = canopen.LocalNode(node, str(eds))
        self._network.add_node(self._node)
        self._id = node
        self._node.nmt.state = "INITIALISING"
        self._node.nmt.state = "PRE-OPERATIONAL"

    def hear(self, frame_id: int, data: bytes) -> None:
        """Take a frame of the driver."""
        self._network.notify(frame_id, bytearray(data), 0.0)

    def cycle(self) -> list[tuple[int, bytes]]:
        """The frames of one cycle, with the heartbeat."""
        state = {"PRE-OPERATIONAL": 127, "OPERATIONAL": 5, "STOPPED": 4}
        answers, self.answers = self.answers, []
        return [*answers, (0x700 + self._id, bytes([state[self._node.nmt.state]]))]


def booted(wired: WiredBoard, reader: CanopenDeviceReader, eds: Path) -> str:
    """Why the boot was refused; empty if the device became operational."""
    assert reader.device is not None
    board = CanopenBoard(wired, reader.device, Host())
    device = DeviceOnBus(reader.device.node, eds)
    now = 0.0
    while board.boot.stage is not BootStage.DONE and now < 3.0:
        for frame_id, data in board.command(None, now):
            device.hear(frame_id, data)
        for frame_id, data in device.cycle():
            if frame_id in board.listeners:
                board.listeners[frame_id](data, now, now)
        if board.boot.stage is BootStage.REFUSED:
            break
        now += 0.002
    return "" if board.boot.stage is BootStage.DONE else board.boot.error or board.boot.progress


_MORE: Final = re.compile(r"\[(1[46A8]0[23]|1[6A]..sub[3-9]|64..sub[3-9]|100[358]|6[0-3]0[0-3])")
"""More of what the file has anyway, which would only take time."""


def flawed(text: str) -> Iterator[tuple[str, str]]:
    """Well-formed EDS files of devices that lack something, by what they lack."""
    parts = [part for part in re.split(r"(?m)^(?=\[)", text) if part and not _MORE.match(part)]
    for number, part in enumerate(parts):
        name = part[: part.index("]") + 1]
        if not re.match(r"\[[0-9A-F]{4}", name):
            continue
        rest = [*parts[:number], "", *parts[number + 1 :]]
        if "sub" in name or "DataType" in part:
            yield f"without {name}", "".join(rest)
        for access in ("const", "wo"):
            if re.search(r"(?m)^AccessType=", part) and f"={access}" not in part:
                rest[number] = re.sub(r"(?m)^AccessType=.*", f"AccessType={access}", part)
                yield f"{access} {name}", "".join(rest)


@pytest.fixture(scope="module", autouse=True)
def quiet() -> Iterator[None]:
    logging.getLogger("canopen").setLevel(logging.CRITICAL)
    yield
    logging.getLogger("canopen").setLevel(logging.NOTSET)


@pytest.mark.sampled(
    "each of the devices once, as one that is booted, and every other of its flaws",
    alike=lambda board, keys, half: board,
)
@pytest.mark.parametrize("half", [0, 1])
@pytest.mark.parametrize(
    ("board", "keys"),
    [
        ("encoder", {}),
        ("encoder", {"pdo_mapping": "read", "transmission": "sync"}),
        ("outputs", {}),
        ("flexor_pressure", {"identity": {"serial": 0}}),
    ],
    ids=["encoder", "encoder as it is", "outputs", "pressure"],
)
def test_a_device_that_the_check_accepts_is_booted(
    board: str, keys: dict[str, Any], half: int, tmp_path: Path
) -> None:
    wired = RigWiring(load_rig(ELBOW_CANOPEN)).boards[board]
    own = {key: value for key, value in wired.settings.items() if key != "profile"}
    eds = tmp_path / "dev.eds"
    accepted = refused = 0
    files = flawed(profile_path(PROFILE[board]).read_text())
    for name, text in itertools.islice(files, half, None, 2):
        eds.write_text(text)
        changed = replace(wired, settings={**own, **keys, "eds": str(eds)})
        reader = CanopenDeviceReader(changed)
        if reader.device is None:
            refused += 1
            assert all("dev.eds" in line or ": missing; " in line for line in reader.problems)
            continue
        accepted += 1
        assert not booted(changed, reader, eds), name
    assert accepted > 5
    assert refused > 2


READ_ONLY: Final = ("1800", "1800sub1", "1A00sub0", "1A00sub1", "1A00sub2")


def encoder_with(
    text: str, tmp_path: Path, **keys: Any
) -> tuple[WiredBoard, CanopenDeviceReader, Path]:
    """The encoder of the rig with another EDS file."""
    eds = tmp_path / "dev.eds"
    eds.write_text(text)
    wired = RigWiring(load_rig(ELBOW_CANOPEN)).boards["encoder"]
    own = {key: value for key, value in wired.settings.items() if key != "profile"}
    wired = replace(wired, settings={**own, **keys, "eds": str(eds)})
    return wired, CanopenDeviceReader(wired), eds


def constant(text: str, *names: str) -> str:
    """A device whose objects cannot be written."""
    for name in names:
        text = re.sub(rf"(?s)(\[{name}\].*?)AccessType=rw", r"\1AccessType=const", text, count=1)
    return text


def test_a_fixed_mapping_is_refused_with_its_remedy_which_helps(tmp_path: Path) -> None:
    text = constant(profile_path("cia406_encoder").read_text(), *READ_ONLY[1:])
    _, reader, _ = encoder_with(text, tmp_path)
    (line,) = reader.problems
    assert line.startswith("boards.encoder.pdo_mapping: dev.eds, line ")
    assert line.endswith("cannot be written (const); pdo_mapping: read takes the PDOs as they are")
    wired, reader, eds = encoder_with(text, tmp_path, pdo_mapping="read")
    assert not reader.problems
    assert not booted(wired, reader, eds)


def test_a_device_without_heartbeat_is_refused(tmp_path: Path) -> None:
    text = re.sub(r"(?s)\[1017\].*?\n\n", "", profile_path("cia406_encoder").read_text())
    _, reader, _ = encoder_with(text, tmp_path)
    assert reader.problems == [
        "boards.encoder.eds: dev.eds: 0x1017:0 (producer heartbeat time) is not there; the driver "
        "guards a device by its heartbeat, and this one has none"
    ]


def test_a_fixed_heartbeat_is_taken_as_it_is(tmp_path: Path) -> None:
    text = profile_path("cia406_encoder").read_text()
    text = re.sub(r"(?s)(\[1017\].*?)rw(\nDefaultValue=)0", r"\1const\g<2>100", text, count=1)
    _, reader, _ = encoder_with(text, tmp_path)
    assert reader.problems == [
        "boards.encoder.heartbeat_period = 0.05 s: 0x1017:0 of dev.eds is fixed at 100 ms; write "
        "0.1"
    ]
    wired, reader, eds = encoder_with(text, tmp_path, heartbeat_period=0.1)
    assert not reader.problems
    assert not booted(wired, reader, eds)


def test_equal_gaps_of_a_fixed_mapping_count_each(tmp_path: Path) -> None:
    text = profile_path("cia406_encoder").read_text()
    for name, value in (("sub0", "3"), ("sub1", "0x00050008"), ("sub2", "0x00050008")):
        text = re.sub(rf"(?s)(\[1A00{name}\].*?DefaultValue=)\w+", rf"\g<1>{value}", text, count=1)
    text = re.sub(r"(?s)(\[1A00sub3\].*?DefaultValue=)\w+", r"\g<1>0x60040020", text, count=1)
    wired, reader, eds = encoder_with(text, tmp_path, pdo_mapping="read")
    assert not reader.problems
    assert reader.device is not None
    (answer,) = reader.device.answers
    assert answer.length == 6
    assert [entry.field.shift for entry in answer.inputs] == [16]
    assert not booted(wired, reader, eds)


@pytest.mark.parametrize("mapping", ["write", "read"])
@pytest.mark.parametrize("line", ["PDOMapping=0", ""])
def test_what_the_file_itself_maps_can_be_used(mapping: str, line: str, tmp_path: Path) -> None:
    text = profile_path("cia406_encoder").read_text()
    text = re.sub(r"(?s)(\[6004\].*?)PDOMapping=1", rf"\g<1>{line}", text, count=1)
    wired, reader, eds = encoder_with(text, tmp_path, pdo_mapping=mapping)
    assert not reader.problems
    assert any("6004:0: PDOMapping is not 1, but TPDO1 carries it" in one for one in reader.doubts)
    assert not booted(wired, reader, eds)


@pytest.mark.parametrize(("low", "high"), [(0, 0), (5, 5), (10, 0)])
def test_limits_that_leave_no_range_are_no_limits(low: int, high: int, tmp_path: Path) -> None:
    text = profile_path("cia406_encoder").read_text()
    limits = f"LowLimit={low}\nHighLimit={high}\n"
    text = re.sub(r"\[6004\]\n", f"[6004]\n{limits}", text)
    _, reader, _ = encoder_with(text, tmp_path)
    assert not reader.problems
    assert any(f"LowLimit = {low} and HighLimit = {high} leave no" in one for one in reader.doubts)
