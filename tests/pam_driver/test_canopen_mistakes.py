"""Wrong sections of CANopen devices: each is refused in one line that says what was expected."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import pytest

from pam_driver.boards.canopen.dictionary import profile_path
from pam_driver.boards.wiring import RigWiring
from pam_model.errors import RigError
from pam_model.rig import Rig, load_rig
from support.canopen_device import ELBOW_CANOPEN, ELBOW_REGULATOR
from support.mapped_device import nested

Change = Callable[[dict[str, Any]], None]


def problems_after(path: Path, board: str, change: Change) -> list[str]:
    """What is wrong with a rig after a change of one board's section."""
    rig = load_rig(path)
    sections = nested(rig.boards)
    change(sections[board])
    try:
        RigWiring(replace(rig, boards=sections)).make_boards()
    except RigError as error:
        return str(error).splitlines()
    return []


def put(path: str, value: object) -> Change:
    """Set a key of the section; `path` is separated by slashes."""

    def change(section: dict[str, Any]) -> None:
        *steps, last = path.split("/")
        for step in steps:
            section = section.setdefault(step, {})
        section[last] = value

    return change


def drop(path: str) -> Change:
    """Remove a key of the section."""

    def change(section: dict[str, Any]) -> None:
        *steps, last = path.split("/")
        for step in steps:
            section = section[step]
        del section[last]

    return change


def both(*changes: Change) -> Change:
    """One change after the other."""

    def change(section: dict[str, Any]) -> None:
        for one in changes:
            one(section)

    return change


def eds(text: Callable[[str], str], profile: str = "cia401_analogue") -> Change:
    """A changed copy of a profile as the device's own EDS file."""

    def change(section: dict[str, Any]) -> None:
        path = Path(FOLDER[0]) / "own.eds"
        path.write_text(text(profile_path(profile).read_text()))
        section.pop("profile")
        section["eds"] = str(path)

    return change


FOLDER: Final = [""]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path) -> None:
    FOLDER[0] = str(tmp_path)


