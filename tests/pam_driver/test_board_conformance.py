"""Every registered kind of board with its twin: the conformance checks, and a robot that moves.

Beside the kinds of the suite a kind of another package takes part, found by its entry points.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import pytest
import yaml

from pam_driver.boards import register
from pam_driver.boards.wiring import RigWiring
from pam_driver.can_bus.bus import BusState, ReceivedFrame, SendOutcome
from pam_driver.driver import Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand
from pam_model.errors import PamError, RigError
from pam_model.rig import Rig, load_rig, save_rig
from pam_sim.boards import register as twin_register
from pam_sim.boards.sensors import SensorQuality
from pam_sim.conformance import CHECKS, BoardBench, breaches
from pam_sim.simulated_rig import SimulatedRig
from support.canopen_device import io_module
from support.rigs import CONFIG, ELBOW
from support.vendor_board import SimulatedVendorBoard
from support.weak_device import rig_with_sensors_apart, weak_rig

VENDOR: Final = "vendor"
BOARDS: Final = {"left": {"kind": VENDOR, "node": 3}, "right": {"kind": VENDOR, "node": 7}}


def rig_file(folder: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """The elbow's rig file with changes."""
    tree = yaml.safe_load(ELBOW.read_text())
    change(tree["/**"]["ros__parameters"])
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump(tree))
    return path


def on_vendor_nodes(tree: dict[str, Any]) -> None:
    """Each muscle on a node of its own, the encoder on the first."""
    tree["boards"] = BOARDS
    tree["elbow"]["encoder"] = {"board": "left", "channel": "shaft"}
    for name, board in (("elbow_flexor", "left"), ("elbow_extensor", "right")):
        tree[name] |= {"board": board, "channel": "valve"}
        tree[name]["valve"] |= {"kind": "pressure_regulator", "full_scale": 600_000.0}
        tree[name]["valve"]["time_constant"] = 0.02


def vendor_rig(folder: Path) -> Rig:
    return load_rig(rig_file(folder, on_vendor_nodes))


def pam_board_rig(folder: Path) -> Rig:
    return load_rig(CONFIG / "two_joints.yaml")


def mapped_rig(folder: Path) -> Rig:
    """Two joints, each on a device of the example's DBC file; the second has other identifiers."""
    rig = load_rig(CONFIG / "elbow_vendor_dbc.yaml")
    device, valve = rig.boards["manifold"], rig.muscles[0].valve
    arm = load_rig(CONFIG / "two_joints.yaml")
    sections = {}
    for place, joint in enumerate(arm.joints):
        board = f"manifold_{place}"
        sections[board] = {**device, "identifier_offset": place}
        arm = arm.with_joint(
            replace(joint, encoder=replace(joint.encoder, board=board, channel="shaft"))
        )
        for name, port in zip(joint.muscles, ("port_a", "port_b"), strict=True):
            muscle = replace(arm.muscle(name), valve=valve, board=board, channel=port)
            arm = arm.with_muscle(muscle)
    return replace(arm, boards=sections)


def canopen_rig(folder: Path) -> Rig:
    """Two joints, each on an analogue I/O module after CiA 401 that has all its signals."""
    valve = load_rig(CONFIG / "elbow_canopen.yaml").muscles[0].valve
    arm = load_rig(CONFIG / "two_joints.yaml")
    sections = {}
    for place, joint in enumerate(arm.joints):
        board = f"module_{place}"
        sections[board] = io_module(5 + place)
        arm = arm.with_joint(
            replace(joint, encoder=replace(joint.encoder, board=board, channel="shaft"))
        )
        for name, port in zip(joint.muscles, ("port_a", "port_b"), strict=True):
            muscle = replace(arm.muscle(name), valve=valve, board=board, channel=port)
            arm = arm.with_muscle(muscle)
    return replace(arm, boards=sections)


