"""Wrong sections of mapped devices: each is refused in one line that says what was expected."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pam_driver.boards.wiring import RigWiring
from pam_model.errors import RigError
from pam_model.rig import Rig, load_rig
from support.mapped_device import ELBOW_VENDOR, nested, problems_after, vendor_dbc

Change = Callable[[dict[str, Any]], None]


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


BOARD = "boards.manifold"
A = "setpoints/port_a"
MISTAKES: dict[str, tuple[Change, str]] = {
    "no DBC file": (drop("dbc"), f"{BOARD}.dbc: missing; the path of the device's DBC file"),
    "DBC file not there": (
        put("dbc", "/nowhere/valves.dbc"),
        f"{BOARD}.dbc = /nowhere/valves.dbc: cannot be read: No such file or directory",
    ),
    "not a DBC file": (put("dbc", str(ELBOW_VENDOR)), "elbow_vendor_dbc.yaml: not a valid DBC"),
    "another board's DBC file": (
        put("dbc", str(ELBOW_VENDOR.with_name("pam_board.dbc"))),
        f"{BOARD}.setpoints.port_a.signal = PVM_Demand.P_Dem_A: pam_board.dbc: the DBC file has no "
        "message PVM_Demand; it has BoardCommand",
    ),
    "offset that is no number": (
        put("identifier_offset", "three"),
        f"{BOARD}.identifier_offset = 'three': must be a number",
    ),
    "offset out of 29 bits": (
        put("identifier_offset", 0x1FFF_FFFF),
        "identifier 0x18FF1010 of PVM_Demand plus identifier_offset is 0x38FF100F",
    ),
    "unknown key": (put("setpoint", {}), f"{BOARD}.setpoint: unknown key; did you mean setpoints?"),
    "unknown key of a signal": (
        put(f"{A}/units", "bar"),
        f"{BOARD}.setpoints.port_a.units: unknown key; did you mean unit?",
    ),
    "raw value that is not a number": (
        put("enables/mode/enabled", float("nan")),
        f"{BOARD}.enables.mode.enabled: must be a finite number, or a label of Op_Mode",
    ),
    "raw value beyond all numbers": (
        put("enables/mode/enabled", float("inf")),
        f"{BOARD}.enables.mode.enabled: must be a finite number, or a label of Op_Mode",
    ),
    "signal missing": (
        drop(f"{A}/signal"),
        f"{BOARD}.setpoints.port_a.signal: missing; MESSAGE.SIGNAL of the DBC file is needed",
    ),
    "signal without message": (
        put(f"{A}/signal", "P_Dem_A"),
        f"{BOARD}.setpoints.port_a.signal = 'P_Dem_A': must be MESSAGE.SIGNAL of the DBC file",
    ),
    "message misspelt": (
        put("angles/shaft/signal", "PVM_Join.Shaft_Ang"),
        f"{BOARD}.angles.shaft.signal = PVM_Join.Shaft_Ang: pneumatic_manifold.dbc: the DBC file "
        "has no message PVM_Join; did you mean PVM_Joint?",
    ),
    "signal misspelt": (
        put("pressures/port_b/signal", "PVM_Actual.P_Act_C"),
        f"{BOARD}.pressures.port_b.signal = PVM_Actual.P_Act_C: pneumatic_manifold.dbc: message "
        "PVM_Actual has no signal P_Act_C; did you mean P_Act_",
    ),
    "signal mapped twice": (
        put("pressures/port_b/signal", "PVM_Actual.P_Act_A"),
        f"{BOARD}.pressures.port_b.signal = PVM_Actual.P_Act_A: {BOARD}.pressures.port_a.signal "
        "maps this signal as well",
    ),
    "unknown unit": (
        put(f"{A}/unit", "barr"),
        f"{BOARD}.setpoints.port_a.unit = barr: unknown unit; did you mean bar?",
    ),
    "unit of nothing known": (
        put(f"{A}/unit", "torr"),
        f"{BOARD}.setpoints.port_a.unit = torr: unknown unit; known: Pa, hPa, mbar, kPa, bar",
    ),
    "unit that the DBC file contradicts": (
        put(f"{A}/unit", "kPa"),
        f"{BOARD}.setpoints.port_a.unit = kPa: the DBC file says bar for PVM_Demand.P_Dem_A",
    ),
    "unit of another quantity": (
        put("pressures/port_a/signal", "PVM_Joint.Shaft_Ang"),
        f"{BOARD}.pressures.port_a.unit = bar: the DBC file says deg for PVM_Joint.Shaft_Ang",
    ),
    "angle in a unit of pressure": (
        put("angles/shaft", {"signal": "PVM_Status.Power_On_Time", "unit": "s"}),
        f"{BOARD}.angles.shaft.unit = s: PVM_Status.Power_On_Time must be an angle",
    ),
    "no unit anywhere": (
        put("angles/shaft", {"signal": "PVM_Status.Cnt_Ack"}),
        f"{BOARD}.angles.shaft.unit: missing, and PVM_Status.Cnt_Ack has no unit in the DBC file",
    ),
    "volts without a scale": (
        put("angles/shaft", {"signal": "PVM_Status.Cnt_Ack", "unit": "V"}),
        f"{BOARD}.angles.shaft.unit = V: a scale is needed, two points that say what V means",
    ),
    "scale of another unit": (
        put(
            "angles/shaft",
            {
                "signal": "PVM_Status.Cnt_Ack",
                "unit": "V",
                "scale": {"mA": [4.0, 20.0], "deg": [0.0, 90.0]},
            },
        ),
        f"{BOARD}.angles.shaft.scale: must have the two keys V and a unit of angle",
    ),
    "scale to the wrong quantity": (
        put(
            "angles/shaft",
            {
                "signal": "PVM_Status.Cnt_Ack",
                "unit": "V",
                "scale": {"V": [0.0, 10.0], "bar": [0.0, 6.0]},
            },
        ),
        f"{BOARD}.angles.shaft.scale: bar is no unit of angle",
    ),
    "scale of one point": (
        put(
            "angles/shaft",
            {
                "signal": "PVM_Status.Cnt_Ack",
                "unit": "V",
                "scale": {"V": [0.0], "deg": [0.0, 90.0]},
            },
        ),
        f"{BOARD}.angles.shaft.scale: V must be two numbers, as [0.0, 10.0]",
    ),
    "scale that is flat": (
        put(
            "angles/shaft",
            {
                "signal": "PVM_Status.Cnt_Ack",
                "unit": "V",
                "scale": {"V": [1.0, 1.0], "deg": [0.0, 90.0]},
            },
        ),
        f"{BOARD}.angles.shaft.scale: the two points must differ in both units",
    ),
    "gauge or absolute not said": (
        drop("pressures/port_a/reference"),
        f"{BOARD}.pressures.port_a.reference: missing; must be gauge or absolute",
    ),
    "reference misspelt": (
        put("pressures/port_a/reference", "abs"),
        f"{BOARD}.pressures.port_a.reference = 'abs'; must be gauge or absolute",
    ),
    "reference of an angle": (
        put("angles/shaft/reference", "gauge"),
        f"{BOARD}.angles.shaft.reference: only a pressure is gauge or absolute, and deg is none",
    ),
    "sign that is none": (
        put("angles/shaft/sign", -2),
        f"{BOARD}.angles.shaft.sign = -2: must be 1 or -1",
    ),
    "set point missing": (
        drop("setpoints/port_b"),
        f"{BOARD}.setpoints.port_b: missing; elbow_extensor is wired to this channel",
    ),
    "set point of nobody": (
        put("setpoints/port_c", {"signal": "PVM_Demand.Spare", "unit": "percent"}),
        f"{BOARD}.setpoints.port_c: no muscle of the rig is wired to this channel",
    ),
    "pressure missing": (
        drop("pressures/port_b"),
        f"{BOARD}.pressures.port_b: missing; elbow_extensor is wired to this channel",
    ),
    "angle missing": (
        drop("angles"),
        f"{BOARD}.angles.shaft: missing; elbow is wired to this channel",
    ),
    "value of a signal that is sent is not said": (
        drop("commands/PVM_Demand/fixed"),
        f"{BOARD}.commands.PVM_Demand.fixed.Spare: missing; pneumatic_manifold.dbc has no start "
        "value for PVM_Demand.Spare, so the rig file must say what is sent",
    ),
    "fixed value too large": (
        put("commands/PVM_Demand/fixed/Spare", 70000),
        f"{BOARD}.commands.PVM_Demand.fixed.Spare = 70000: Spare takes raw values from 0 to 65535",
    ),
    "fixed signal unknown": (
        put("commands/PVM_Demand/fixed/Spar", 0),
        f"{BOARD}.commands.PVM_Demand.fixed.Spar = 0: pneumatic_manifold.dbc: message PVM_Demand "
        "has no signal Spar; did you mean Spare?",
    ),
    "enable label unknown": (
        put("enables/mode/enabled", "running"),
        f"{BOARD}.enables.mode.enabled: Op_Mode has no value called running; did you mean run?",
    ),
    "enable that disables": (
        put("enables/mode/disabled", "run"),
        f"{BOARD}.enables.mode.enabled = run: must differ from disabled",
    ),
    "counter unknown": (
        put("commands/PVM_Demand/counter", "Rolling"),
        f"{BOARD}.commands.PVM_Demand.counter = Rolling: pneumatic_manifold.dbc: message "
        "PVM_Demand has no signal Rolling",
    ),
    "counter that is a float": (
        put("answers/PVM_Joint/counter", "Shaft_Ang"),
        f"{BOARD}.answers.PVM_Joint.counter = PVM_Joint.Shaft_Ang: {BOARD}.angles.shaft.signal",
    ),
    "checksum algorithm unknown": (
        put("commands/PVM_Demand/checksum/algorithm", "crc32"),
        f"{BOARD}.commands.PVM_Demand.checksum.algorithm = crc32: unknown checksum; known: crc8,",
    ),
    "checksum of two bytes in one": (
        put("commands/PVM_Demand/checksum/algorithm", "crc16_ccitt"),
        f"{BOARD}.commands.PVM_Demand.checksum.signal = PVM_Demand.Chk: crc16_ccitt needs 2 whole "
        "bytes of the frame, this signal has 8 bits",
    ),
    "checksum prefix that is no byte": (
        put("commands/PVM_Demand/checksum/prefix", [300]),
        f"{BOARD}.commands.PVM_Demand.checksum.prefix = [300]: must be a list of bytes from 0 to",
    ),
    "period too long": (
        put("commands/PVM_Demand/period", 2.0),
        f"{BOARD}.commands.PVM_Demand.period = 2 s: must be from 0.001 to 0.05 s",
    ),
    "message both sent and received": (
        both(drop("commands/PVM_Demand/fixed"), put("echo/signal", "PVM_Demand.Spare")),
        f"{BOARD}: PVM_Demand is a command and an answer; a message has one sender",
    ),
    "state without the active value": (
        drop("state/active"),
        f"{BOARD}.state.active: missing; must be a list of values of Op_State",
    ),
    "state label unknown": (
        put("state/active", ["running"]),
        f"{BOARD}.state.active: Op_State has no value called running; did you mean run?",
    ),
    "invalid value that does not fit": (
        put("pressures/port_a/invalid", {"open": 70000}),
        f"{BOARD}.pressures.port_a.invalid.open = 70000: P_Act_A takes raw values 0 to 65535",
    ),
    "watchdog in milliseconds": (
        put("watchdog", 100.0),
        f"{BOARD}.watchdog = 100 s: must be from 0.005 to 10 s; looks like ms",
    ),
    "latch that is no yes or no": (
        put("latches", "yes"),
        f"{BOARD}.latches = 'yes': must be true or false",
    ),
    "latch that nothing clears": (
        drop("clear_faults"),
        f"{BOARD}.latches: clear_faults is missing, the message that clears the latch",
    ),
    "clear_faults of an unknown message": (
        put("clear_faults", {"PVM_Reset": {"Cmd": 1}}),
        f"{BOARD}.clear_faults.PVM_Reset: pneumatic_manifold.dbc: the DBC file has no message",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_wrong_section_is_refused_in_one_line(mistake: str) -> None:
    change, expected = MISTAKES[mistake]
    lines = problems_after(load_rig(ELBOW_VENDOR), change)
    print("\n".join(lines))
    assert any(expected in line for line in lines), lines
    assert all("\n" not in line and line.startswith("boards.manifold") for line in lines)
    assert len(lines) <= 4


def with_muscles(rig: Rig, **values: Any) -> Rig:
    """A rig with changed values in both muscles or their valves."""
    for muscle in rig.muscles:
        in_valve = {key: value for key, value in values.items() if hasattr(muscle.valve, key)}
        others = {key: value for key, value in values.items() if key not in in_valve}
        rig = rig.with_muscle(replace(muscle, valve=replace(muscle.valve, **in_valve), **others))
    return rig


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (
            lambda rig: with_muscles(rig, full_scale=1.2e6),
            "boards.manifold.setpoints.port_a.signal = PVM_Demand.P_Dem_A: takes 0 to 10 bar, but "
            "the set point of elbow_flexor at full scale (valve.full_scale = 1.2e+06 Pa gauge) is "
            "12 bar",
        ),
        (
            lambda rig: with_muscles(rig, kind="flow", full_scale=None),
            "boards.manifold.setpoints.port_a.unit = bar: PVM_Demand.P_Dem_A must be a share of "
            "full scale, or have a scale",
        ),
        (
            lambda rig: with_muscles(rig, max_pressure=1.8e6),
            "boards.manifold.pressures.port_a.signal = PVM_Actual.P_Act_A: shows -51325 to "
            "1.49868e+06 Pa gauge, but elbow_flexor needs 0 to max_pressure = 1.8e+06 Pa gauge",
        ),
        (
            lambda rig: rig.with_joint(replace(rig.joints[0], position_limits=(-6.2, 6.2))),
            "boards.manifold.angles.shaft.signal = PVM_Joint.Shaft_Ang: shows -6.06502 to 6.50135 "
            "rad, but position_limits of elbow are -6.2 to 6.2 rad",
        ),
    ],
)
def test_a_signal_that_cannot_carry_what_the_rig_needs_is_refused(
    change: Callable[[Rig], Rig], expected: str
) -> None:
    with pytest.raises(RigError) as caught:
        RigWiring(change(load_rig(ELBOW_VENDOR)))
    assert expected in str(caught.value)


def test_two_devices_with_the_same_identifiers_are_refused() -> None:
    rig = load_rig(ELBOW_VENDOR)
    section = rig.boards["manifold"]
    one_port = {
        **section,
        "setpoints": {"port_a": section["setpoints"]["port_a"]},
        "pressures": {"port_a": section["pressures"]["port_a"]},
    }
    fixed = {"Spare": 0, "P_Dem_B": 0.0}
    one_port["commands"] = {"PVM_Demand": {**section["commands"]["PVM_Demand"], "fixed": fixed}}
    other = {key: value for key, value in one_port.items() if key != "angles"}
    rig = rig.with_muscle(replace(rig.muscle("elbow_extensor"), board="second", channel="port_a"))
    rig = replace(rig, boards={"manifold": one_port, "second": other})
    with pytest.raises(
        RigError, match="board second: board manifold uses identifier 0x18FF1010 as"
    ):
        RigWiring(rig).make_boards()
    other["identifier_offset"] = 1
    RigWiring(rig).make_boards()


def paths_of(tree: Any, path: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Every key of a section, at any depth."""
    found = []
    for key, value in tree.items():
        found.append((*path, key))
        if isinstance(value, dict):
            found += paths_of(value, (*path, key))
    return found


