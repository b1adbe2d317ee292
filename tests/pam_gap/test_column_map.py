"""Tables with other names, units and formats, read with a map of their columns."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from pam_gap.recordings.column_map import load_column_map
from pam_gap.recordings.import_recording import import_recording
from pam_gap.recordings.recording import RecordingError

FLEXOR = "pressure_states.elbow_flexor"
EXTENSOR = "pressure_states.elbow_extensor"
POSITION = "joint_states.elbow.position"
COMMAND = "valve_commands.elbow_flexor"
TIME = np.arange(400) * 0.002
GAUGE = 2e5 + 5e4 * np.sin(5.0 * TIME)
ANGLE = 0.3 * np.sin(5.0 * TIME)
LOG = {
    "t": 1e3 * TIME,
    "p1": 1e-5 * (GAUGE + 101325.0),
    "phi": -np.degrees(ANGLE),
    "u1": 100.0 * ANGLE,
}
MAP = f"""
time: {{column: t, unit: ms}}
channels:
  {FLEXOR}: {{column: p1, unit: bar, absolute: true}}
  {POSITION}: {{column: phi, unit: deg, sign: -1, offset: 0.5}}
  {COMMAND}: {{column: u1, unit: per cent}}
"""


def write(path: Path, suffix: str) -> Path:
    file = path / f"log{suffix}"
    if suffix == ".npz":
        np.savez(file, **LOG, note=np.array("text"))
    elif suffix == ".mat":
        savemat(file, {**LOG, "fs": 500.0})
    elif suffix == ".parquet":
        pd.DataFrame(LOG).to_parquet(file)
    else:
        pd.DataFrame(LOG).to_csv(file, index=False)
    return file


@pytest.mark.parametrize("suffix", [".csv", ".csv.gz", ".parquet", ".npz", ".mat"])
def test_units_signs_and_names_of_any_table_are_mapped(tmp_path: Path, suffix: str) -> None:
    (tmp_path / "map.yaml").write_text(MAP)
    column_map = load_column_map(tmp_path / "map.yaml")
    recording = import_recording(write(tmp_path, suffix), column_map=column_map)
    assert recording.sample_time == pytest.approx(0.002)
    np.testing.assert_allclose(recording.values[FLEXOR], GAUGE, rtol=1e-6)
    np.testing.assert_allclose(recording.values[POSITION], ANGLE + 0.5, atol=1e-6)
    np.testing.assert_allclose(recording.values[COMMAND][1:-1], ANGLE[1:-1], atol=1e-6)
    assert "map.yaml" in recording.repairs[0]


def test_a_table_without_a_time_has_a_rate_and_arrays_have_columns(tmp_path: Path) -> None:
    savemat(tmp_path / "log.mat", {"p": np.stack([GAUGE, 2.0 * GAUGE])})
    (tmp_path / "map.yaml").write_text(
        f"rate: 250\nchannels: {{{FLEXOR}: p.0, {EXTENSOR}: {{column: p.1, scale: 0.5}}}}\n"
    )
    recording = import_recording(
        tmp_path / "log.mat", column_map=load_column_map(tmp_path / "map.yaml")
    )
    assert recording.sample_time == pytest.approx(0.004)
    for name in (FLEXOR, EXTENSOR):
        np.testing.assert_allclose(recording.values[name], GAUGE, rtol=1e-9)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("channels: [", "not a readable map"),
        ("time: t", "no `channels`"),
        (f"channels: {{{FLEXOR}: p1}}", "either `time` or `rate`"),
        (f"rate: 0\nchannels: {{{FLEXOR}: p1}}", "rate is 0; expected Hz"),
        (f"rate: 5\nchannels: {{{FLEXOR}: {{column: p1, unit: torr}}}}", "unit 'torr'; expected"),
        (f"rate: 5\nchannels: {{{FLEXOR}: {{column: p1, units: bar}}}}", "unknown key units"),
        (f"rate: 5\nchannels: {{{FLEXOR}: {{column: p1, sign: 2}}}}", "a sign of 1 or -1"),
        (f"rate: 5\nchannels: {{{FLEXOR}: {{column: p1, scale: x}}}}", "scale is 'x'"),
        (f"rate: 5\nchannels: {{{FLEXOR}: 3}}", "expected the name of a column"),
        (f"rate: 5\nchannels: {{{POSITION}: {{column: a, absolute: true}}}}", "only a pressure"),
        ("rate: 5\nchannels: {pressure.flexor: p1}", "pressure.flexor: no channel"),
    ],
)
def test_mistakes_in_a_map_are_one_line(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / "map.yaml").write_text(text)
    with pytest.raises(RecordingError) as error:
        load_column_map(tmp_path / "map.yaml")
    assert told in str(error.value)
    assert str(error.value).startswith(str(tmp_path / "map.yaml"))
    assert "\n" not in str(error.value)


def test_a_column_that_is_missing_is_named_with_those_there_are(tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text(MAP.replace("p1", "p9"))
    file = write(tmp_path, ".csv")
    with pytest.raises(RecordingError, match=r"no column p9, .*it has t, p1, phi, u1"):
        import_recording(file, column_map=load_column_map(tmp_path / "map.yaml"))


def test_a_mat_file_that_is_hdf5_or_broken_is_one_line(tmp_path: Path) -> None:
    for content in (b"\x89HDF\r\n\x1a\n" + bytes(600), b"no matrix"):
        (tmp_path / "log.mat").write_bytes(content)
        with pytest.raises(RecordingError, match="not a readable table"):
            import_recording(tmp_path / "log.mat")
