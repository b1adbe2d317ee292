"""Tables as laboratory programs write them: separators, decimal commas, encodings, dates."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pam_gap.recordings.import_csv import read_columns, read_table
from pam_gap.recordings.recording import RecordingError

TIME = np.arange(50) * 0.01
TABLE = pd.DataFrame(
    {
        "time": TIME,
        "pressure_states.flexor": 2e5 + 1e4 * np.sin(TIME),
        "joint_states.elbow.position": 0.1 * np.cos(TIME),
    }
)


@pytest.mark.parametrize(
    "look",
    [
        {"sep": ";", "decimal": ","},
        {"sep": ";"},
        {"sep": "\t", "decimal": ","},
        {"sep": "\t"},
        {"encoding": "utf-8-sig"},
        {"encoding": "utf-16"},
        {"quoting": 2},
        {"quoting": 1, "decimal": ","},
        {"sep": "|"},
        {"sep": "|", "decimal": ","},
    ],
)
def test_what_a_spreadsheet_writes_is_read_like_the_plain_table(
    look: dict[str, str], tmp_path: Path
) -> None:
    path = tmp_path / "log.csv"
    TABLE.to_csv(path, index=False, **look)
    found = read_columns(path).columns
    assert list(found) == list(TABLE.columns)
    for name in TABLE.columns:
        np.testing.assert_allclose(found[name], TABLE[name])
    assert set(read_table(path).channels) == set(TABLE.columns) - {"time"}


def test_a_degree_sign_of_an_old_spreadsheet_is_read(tmp_path: Path) -> None:
    path = tmp_path / "log.csv.gz"
    TABLE.rename(columns={"time": "Winkel [°]"}).to_csv(path, index=False, encoding="cp1252")
    assert "Winkel [°]" in read_columns(path).columns


def test_names_of_a_chinese_instrument_are_read(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    TABLE.rename(columns={"time": "时间"}).to_csv(path, index=False, encoding="gbk")
    assert "时间" in read_columns(path).columns


def test_numbers_as_fortran_writes_them_are_read(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(TABLE.to_csv(index=False, float_format="%.9E").replace("E", "D"))
    np.testing.assert_allclose(read_columns(path).columns["time"], TIME)


@pytest.mark.parametrize(
    "stamp",
    ["%Y-%m-%d %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S,%f", "%Y/%m/%d %H:%M:%S.%f", "%H:%M:%S:%f"],
)
def test_dates_become_seconds(stamp: str, tmp_path: Path) -> None:
    dates = pd.Timestamp("2026-03-02T14:30:00") + pd.to_timedelta(TIME, unit="s")
    path = tmp_path / "log.csv"
    TABLE.assign(time=dates.strftime(stamp)).to_csv(path, index=False, sep=";")
    time = read_table(path).channels["pressure_states.flexor"].time
    np.testing.assert_allclose(time - time[0], TIME, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda text: text.replace("joint_states.elbow.position", "time"), "are called 'time'"),
        (lambda text: text.split("\n", 1)[1], "first line holds numbers; expected the names"),
        (
            lambda text: text.replace("\n0.", "\nabout 0."),
            "such as 'about 0.0' in row 1; expected",
        ),
        (lambda _: "", "not a readable table"),
    ],
)
def test_a_table_that_cannot_be_understood_says_why(change, told: str, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(change(TABLE.to_csv(index=False)))
    with pytest.raises(RecordingError, match=told):
        read_table(path)
