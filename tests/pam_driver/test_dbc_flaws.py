"""One flaw in a good DBC file, of every sort and at every place, is told with its line.

Where the robot depends on it, it is an error; everywhere else the device can be used.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Final

import pytest

from pam_driver.boards.mapped.device import MappedDevice
from pam_driver.boards.mapped.reader import MappedDeviceReader
from pam_driver.boards.mapped.signal_layout import SignalLayout
from pam_driver.boards.protocol import WiredBoard
from pam_driver.boards.wiring import RigWiring
from pam_model.rig import load_rig
from support.mapped_device import ELBOW_VENDOR, vendor_dbc

FOREIGN: Final = """
BO_ 700 Other_Device: 8 ECU
 SG_ Speed : 0|16@1+ (0.1,0) [0|6553.5] "rpm" PVM
 SG_ Mode : 16|8@1+ (1,0) [0|255] "" PVM
CM_ BO_ 700 "Nothing in the rig file is about it.";
VAL_ 700 Mode 0 "off" 1 "on" ;
SIG_VALTYPE_ 700 Speed : 0;
BA_ "GenMsgCycleTime" BO_ 700 10;
BO_TX_BU_ 700 : ECU;
"""
GOOD: Final = vendor_dbc().read_text(encoding="cp1252") + FOREIGN
Change = Callable[[str], str]
FLAWS: Final[dict[str, Change]] = {
    "cut in half": lambda line: line[: 2 * len(line) // 3],
    "a quote missing": lambda line: line.replace('"', "", 1),
    "a word for a number": lambda line: (
        line if line.startswith("CM_") else re.sub(r"(?<= )\d+", "many", line, count=1)
    ),
    "a stray sign": lambda line: f"{line} ?",
    "a line of text before": lambda line: f"of the valve, see the manual\n{line}",
    "brackets missing": lambda line: re.sub(r"[\[\]()]", "", line),
    "cut off after the name": lambda line: " ".join(line.split()[:3]),
}


@pytest.fixture(scope="module")
def manifold() -> WiredBoard:
    return RigWiring(load_rig(ELBOW_VENDOR)).boards["manifold"]


def read(wired: WiredBoard, path: Path, data: str | bytes) -> MappedDeviceReader:
    """The device of the rig with another DBC file."""
    path.write_bytes(data.encode("cp1252") if isinstance(data, str) else data)
    return MappedDeviceReader(replace(wired, settings={**wired.settings, "dbc": str(path)}))


def tables(reader: MappedDeviceReader) -> str:
    """All tables of a device, to compare."""
    return "" if reader.device is None else repr(plain(reader.device))


def plain(value: Any) -> Any:
    if isinstance(value, SignalLayout):
        return [plain(getattr(value, name)) for name in SignalLayout.__slots__]
    if is_dataclass(value):
        return [plain(getattr(value, one.name)) for one in fields(value)]
    if isinstance(value, Mapping):
        return [(key, plain(one)) for key, one in value.items()]
    if isinstance(value, tuple):
        return [plain(one) for one in value]
    return value


@pytest.fixture(scope="module")
def needed(manifold: WiredBoard, tmp_path_factory: pytest.TempPathFactory) -> frozenset[int]:
    """The lines without which the device is another one, or cannot be used."""
    path = tmp_path_factory.mktemp("needed") / "dev.dbc"
    lines = GOOD.split("\n")
    good = tables(read(manifold, path, GOOD))
    found = set()
    for number, line in enumerate(lines):
        if line.strip() and not line.startswith("BA_"):  # a period follows from the rig file
            text = "\n".join([*lines[:number], "", *lines[number + 1 :]])
            if tables(read(manifold, path, text)) != good:
                found.add(number)
    kinds = {lines[number].split()[0] for number in found}
    assert kinds == {"BO_", "SG_", "VAL_", "SIG_VALTYPE_"}
    return frozenset(found)


@pytest.mark.parametrize("flaw", FLAWS)
def test_a_flaw_is_told_with_its_line_where_it_matters_and_survived_elsewhere(
    flaw: str, manifold: WiredBoard, needed: frozenset[int], tmp_path: Path
) -> None:
    lines = GOOD.split("\n")
    path = tmp_path / "dev.dbc"
    told = survived = 0
    for number, line in enumerate(lines):
        if not re.match(r"\s*[A-Z_]+_ [\w\"]", line):
            continue
        changed = FLAWS[flaw](line)
        if changed == line:
            continue
        reader = read(manifold, path, "\n".join([*lines[:number], changed, *lines[number + 1 :]]))
        place = f"line {number + 1}: "
        shown = (changed, reader.problems, reader.doubts)
        assert any(place in one for one in [*reader.problems, *reader.doubts]), shown
        if number in needed and "before" not in flaw:
            assert any(place in one for one in reader.problems), shown
            told += 1
        elif "before" not in flaw:
            assert not reader.problems, shown
            survived += 1
    assert told > 5 or "before" in flaw
    assert survived > 3 or flaw in {"brackets missing", "a line of text before"}


SPELLINGS: Final = (
    *("BAR", "Bar", "bar ", " bar", "[bar]", "(bar)", "bar.", "bars"),
    *("bar abs", "bar(a)", "bar (abs)", "bara", "BAR_A", "bar absolute"),
)
NUMBERS: Final = {
    "factor of 1e-320": "(1e-320,0) [0|10]",
    "factor of 400 digits": f"({'9' * 400},0) [0|10]",
    "factor of 0": "(0,0) [0|10]",
    "factor of 1e300": "(1e300,0) [0|10]",
    "factor of 1e-300": "(1e-300,0) [0|10]",
    "offset of 1e308": "(0.0005,1e308) [0|10]",
    "offset of 5000 digits": f"(0.0005,{'9' * 5000}) [0|10]",
    "range of 1e308": "(0.0005,0) [-1e308|1e308]",
    "range of 400 digits": f"(0.0005,0) [0|{'9' * 400}]",
    "range that is empty": "(0.0005,0.5) [7|7]",
    "range of nothing": "(0.0005,0.5) [0|0]",
}


@pytest.mark.parametrize("numbers", NUMBERS)
def test_every_number_that_follows_from_a_signal_is_finite_or_refused_with_its_line(
    numbers: str, manifold: WiredBoard, tmp_path: Path
) -> None:
    for number, line in enumerate(GOOD.split("\n")):
        if "SG_ " not in line or not line.startswith(" "):
            continue
        changed = re.sub(r"\(.*?\) \[.*?\]", lambda _: NUMBERS[numbers], line)
        text = GOOD.replace(line, changed, 1)
        reader = read(manifold, tmp_path / "dev.dbc", text)
        shown = (line, reader.problems)
        if reader.problems:
            line_told = f"dev.dbc, line {number + 1}: "
            told = [
                one
                for one in reader.problems
                if line_told in one
                or "raw values" in one
                or "takes" in one
                or "must be" in one
                or "shows" in one
            ]
            assert told, shown
            assert all("nan" not in one for one in reader.problems), shown
        else:
            assert all(map(math.isfinite, numbers_of(reader.device))), shown


def numbers_of(device: MappedDevice | None) -> list[float]:
    """Every number in the tables of a device."""

    def walk(value: Any) -> list[float]:
        if isinstance(value, list | tuple):
            return [number for one in value for number in walk(one)]
        return [value] if isinstance(value, float) else []

    assert device is not None
    return walk(plain(device))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "gbk", "utf-16"])
def test_every_usual_encoding_is_read(encoding: str, manifold: WiredBoard, tmp_path: Path) -> None:
    comment = "Überdruck" if encoding == "cp1252" else "压力 at port A"
    text = GOOD.replace('"deg"', '"°"').replace("Pressure at port A", comment)
    good = read(manifold, tmp_path / "good.dbc", GOOD)
    reader = read(manifold, tmp_path / "dev.dbc", text.encode(encoding))
    assert not reader.problems
    assert not reader.doubts
    assert tables(reader) == tables(good)


def test_a_file_of_two_encodings_is_read(manifold: WiredBoard, tmp_path: Path) -> None:
    text = GOOD.replace('"deg"', '"°"').encode("cp1252")
    text = text.replace(b"Pressure at port A", "压力".encode())
    assert not read(manifold, tmp_path / "dev.dbc", text).problems


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_a_unit_is_understood_as_makers_spell_it(
    spelling: str, manifold: WiredBoard, tmp_path: Path
) -> None:
    text = GOOD.replace('[0.5|16] "bar"', f'[0.5|16] "{spelling}"')
    reader = read(manifold, tmp_path / "dev.dbc", text)
    assert not reader.problems
    assert not reader.doubts
    assert tables(reader) == tables(read(manifold, tmp_path / "good.dbc", GOOD))


@pytest.mark.parametrize("spelling", ["Druck", "bar*10", "Mbar", "bar/s"])
def test_a_spelling_that_nobody_knows_is_a_caution_where_the_rig_file_says_the_unit(
    spelling: str, manifold: WiredBoard, tmp_path: Path
) -> None:
    text = GOOD.replace('[0.5|16] "bar"', f'[0.5|16] "{spelling}"')
    reader = read(manifold, tmp_path / "dev.dbc", text)
    assert not reader.problems
    assert any(f"the DBC file says {spelling!r} for PVM_Actual.P_Act_A" in d for d in reader.doubts)
    assert tables(reader) == tables(read(manifold, tmp_path / "good.dbc", GOOD))


@pytest.mark.parametrize(
    "spelling",
    [
        *("kPa", "KPA", "kN/m²", "kilopascal", "N/mm2", "Megapascal", "N/m2", "psig"),
        *("deg", "°C", "rpm", "mA"),
    ],
)
def test_a_known_unit_that_contradicts_the_rig_file_is_refused(
    spelling: str, manifold: WiredBoard, tmp_path: Path
) -> None:
    text = GOOD.replace('[0.5|16] "bar"', f'[0.5|16] "{spelling}"')
    reader = read(manifold, tmp_path / "dev.dbc", text)
    assert any(
        f"unit = bar: the DBC file says {spelling}" in p.replace("'", "") for p in reader.problems
    )


def test_a_spelling_that_contradicts_the_reference_is_a_caution(
    manifold: WiredBoard, tmp_path: Path
) -> None:
    text = GOOD.replace('[0.5|16] "bar"', '[0.5|16] "barg"')
    reader = read(manifold, tmp_path / "dev.dbc", text)
    assert not reader.problems
    assert any("reference = absolute: the DBC file says barg" in doubt for doubt in reader.doubts)


def test_signals_that_nobody_uses_may_overlap(manifold: WiredBoard, tmp_path: Path) -> None:
    text = GOOD.replace(" SG_ P_Sup :", ' SG_ Old : 7|8@0+ (1,0) [0|0] "" ECU\n SG_ P_Sup :')
    settings = {key: value for key, value in manifold.settings.items() if key != "supply"}
    wired = replace(manifold, settings=settings)
    assert not read(wired, tmp_path / "dev.dbc", text.replace("Old : 7|8", "Old : 39|8")).problems
    lines = read(wired, tmp_path / "dev.dbc", text.replace("BO_ 700", "BO_ 701")).problems
    assert not lines
    text = GOOD.replace("P_Act_B : 23|16", "P_Act_B : 15|16")
    (line,) = read(wired, tmp_path / "dev.dbc", text).problems
    assert "are overlapping in message PVM_Actual" in line
    assert "dev.dbc, line " in line


LABELLED: Final = GOOD.replace('P_Act_A 65535 "sensor_open"', 'P_Act_A 1026 "ambient"')


def test_a_label_at_a_value_that_is_reached_is_a_caution(
    manifold: WiredBoard, tmp_path: Path
) -> None:
    reader = read(manifold, tmp_path / "dev.dbc", LABELLED)
    (doubt,) = reader.doubts
    assert doubt.startswith(
        "boards.manifold.pressures.port_a.valid: P_Act_A has the label 'ambient'"
    )
    assert invalid_of(reader) == {1026: "ambient", 65534: "sensor_short"}


def test_a_label_under_valid_is_a_measurement(manifold: WiredBoard, tmp_path: Path) -> None:
    reader = with_valid(manifold, ["ambient"], tmp_path)
    assert not reader.problems
    assert not reader.doubts
    assert invalid_of(reader) == {65534: "sensor_short"}


@pytest.mark.parametrize(
    ("valid", "told"),
    [
        (["ambien"], "valid: P_Act_A has no value called ambien; did you mean ambient?"),
        ("ambient", "valid = 'ambient': must be a list of labels of P_Act_A"),
    ],
)
def test_a_wrong_label_under_valid_is_refused(
    valid: object, told: str, manifold: WiredBoard, tmp_path: Path
) -> None:
    (line,) = with_valid(manifold, valid, tmp_path).problems
    assert told in line


def with_valid(wired: WiredBoard, valid: object, folder: Path) -> MappedDeviceReader:
    """The device with labels that are measurements."""
    pressures = wired.settings["pressures"]
    changed = {**pressures, "port_a": {**pressures["port_a"], "valid": valid}}
    wired = replace(wired, settings={**wired.settings, "pressures": changed})
    return read(wired, folder / "dev.dbc", LABELLED)


def invalid_of(reader: MappedDeviceReader) -> dict[int, str]:
    """The raw values of the first pressure that are no measurement."""
    assert reader.device is not None
    return dict(reader.device.answers[0].inputs[0].invalid)


def test_a_range_that_ends_at_rest_is_a_caution(manifold: WiredBoard, tmp_path: Path) -> None:
    text = GOOD.replace("(0.0005,0.5) [0.5|16]", "(0.0005,0.5) [1.013|16]", 1)
    (doubt,) = read(manifold, tmp_path / "dev.dbc", text).doubts
    assert "P_Act_A: its range in dev.dbc, line 24 begins at -25 Pa gauge" in doubt


ODD: Final = {
    "range exchanged": ("(0.0005,0.5) [0.5|16]", "(0.0005,0.5) [16|0.5]", "are exchanged"),
    "label below": ('P_Act_A 65535 "s', 'P_Act_A -1 "s', "at raw -1, which its 16 bits never show"),
    "label above": ('P_Act_A 65535 "s', 'P_Act_A 65536 "s', "at raw 65536, which its 16 bits"),
    "counts": ("(0.0005,0.5) [0.5|16]", "(1,0) [0|65535]", "one step of its raw value is 100000"),
    "no float": (
        "SIG_VALTYPE_ 2566853136 Shaft_Ang : 1;",
        "",
        "one step of its raw value is 0.017",
    ),
}


@pytest.mark.parametrize("odd", ODD)
def test_odd_numbers_of_a_measurement_are_a_caution(
    odd: str, manifold: WiredBoard, tmp_path: Path
) -> None:
    written, instead, told = ODD[odd]
    assert written in GOOD
    reader = read(manifold, tmp_path / "dev.dbc", GOOD.replace(written, instead, 1))
    assert not reader.problems
    assert any(told in doubt for doubt in reader.doubts), reader.doubts


@pytest.mark.parametrize(
    ("kind", "told"),
    [
        ("2", "signal 'Shaft_Ang' is a float of 64 bits, but has 32 bits in line "),
        ("3", "the type of signal 'Shaft_Ang' is '3'; expected 0, 1 or 2"),
    ],
)
def test_a_type_that_contradicts_the_length_of_its_signal_is_told_with_its_line(
    kind: str, told: str, manifold: WiredBoard, tmp_path: Path
) -> None:
    written = "SIG_VALTYPE_ 2566853136 Shaft_Ang : 1;"
    assert written in GOOD
    line = GOOD[: GOOD.index(written)].count("\n") + 1
    reader = read(manifold, tmp_path / "dev.dbc", GOOD.replace(written, f"{written[:-2]}{kind};"))
    problems = "\n".join(map(str, reader.problems))
    assert f"line {line}: {told}" in problems
    other = GOOD.replace("SIG_VALTYPE_ 700 Speed : 0;", f"SIG_VALTYPE_ 700 Speed : {kind};")
    assert not read(manifold, tmp_path / "dev.dbc", other).problems, "nobody uses it"


def test_an_identifier_of_two_messages_or_without_its_flag_is_told_with_its_line(
    manifold: WiredBoard, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Lost was the second message, and cantools wrote lines of its own."""
    twice = GOOD.replace("BO_ 2566853136 PVM_Joint", "BO_ 2566852880 PVM_Joint", 1)
    problems = read(manifold, tmp_path / "dev.dbc", twice).problems
    assert any(
        "identifier 2566852880 is that of message 'PVM_Actual' in line" in p for p in problems
    )
    bare = GOOD.replace("2566852624", str(2566852624 - (1 << 31)))
    problems = read(manifold, tmp_path / "dev.dbc", bare).problems
    assert any("line 15: identifier 419368976 has more than 11 bits" in p for p in problems)
    assert any("as 2566852624" in p for p in problems)
    same = GOOD.replace("PVM_Joint: 5", "PVM_Actual: 5")
    assert read(manifold, tmp_path / "dev.dbc", same).problems
    assert not caplog.records


def test_a_label_that_is_looked_for_where_there_are_none_is_told_so(
    manifold: WiredBoard, tmp_path: Path
) -> None:
    text = GOOD.replace('VAL_ 2566852624 Op_Mode 0 "off" 1 "run" 2 "reset" ;', "")
    problems = read(manifold, tmp_path / "dev.dbc", text).problems
    assert any("Op_Mode has no value called run; it has none" in p for p in problems)
