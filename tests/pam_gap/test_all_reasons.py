"""A log or a map that is refused says everything that is wrong with it at once."""

from pathlib import Path

import numpy as np
import pytest

from pam_gap.diagnose_recordings import subjects_to_diagnose
from pam_gap.diagnosis_files import import_as_mounted
from pam_gap.import_log.import_log import import_log
from pam_gap.recordings.column_map import load_column_map
from pam_gap.recordings.import_recording import import_recording
from pam_gap.recordings.recording import RecordingError
from pam_model.errors import Reasons
from pam_model.rig import Rig
from support.lab_logs import ANGLE, FIRST, SECOND, TIME, written

FLEXOR, EXTENSOR = "pressure_states.elbow_flexor", "pressure_states.elbow_extensor"
POSITION, COMMAND = "joint_states.elbow.position", "valve_commands.elbow_flexor"


def said_by(error: pytest.ExceptionInfo[RecordingError], *parts: str) -> list[str]:
    """The lines of a refusal; each part must be in a line of its own."""
    lines = str(error.value).splitlines()
    assert len(lines) == len(parts), lines
    for line, part in zip(lines, parts, strict=True):
        assert part in line
    return lines


def test_all_mistakes_in_a_map_are_named_with_their_keys(tmp_path: Path) -> None:
    """The first of them was named, and the next after it was mended."""
    place = tmp_path / "map.yaml"
    place.write_text(
        "rates: 5\n"
        "time: {column: t, unit: minutes}\n"
        "channels:\n"
        f"  {FLEXOR}: {{column: p1, unit: torr, scale: x, factor: 2, absolute: 'yes'}}\n"
        f"  {EXTENSOR}: {{column: p2, sign: 3, offset: much}}\n"
        f"  {POSITION}: 7\n"
        f"  {COMMAND}: {{columns: {{a: one, b: two}}}}\n"
        "  pressure.flexor: p3\n"
    )
    with pytest.raises(RecordingError) as error:
        load_column_map(place)
    lines = said_by(
        error,
        "unknown key 'rates'",
        "'pressure.flexor': no channel",
        f"{FLEXOR}: unknown key 'factor'",
        f"{FLEXOR}: scale is 'x'",
        f"{FLEXOR}: unit 'torr'; expected one of Pa, bar",
        f"{FLEXOR}: absolute is 'yes'; expected true or false",
        f"{EXTENSOR}: expected a sign of 1 or -1",
        f"{EXTENSOR}: offset is 'much'; expected a number",
        f"{POSITION}: expected the name of a column",
        f"{COMMAND}: a is 'one'; expected a number",
        f"{COMMAND}: b is 'two'; expected a number",
        "time: unit 'minutes'; expected one of s, ms",
    )
    assert all(line.startswith(str(place)) for line in lines)


def test_missing_columns_and_those_of_text_are_named_together(tmp_path: Path) -> None:
    path = written(tmp_path / "log.csv", "t;p1;phi", TIME, FIRST, ["high"] * TIME.size)
    place = tmp_path / "map.yaml"
    place.write_text(f"channels: {{{FLEXOR}: p1, {EXTENSOR}: p2, {POSITION}: phi}}")
    with pytest.raises(RecordingError) as error:
        import_recording(path, column_map=load_column_map(place))
    said_by(
        error,
        "expected either `time` or `rate`",
        "no column 'p2'",
        "column 'phi' holds no number but text such as 'high' in row 1",
    )


def test_all_channels_in_other_units_are_named(rig: Rig, tmp_path: Path) -> None:
    """Each import named one channel; the unit of the other pressure came after it was mended."""
    names = f"time;{FLEXOR};{EXTENSOR};{POSITION};{COMMAND};supply_pressure"
    opening = 40.0 * np.sin(5.0 * TIME)
    supply = np.full(TIME.size, 7.0)
    path = written(
        tmp_path / "log.csv", names,
        TIME, 1e-5 * FIRST, 1e-5 * SECOND, np.degrees(ANGLE), opening, supply,
    )  # fmt: skip
    with pytest.raises(RecordingError) as error:
        subjects_to_diagnose(rig, [import_recording(path)])
    said = str(error.value)
    problems = said.splitlines()
    assert len(problems) == 5, said
    for channel, unit in (
        (FLEXOR, "bar (multiply by 100000)"),
        (EXTENSOR, "bar (multiply by 100000)"),
        ("supply_pressure", "bar (multiply by 100000)"),
        (COMMAND, "per cent (multiply by 0.01)"),
        (POSITION, "deg"),
    ):
        (line,) = (text for text in problems if f"{channel} " in text.partition(";")[0])
        assert unit in line
        assert "expected" in line


def test_without_pressures_other_units_are_still_named(rig: Rig, tmp_path: Path) -> None:
    names = f"time;{FLEXOR};{POSITION}"
    path = written(tmp_path / "log.csv", names, TIME, FIRST, np.degrees(ANGLE))
    with pytest.raises(RecordingError) as error:
        subjects_to_diagnose(rig, [import_recording(path)])
    said_by(error, "expected elbow_flexor and elbow_extensor", f"{POSITION} reaches")


def test_every_recording_that_cannot_be_read_is_named(rig: Rig, tmp_path: Path) -> None:
    one = written(tmp_path / "one.csv", "t;p1", TIME, FIRST)
    other = written(tmp_path / "other.csv", "time;p1", TIME, FIRST)
    with pytest.raises(RecordingError) as error:
        import_as_mounted([one, other, tmp_path / "third.csv"], rig)
    said_by(error, "one.csv: no column 'time'", "other.csv: no channel", "third.csv: no such")


def test_a_log_without_a_time_says_what_else_is_to_be_mended(rig: Rig, tmp_path: Path) -> None:
    path = written(tmp_path / "log.csv", "p1 [%FS];p2 [bar]", FIRST, SECOND)
    with pytest.raises(RecordingError) as error:
        import_log(path, rig, tmp_path / "out")
    said_by(error, "no column looks like a time", f"{FLEXOR}: 'p1 [%FS]' looks like it, but")


def test_reasons_are_kept_once_and_other_errors_pass() -> None:
    reasons = Reasons(RecordingError)
    reasons.refuse()
    for text in ("one", "two", "one\nthree"):
        with reasons.gathered():
            raise RecordingError(text)
    with pytest.raises(RecordingError) as error:
        reasons.refuse()
    assert str(error.value).splitlines() == ["one", "two", "three"]
    with pytest.raises(KeyError), reasons.gathered():
        raise KeyError("of a programmer")