EXAMPLES: Final[Mapping[str, Callable[[Path], Rig]]] = {
    "canopen": canopen_rig,
    "mapped": mapped_rig,
    "mapped without promises": weak_rig,
    "pam_board": pam_board_rig,
    VENDOR: vendor_rig,
}


@pytest.fixture(scope="module", autouse=True)
def vendor_is_installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What pip leaves behind for a package with these entry points."""
    folder = tmp_path_factory.mktemp("site")
    metadata = folder / "vendor_boards-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: vendor-boards\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(
        f"[{register.GROUP}]\n{VENDOR} = support.vendor_board:VendorKind\n"
        f"[{twin_register.GROUP}]\n{VENDOR} = support.vendor_board:VendorTwins\n"
    )
    sys.path.insert(0, str(folder))
    forget()
    yield
    sys.path.remove(str(folder))
    forget()


def forget() -> None:
    """Let the registers look again."""
    register.board_kinds.cache_clear()
    twin_register.board_twins.cache_clear()


def test_every_registered_kind_takes_part_and_has_a_twin() -> None:
    kinds = {name.split()[0] for name in EXAMPLES}
    assert set(register.board_kinds()) == kinds
    assert set(twin_register.board_twins()) == kinds


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
@pytest.mark.parametrize("kind", EXAMPLES)
def test_a_kind_of_board_keeps_to_the_protocol(
    kind: str, check: Callable[[BoardBench], None], tmp_path: Path
) -> None:
    check(BoardBench(EXAMPLES[kind](tmp_path)))


def opened_by_its_first_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SimulatedVendorBoard, "valve_commands", property(lambda _: (0.3e5,)))


def deaf(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SimulatedVendorBoard, "on_frame", lambda *_: None)


def mute(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SimulatedVendorBoard, "poll", lambda *_: ())


@pytest.mark.parametrize(
    ("fault", "check", "text"),
    [
        (
            opened_by_its_first_command,
            "a_board_that_has_heard_nothing_vents",
            "a valve is open at power-on",
        ),
        (deaf, "every_setpoint_reaches_its_own_valve", "the valves do not follow their set points"),
        (mute, "frames_have_the_identifiers_that_the_board_names", "its twin sends nothing"),
    ],
)
def test_the_kit_names_what_a_kind_of_another_package_does_wrong(
    fault: Callable[[pytest.MonkeyPatch], None],
    check: str,
    text: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig = vendor_rig(tmp_path)
    assert breaches(rig) == {}
    fault(monkeypatch)
    assert text in breaches(rig)[check]


class Line:
    """A bus without time between a driver and a simulated rig."""

    state = BusState.ERROR_ACTIVE

    def __init__(self) -> None:
        self.up: list[ReceivedFrame] = []
        self.down: list[tuple[int, bytes]] = []

    def receive_all(self, now: float) -> list[ReceivedFrame]:
        waiting, self.up = self.up, []
        return waiting

    def send(self, frame_id: int, data: bytes, now: float) -> SendOutcome:
        self.down.append((frame_id, data))
        return SendOutcome.SENT


@pytest.mark.parametrize("kind", [*EXAMPLES, "valves and sensors apart"])
def test_the_driver_moves_a_simulated_robot_of_every_kind(kind: str, tmp_path: Path) -> None:
    """The driver's core and the simulation know no kind: a rig file is all that differs."""
    rig = (EXAMPLES | {"valves and sensors apart": rig_with_sensors_apart})[kind](tmp_path)
    # these steps of the valves move the joints faster than a person's arm
    quick = tuple(replace(joint, max_velocity=50.0) for joint in rig.joints)
    rig = replace(rig, joints=quick)
    sim, line = SimulatedRig(rig, quality=SensorQuality(0.0, 0.0, 0.0, 0.0)), Line()
    driver = Driver(rig, line, DriverSettings())
    formats = driver.intake
    low = tuple(0.0 for _ in rig.muscles)
    agonists = {joint.agonist for joint in rig.joints}
    high = tuple(0.3 if muscle.name in agonists else 0.05 for muscle in rig.muscles)
    now = 0.0

    def run(seconds: float, fractions: tuple[float, ...] | None) -> None:
        nonlocal now
        for _ in range(round(seconds / 0.002)):
            now += 0.002
            while line.down:
                sim.on_frame(*line.down.pop(0), now)
            line.up += [ReceivedFrame(*frame, now + 1e3) for frame in sim.advance(now)]
            if fractions is not None:
                position, effort = formats.in_units(fractions)
                driver.set_commands(NamedCommand(rig.muscle_names, position, (), effort), now)
            driver.cycle(now, now + 1e3)

    run(0.3, None)
    driver.activate(now)
    run(0.2, low)
    before = sim.ground_truth().positions
    run(0.4, high)
    assert driver.state is SafetyState.ACTIVE, driver.faults
    truth = sim.ground_truth()
    assert all(b - a > 0.05 for a, b in zip(before, truth.positions, strict=True))
    snapshot = driver.cycle(now, now + 1e3)
    assert snapshot.positions == pytest.approx(truth.positions, abs=0.02)
    assert snapshot.pressures == pytest.approx(truth.pressures, abs=2e4)
    driver.vent(now)
    run(2.0, None)
    assert max(sim.ground_truth().pressures) < 3e4