OUT = "boards.outputs"
FLEX = "setpoints/flexor"
MISTAKES: dict[str, tuple[str, Change, str]] = {
    "no node number": ("outputs", drop("node"), f"{OUT}.node: missing; must be a node number"),
    "node number out of range": (
        "outputs",
        put("node", 128),
        f"{OUT}.node = 128; must be a node number from 1 to 127",
    ),
    "node number twice": (
        "encoder",
        put("node", 6),
        "boards.encoder.node = 6: boards.flexor_pressure on the same bus has this node number",
    ),
    "neither EDS file nor profile": (
        "outputs",
        drop("profile"),
        f"{OUT}.eds: missing; either the EDS file of the device or a profile is needed (cia401_",
    ),
    "EDS file and profile": (
        "outputs",
        put("eds", "x.eds"),
        f"{OUT}.eds: profile is given as well; either the EDS file of the device or a profile",
    ),
    "profile unknown": (
        "outputs",
        put("profile", "cia402"),
        f"{OUT}.profile = 'cia402': unknown profile; known: cia401_analogue, cia404_pressure",
    ),
    "EDS file not there": (
        "outputs",
        both(drop("profile"), put("eds", "/nowhere/io.eds")),
        f"{OUT}.eds = /nowhere/io.eds: cannot be read: No such file or directory",
    ),
    "not an EDS file": (
        "outputs",
        both(drop("profile"), put("eds", str(ELBOW_CANOPEN))),
        "elbow_canopen.yaml: not a valid EDS file: ",
    ),
    "EDS file without an object": (
        "outputs",
        eds(lambda text: text[: text.index("[1000]")]),
        "own.eds: not a valid EDS file: it describes no object, as [1000] would",
    ),
    "EDS file of another device": (
        "outputs",
        put("profile", "cia406_encoder"),
        f"{OUT}.setpoints.flexor.object = 0x6411:1: cia406_encoder.eds has no such object; for "
        "PDOs it has 0x6004:0",
    ),
    "object missing": (
        "outputs",
        drop(f"{FLEX}/object"),
        f'{OUT}.setpoints.flexor.object: missing; must be index and sub-index, as "0x6411:1"',
    ),
    "object that is none": (
        "outputs",
        put(f"{FLEX}/object", "output 1"),
        f"{OUT}.setpoints.flexor.object = 'output 1'; must be index and sub-index",
    ),
    "sub-index that is not there": (
        "outputs",
        put(f"{FLEX}/object", "0x6411:9"),
        f"{OUT}.setpoints.flexor.object = 0x6411:9: cia401_analogue.eds has no such object; 0x6411 "
        "has the sub-indices 0, 1, 2, 3",
    ),
    "object that no PDO carries": (
        "outputs",
        put(f"{FLEX}/object", "0x6444:1"),
        f"{OUT}.setpoints.flexor.object = 0x6444:1: cia401_analogue.eds says that it cannot be "
        "mapped to a PDO",
    ),
    "set point that is an input": (
        "outputs",
        put(f"{FLEX}/object", "0x6401:1"),
        f"{OUT}.setpoints.flexor.object = 0x6401:1: cia401_analogue.eds says that it cannot be "
        "written (ro)",
    ),
    "object used twice": (
        "outputs",
        put("setpoints/extensor/object", "0x6411:1"),
        f"{OUT}.setpoints.extensor.object = 0x6411:1: {OUT}.setpoints.flexor.object uses this",
    ),
    "unit that the EDS file contradicts": (
        "outputs",
        put(f"{FLEX}/unit", "mA"),
        f"{OUT}.setpoints.flexor.unit = mA: the file cia401_analogue.eds says V for 0x6411:1",
    ),
    "volts without a scale": (
        "outputs",
        drop(f"{FLEX}/scale"),
        f"{OUT}.setpoints.flexor.unit = V: a scale is needed, two points that say what V means",
    ),
    "unit missing": (
        "flexor_pressure",
        drop("pressures/port/unit"),
        "boards.flexor_pressure.pressures.port.unit: missing, and 0x6130:1 has no unit in the file "
        "cia404_pressure.eds; known: Pa, hPa",
    ),
    "unit unknown": (
        "flexor_pressure",
        put("pressures/port/unit", "barr"),
        "boards.flexor_pressure.pressures.port.unit = barr: unknown unit; did you mean bar?",
    ),
    "gauge or absolute not said": (
        "flexor_pressure",
        drop("pressures/port/reference"),
        "boards.flexor_pressure.pressures.port.reference: missing; must be gauge or absolute",
    ),
    "counts of one point": (
        "encoder",
        put("angles/shaft/counts", {"raw": [0], "rev": [0.0]}),
        "boards.encoder.angles.shaft.counts = ",
    ),
    "counts that are flat": (
        "encoder",
        put("angles/shaft/counts", {"raw": [5, 5], "rev": [0.0, 1.0]}),
        "boards.encoder.angles.shaft.counts: the two points must differ in both",
    ),
    "counts of an unknown unit": (
        "encoder",
        put("angles/shaft/counts", {"raw": [0, 65536], "turn_s": [0.0, 1.0]}),
        "boards.encoder.angles.shaft.counts.turn_s: unknown unit; known: ",
    ),
    "counts too coarse for the joint": (
        "extensor_pressure",
        put("pressures/port/counts", {"raw": [0, 2000000000], "bar": [0.0, 1.0]}),
        "boards.extensor_pressure.pressures.port.object = 0x9130:1: shows -107374 to 107374 Pa "
        "gauge, but elbow_extensor needs 0 to max_pressure = 600000 Pa gauge",
    ),
    "set point above the object's range": (
        "outputs",
        put(f"{FLEX}/scale", {"V": [0.0, 10.0], "bar": [0.0, 5.0]}),
        f"{OUT}.setpoints.flexor.object = 0x6411:1: takes raw values from -32768 to 32767, but the "
        "set point of elbow_flexor at full scale (valve.full_scale = 600000 Pa gauge) is 39320.4",
    ),
    "set point missing": (
        "outputs",
        drop("setpoints/extensor"),
        f"{OUT}.setpoints.extensor: missing; elbow_extensor is wired to this channel",
    ),
    "set point of nobody": (
        "outputs",
        put("setpoints/third", {"object": "0x6411:3"}),
        f"{OUT}.setpoints.third: no muscle of the rig is wired to this channel",
    ),
    "unknown key": ("outputs", put("heartbeat", 0.1), f"{OUT}.heartbeat: unknown key; did you"),
    "unknown key of a set point": (
        "outputs",
        put(f"{FLEX}/units", "V"),
        f"{OUT}.setpoints.flexor.units: unknown key; did you mean unit?",
    ),
    "watchdog in milliseconds": (
        "outputs",
        put("watchdog", 100.0),
        f"{OUT}.watchdog = 100 s: must be from 0.02 to 5 s; looks like ms",
    ),
    "watchdog of parts of a millisecond": (
        "outputs",
        put("watchdog", 0.0505),
        f"{OUT}.watchdog = 0.0505 s: must be whole milliseconds",
    ),
    "watchdog of a sensor": (
        "encoder",
        put("watchdog", 0.1),
        "boards.encoder.watchdog: the device has no set point, so there is nothing to guard",
    ),
    "watchdog that the device does not have": (
        "outputs",
        eds(lambda text: text.replace("[1016", "[1100")),
        f"{OUT}.watchdog = 0.1 s: own.eds has no 0x1016:1 (consumer heartbeat time), so the device "
        "cannot notice that the host is gone; watchdog: false accepts that",
    ),
    "outputs on errors not said": (
        "outputs",
        eds(lambda text: text.replace("[6443", "[2443")),
        f"{OUT}.outputs_off_on_error: missing; 0x6411:1 has no error mode (0x6443) in own.eds, so "
        "the manual must say whether the outputs go off",
    ),
    "error value of a valve that vents at another value than 0": (
        "outputs",
        put(f"{FLEX}/scale", {"V": [2.0, 10.0], "bar": [0.0, 6.0]}),
        f"{OUT}.setpoints.flexor.error_value: missing; the valve vents at the raw value 6553, and",
    ),
    "mapping neither written nor read": (
        "outputs",
        put("pdo_mapping", "fixed"),
        f"{OUT}.pdo_mapping = 'fixed': must be write or read",
    ),
    "fixed mapping with other set points": (
        "outputs",
        put("pdo_mapping", "read"),
        f"{OUT}.pdo_mapping = read: RPDO2 of cia401_analogue.eds also carries 0x6411:3, which",
    ),
    "fixed mapping without the object": (
        "extensor_pressure",
        put("pdo_mapping", "read"),
        "boards.extensor_pressure.pdo_mapping = read: no TPDO of cia404_pressure.eds carries "
        "0x9130:1; pdo_mapping: write adds it",
    ),
    "more PDOs than the device has": (
        "flexor_pressure",
        eds(lambda text: text.replace("[180", "[190").replace("[1A0", "[1B0"), "cia404_pressure"),
        "boards.flexor_pressure.pdo_mapping: 1 TPDOs are needed, but own.eds has 0 of them",
    ),
    "no event timer": (
        "encoder",
        eds(lambda text: text.replace("[1800sub5]", "[1800sub6]"), "cia406_encoder"),
        "boards.encoder.transmission = event: a TPDO of own.eds has no event timer (sub-index 5); "
        "transmission: sync is needed",
    ),
    "transmission unknown": (
        "encoder",
        put("transmission", "cyclic"),
        "boards.encoder.transmission = 'cyclic': must be event or sync",
    ),
    "vent of a sensor": (
        "encoder",
        put("vent", "stop"),
        "boards.encoder.vent = stop: only a device that measures nothing and has a set point can",
    ),
    "identity out of range": (
        "outputs",
        put("identity/vendor", -5),
        f"{OUT}.identity.vendor = -5: must be from 0 to 4.29497e+09",
    ),
    "identity with an unknown key": (
        "outputs",
        put("identity/maker", 5),
        f"{OUT}.identity.maker: unknown key",
    ),
    "configuration that is no list": (
        "outputs",
        put("configuration", "0x6423:0 = 1"),
        f"{OUT}.configuration = '0x6423:0 = 1': must be a list",
    ),
    "configuration without a value": (
        "outputs",
        put("configuration", ["0x6423:0"]),
        f"{OUT}.configuration: '0x6423:0' must be an object and its value",
    ),
    "configuration of an unknown object": (
        "outputs",
        put("configuration", ["0x2000:1 = 3"]),
        f"{OUT}.configuration: 0x2000:1: cia401_analogue.eds has no such object",
    ),
    "configuration that is too large": (
        "outputs",
        put("configuration", ["0x6443:3 = 256"]),
        f"{OUT}.configuration: 0x6443:3 = 256: takes values from 0 to 255",
    ),
    "configuration of what cannot be written": (
        "outputs",
        put("configuration", ["0x1018:1 = 1"]),
        f"{OUT}.configuration: 0x1018:1: cia401_analogue.eds says that it cannot be written",
    ),
    "host with the number of a device": (
        "outputs",
        put("host_node", 8),
        f"{OUT}.host_node = 8: is the node number of boards.encoder",
    ),
    "two hosts on a bus": (
        "encoder",
        put("host_node", 100),
        "boards.encoder.host_node = 100: boards.outputs on the same bus has 127; the driver is one",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_wrong_section_is_refused_in_one_line(mistake: str) -> None:
    board, change, expected = MISTAKES[mistake]
    lines = problems_after(ELBOW_CANOPEN, board, change)
    print("\n".join(lines))
    assert any(expected in line for line in lines), lines
    assert all(line.startswith("boards.") for line in lines)
    assert len(lines) <= 4


def test_a_regulator_whose_manual_says_nothing_has_no_watchdog() -> None:
    rig = load_rig(ELBOW_REGULATOR)
    sections = nested(rig.boards)
    sections["coupler"]["outputs_off_on_error"] = False
    boards = RigWiring(replace(rig, boards=sections)).make_boards()
    assert boards["coupler"].promises.watchdog is None
    assert RigWiring(rig).make_boards()["coupler"].promises.watchdog == 0.1


def paths_of(tree: Any, path: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Every key of a section, at any depth."""
    found = []
    for key, value in tree.items():
        found.append((*path, key))
        if isinstance(value, dict):
            found += paths_of(value, (*path, key))
    return found


JUNK = (None, 5, -1, 1e99, True, "", "x", "a:b", [], [1], ["x", 2.5], {}, {"a": {}}, {"raw": 3})


@pytest.mark.sampled("one value of each type", alike=lambda junk: type(junk).__name__)
@pytest.mark.parametrize("junk", JUNK, ids=repr)
def test_nonsense_anywhere_in_a_section_is_refused_or_accepted_but_never_a_crash(
    junk: object,
) -> None:
    rig = load_rig(ELBOW_CANOPEN)
    full = both(
        put("identity", {"vendor": 1}),
        put("configuration", ["0x6423:0 = 1"]),
        put("expect", ["0x6423:0 = 1"]),
        put("vent", "setpoint"),
        put("sdo_timeout", 0.1),
    )
    for board in ("outputs", "encoder"):
        section = nested(rig.boards)[board]
        full(section)
        for path in paths_of(section):
            if path[0] in {"kind", "bus"}:
                continue
            lines = problems_after(ELBOW_CANOPEN, board, both(full, put("/".join(path), junk)))
            assert all(line.startswith("board") and "\n" not in line for line in lines), path


def on_one_bus(rig: Rig, number: int) -> Rig:
    """The elbow on CANopen, but with the encoder on a valve board of this project."""
    joint = rig.joints[0]
    sections = nested(rig.boards)
    sections["arm"] = {"kind": "pam_board", "number": number}
    del sections["encoder"]
    assert joint.encoder is not None
    encoder = replace(joint.encoder, board="arm", channel=0)
    return replace(rig.with_joint(replace(joint, encoder=encoder)), boards=sections)


def test_a_board_whose_identifiers_canopen_uses_is_refused_with_both_names() -> None:
    rig = load_rig(ELBOW_CANOPEN)
    with pytest.raises(RigError) as caught:
        RigWiring(on_one_bus(rig, 6)).make_boards()
    lines = str(caught.value).splitlines()
    assert "board arm: board flexor_pressure uses identifier 0x186 as well" in lines
    assert "board arm: board flexor_pressure uses identifier 0x706 as well" in lines
    with pytest.raises(RigError) as caught:
        RigWiring(on_one_bus(rig, 0)).make_boards()
    lines = str(caught.value).splitlines()
    assert (
        "board arm: identifier 0x080 is SYNC of CANopen, and board extensor_pressure on the same "
        "bus is a CANopen device" in lines
    )