JUNK = (None, 5, -1, 1e99, True, "", "x", "a.b", [], [1], ["x", 2.5], {}, {"a": {}}, {"signal": 3})


@pytest.mark.sampled("one value of each type", alike=lambda junk: type(junk).__name__)
@pytest.mark.parametrize("junk", JUNK, ids=repr)
def test_nonsense_anywhere_in_a_section_is_refused_or_accepted_but_never_a_crash(
    junk: object,
) -> None:
    rig = load_rig(ELBOW_VENDOR)
    section = nested(rig.boards["manifold"])
    for path in paths_of(section):
        if path[0] in {"kind", "bus"}:
            continue
        lines = problems_after(rig, put("/".join(path), junk))
        assert all(line.startswith("boards.manifold") and "\n" not in line for line in lines), path


@pytest.mark.parametrize(
    ("numbers", "told"),
    [
        ("(0,0) [0|6]", "the factor 0 and the offset 0"),
        ("(1e400,0) [0|6]", "the factor inf and the offset 0"),
        ("(0.001,0) [0|1e400]", "the range 0 to inf"),
    ],
)
def test_a_signal_without_usable_numbers_is_refused(
    numbers: str, told: str, tmp_path: Path
) -> None:
    text = vendor_dbc().read_text()
    before = "P_Dem_A : 7|16@0+ (0.0005,0) [0|10]"
    assert before in text
    path = tmp_path / "other.dbc"
    path.write_text(text.replace(before, f"P_Dem_A : 7|16@0+ {numbers}"))
    problems = problems_after(load_rig(ELBOW_VENDOR), put("dbc", str(path)))
    assert any(f"PVM_Demand.P_Dem_A has {told}" in line for line in problems), problems


@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        ("PVM_Joint: 5 ", "PVM_Joint: 99999999999 ",
         "message PVM_Joint has 99999999999 bytes, which no frame has"),
        ("P_Dem_A : 7|16@", "P_Dem_A : 7|4294967296@",
         "signal P_Dem_A has 4294967296 bits or begins there"),
        ("P_Dem_A : 7|16@", "P_Dem_A : 4294967296|16@",
         "signal P_Dem_A has 4294967296 bits or begins there"),
    ],
)  # fmt: skip
def test_an_absurd_length_in_a_dbc_file_is_refused_at_once(
    before: str, after: str, told: str, tmp_path: Path
) -> None:
    """The package that reads the file would be busy with it for minutes, at the driver's start."""
    text = vendor_dbc().read_text()
    assert before in text
    path = tmp_path / "other.dbc"
    path.write_text(text.replace(before, after))
    problems = problems_after(load_rig(ELBOW_VENDOR), put("dbc", str(path)))
    assert [line for line in problems if "other.dbc: line " in line and told in line], problems