def test_a_rig_file_with_named_boards_is_read_written_and_wired(tmp_path: Path) -> None:
    rig = vendor_rig(tmp_path)
    assert rig.boards == BOARDS
    assert rig.muscle("elbow_flexor").board == "left"
    save_rig(rig, tmp_path / "again.yaml")
    assert load_rig(tmp_path / "again.yaml") == rig
    wiring = RigWiring(rig)
    assert wiring.muscles == (("left", "valve"), ("right", "valve"))
    assert wiring.boards["left"].settings == BOARDS["left"]


def test_a_pam_board_may_have_a_name(tmp_path: Path) -> None:
    def named(tree: dict[str, Any]) -> None:
        tree["boards"] = {"forearm": {"kind": "pam_board", "number": 5}}
        tree["elbow"]["encoder"]["board"] = "forearm"
        for muscle in ("elbow_flexor", "elbow_extensor"):
            tree[muscle]["board"] = "forearm"

    boards = RigWiring(load_rig(rig_file(tmp_path, named))).make_boards()
    assert boards["forearm"].identifiers.answers == (0x185, 0x285, 0x705)


def unknown_kind(tree: dict[str, Any]) -> None:
    tree["boards"] = {"left": {"kind": "pam_bord", "number": 0}}
    tree["elbow_flexor"]["board"] = "left"


def no_section(tree: dict[str, Any]) -> None:
    tree["elbow_flexor"]["board"] = "left"


def unknown_key(tree: dict[str, Any]) -> None:
    on_vendor_nodes(tree)
    tree["boards"] = {**BOARDS, "left": BOARDS["left"] | {"baud": 9600}}


def unknown_pam_key(tree: dict[str, Any]) -> None:
    tree["boards"] = {"left": {"kind": "pam_board", "number": 0, "node": 3}}
    tree["elbow_flexor"]["board"] = "left"


def number_out_of_range(tree: dict[str, Any]) -> None:
    tree["boards"] = {"left": {"kind": "pam_board", "number": 16}}
    tree["elbow_flexor"]["board"] = "left"


def numbered_twice(tree: dict[str, Any]) -> None:
    tree["boards"] = {"left": {"kind": "pam_board", "number": 0}}
    tree["elbow_flexor"]["board"] = "left"


def wrong_channel(tree: dict[str, Any]) -> None:
    on_vendor_nodes(tree)
    tree["elbow_flexor"]["channel"] = 0


def board_out_of_range(tree: dict[str, Any]) -> None:
    tree["elbow_flexor"]["board"] = 16


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (unknown_kind, "boards.left.kind = pam_bord: unknown kind of board; did you mean pam_b"),
        (no_section, "board left: boards has no section of this name (there are none)"),
        (unknown_key, "boards.left.baud: unknown key of a vendor node"),
        (unknown_pam_key, "boards.left.node: unknown key of a pam_board"),
        (number_out_of_range, "boards.left.number = 16: expected 0 to 15"),
        (numbered_twice, "board left already uses number 0"),
        (wrong_channel, "elbow_flexor: expected channel valve"),
        (board_out_of_range, "expected board 0 to 15 and channel 0 to 1"),
    ],
)
def test_what_only_a_kind_knows_is_refused_by_the_kind(
    change: Callable[[dict[str, Any]], None], expected: str, tmp_path: Path
) -> None:
    """The rig file loads, for tools that drive nothing; driver and simulation refuse it."""
    rig = load_rig(rig_file(tmp_path, change))
    for use in (RigWiring, SimulatedRig):
        with pytest.raises(RigError) as caught:
            use(rig)
        assert expected in str(caught.value)


def test_two_buses_may_use_the_same_identifiers(tmp_path: Path) -> None:
    """A frame belongs to the bus that brought it, and commands go to their own."""
    rig = load_rig(CONFIG / "two_joints.yaml")
    sections = {}
    for joint in rig.joints:
        section = sections[f"of_{joint.name}"] = {"kind": "pam_board", "number": 0}
        section["bus"] = joint.name
        board = f"of_{joint.name}"
        rig = rig.with_joint(replace(joint, encoder=replace(joint.encoder, board=board)))
        for channel, name in enumerate(joint.muscles):
            rig = rig.with_muscle(replace(rig.muscle(name), board=board, channel=channel))
    rig = replace(rig, boards=sections)
    lines = {joint.name: Line() for joint in rig.joints}
    driver = Driver(rig, lines, DriverSettings())
    first, second = (list(line.down) for line in lines.values())
    driver.vent(1.0)
    told = [{frame_id for frame_id, _ in line.down} for line in lines.values()]
    assert (first, second) == ([], [])
    assert told == [{0x80, 0x100}, {0x80, 0x100}]
    twins = {name: SimulatedRig(load_rig(CONFIG / "elbow.yaml")) for name in lines}
    now = 1.0
    for name, line in lines.items():
        twins[name].begin(now)
        if name == rig.joints[0].name:
            for tick in range(1, 200):
                frames = twins[name].advance(now + 0.001 * tick)
                line.up += [ReceivedFrame(*frame, 0.0) for frame in frames]
    driver.cycle(now + 0.2, 0.0)
    assert driver.missing_boards(now + 0.2) == [f"board of_{rig.joints[1].name}"]
    with pytest.raises(RigError, match="no bus is called"):
        Driver(rig, Line(), DriverSettings())


def test_one_identifier_for_two_boards_of_a_bus_is_refused(tmp_path: Path) -> None:
    def clash(tree: dict[str, Any]) -> None:
        on_vendor_nodes(tree)
        tree["boards"] = {**BOARDS, "right": dict(BOARDS["left"])}

    with pytest.raises(
        RigError, match=r"board right: board left uses identifier 0x18FE0031 as well"
    ):
        RigWiring(load_rig(rig_file(tmp_path, clash))).make_boards()


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        ("pam_board = support.vendor_board:VendorKind", "two kinds of board are called pam_board"),
        ("torn = support.no_such_module:Kind", "torn .* cannot be loaded: No module named"),
    ],
)
def test_an_installed_kind_that_cannot_be_used_is_named(
    entry: str, expected: str, tmp_path: Path
) -> None:
    metadata = tmp_path / "other_boards-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: other-boards\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(f"[{register.GROUP}]\n{entry}\n")
    sys.path.insert(0, str(tmp_path))
    try:
        forget()
        with pytest.raises(PamError, match=expected):
            register.board_kinds()
    finally:
        sys.path.remove(str(tmp_path))
        forget()
