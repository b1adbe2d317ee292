"""Import: what is repaired, what is said, and that nothing is delayed."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from pam_gap.recordings.import_recording import import_recording
from pam_gap.recordings.noise_floor import channel_noise, noise_floor, quantisation
from pam_gap.recordings.recording import RawChannel, RawRecording, RecordingError
from pam_gap.recordings.resample import resample

PRESSURE = "pressure_states.flexor"
POSITION = "joint_states.elbow.position"
COMMAND = "valve_commands.flexor"


def motion(time: np.ndarray) -> np.ndarray:
    return 0.4 * np.sin(2 * np.pi * 0.7 * time)


def raw(**channels: tuple[np.ndarray, np.ndarray]) -> RawRecording:
    names = {"pressure": PRESSURE, "position": POSITION, "command": COMMAND}
    return RawRecording(
        Path("made"), {names[key]: RawChannel(*value) for key, value in channels.items()}
    )


@pytest.mark.parametrize("suffix", [".csv", ".csv.gz", ".parquet"])
def test_tables_are_read_alike(tmp_path: Path, suffix: str) -> None:
    time = np.arange(200) * 0.002
    frame = pd.DataFrame({"time": time, POSITION: motion(time), "remark": 1.0})
    path = tmp_path / f"recording{suffix}"
    if suffix == ".parquet":
        frame.to_parquet(path)
    else:
        frame.to_csv(path, index=False)
    recording = import_recording(path)
    assert recording.sample_time == pytest.approx(0.002)
    np.testing.assert_allclose(recording.values[POSITION], motion(time), atol=1e-12)
    assert any("remark" in text for text in recording.repairs)
    assert recording.one_clock


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_bags_are_read_by_measurement_stamp(tmp_path: Path, plugin: StoragePlugin) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    state = store.types["sensor_msgs/msg/JointState"]
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    empty = np.zeros(0)
    with Writer(tmp_path / "bag", version=9, storage_plugin=plugin) as writer:
        link = writer.add_connection("/joint_states", state.__msgtype__, typestore=store)
        for k in range(300):
            nanoseconds = 1_700_000_000_000_000_000 + k * 4_000_000
            message = state(
                header=header(stamp(nanoseconds // 10**9, nanoseconds % 10**9), ""),
                name=["elbow"],
                position=np.array([motion(np.array(k * 0.004)).item()]),
                velocity=empty,
                effort=empty,
            )
            late = nanoseconds + 3_000_000 + (k % 3) * 1_000_000
            writer.write(link, late, store.serialize_cdr(message, state.__msgtype__))
    recording = import_recording(tmp_path / "bag")
    assert recording.sample_time == pytest.approx(0.004, abs=1e-6)
    np.testing.assert_allclose(
        recording.values[POSITION], motion(np.arange(300) * 0.004), atol=1e-6
    )


@pytest.mark.parametrize(
    ("asked", "count", "expected"), [(300, 300, 0.25), (300, 0, -0.5), (None, 300, 0.25)]
)
def test_what_the_driver_sent_stands_for_what_was_asked(
    tmp_path: Path, asked: int | None, count: int, expected: float
) -> None:
    """Unless nothing of it was recorded."""
    store = get_typestore(Stores.ROS2_JAZZY)
    state = store.types["sensor_msgs/msg/JointState"]
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    empty = np.zeros(0)
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, number, value in (
            ("/valve_commands", asked, -0.5),
            ("/sent_valve_commands", count, 0.25),
        ):
            if number is None:
                continue
            link = writer.add_connection(topic, state.__msgtype__, typestore=store)
            for k in range(number):
                now = 1_700_000_000_000_000_000 + k * 4_000_000
                made = header(stamp(now // 10**9, now % 10**9), "")
                message = state(
                    header=made, name=["flexor"], position=np.array([value]), velocity=empty,
                    effort=empty,
                )  # fmt: skip
                writer.write(link, now, store.serialize_cdr(message, state.__msgtype__))
    recording = import_recording(tmp_path / "bag")
    assert set(recording.values) == {COMMAND}
    assert not recording.one_clock
    assert (recording.values[COMMAND] == expected).all()


def test_resampling_of_jittered_stamps_adds_no_lag() -> None:
    random = np.random.default_rng(3)
    time = np.sort(np.arange(4000) * 0.002 + random.uniform(-6e-4, 6e-4, 4000))
    grid = np.arange(3999) * 0.002
    recording = resample(raw(position=(time, motion(time)), command=(grid, np.sign(grid - 4))))
    start = max(time[0], 0.0)
    error = recording.values[POSITION] - motion(recording.time + start)
    rate = np.gradient(motion(recording.time + start), recording.sample_time)
    assert abs(float(error @ rate / (rate @ rate))) < 2e-6  # s
    assert any("jitter" in text for text in recording.repairs)


def test_commands_are_held_not_interpolated() -> None:
    slow = np.arange(0.0, 8.0, 0.02)
    time = np.arange(0.0, 7.9, 0.002)
    steps = np.where(slow % 0.2 < 0.1, 0.3, -0.3)
    recording = resample(raw(position=(time, motion(time)), command=(slow, steps)))
    assert set(np.unique(recording.values[COMMAND])) == {-0.3, 0.3}


def test_commands_between_the_points_of_the_grid_act_for_the_rest_of_the_step() -> None:
    """Neither lost nor late: what was commanded in all, and its centre in time, stay."""
    random = np.random.default_rng(4)
    time = np.arange(4000) * 0.002
    late = np.sort(time + random.uniform(0.0, 2e-3, 4000))
    late[0] = 0.0
    steps = random.uniform(-1.0, 1.0, 4000)
    recording = resample(raw(position=(time, motion(time)), command=(late, steps)), 0.002)
    commands, count = recording.values[COMMAND], recording.time.size
    edges = np.append(late, late[-1])
    for end in (1000, 2000, 3000):
        width = np.diff(np.minimum(edges, end * 0.002))
        assert commands[:end].sum() * 0.002 == pytest.approx(steps @ width, abs=1e-5)
    assert count > 3990


def test_even_commands_stay_as_they_are() -> None:
    time = 5.0 + np.round(np.arange(2000) * 0.002 + 1e-7 * np.cos(np.arange(2000)), 7)
    steps = np.random.default_rng(5).uniform(-1.0, 1.0, 2000)
    recording = resample(raw(position=(time, motion(time)), command=(time, steps)))
    np.testing.assert_array_equal(recording.values[COMMAND], steps)
    assert not recording.samples


def test_stamps_in_the_middle_between_points_of_the_grid_count() -> None:
    random = np.random.default_rng(6)
    time = np.arange(4000) * 0.002
    between = time + 0.001 + random.uniform(-2e-4, 2e-4, 4000)
    recording = resample(
        raw(position=(between, motion(between)), pressure=(time, 1e5 + motion(time))), 0.002
    )
    start = between[0]
    assert recording.valid[POSITION].all()
    expected = motion(recording.time + start)
    np.testing.assert_allclose(recording.values[POSITION], expected, atol=1e-5)


@pytest.mark.parametrize("offset", [0.0, 2.5e-4, 1e-3])
def test_interpolation_does_not_hide_noise(offset: float) -> None:
    random = np.random.default_rng(7)
    time = np.arange(8000) * 0.002
    shifted = time + offset
    noisy = 2e5 + 1e5 * motion(shifted) + 150.0 * random.standard_normal(time.size)
    recording = resample(raw(position=(time, motion(time)), pressure=(shifted, noisy)), 0.002)
    assert noise_floor(recording)[PRESSURE].deviation == pytest.approx(150.0, rel=0.05)


def test_gaps_are_left_out_and_slow_channels_count_at_their_samples_only() -> None:
    time = np.arange(0.0, 8.0, 0.002)
    keep = (time < 3.0) | (time > 3.5)
    slow = np.arange(0.0, 8.0, 0.01)
    recording = resample(
        raw(position=(time[keep], motion(time[keep])), pressure=(slow, 1e5 + 1e4 * motion(slow)))
    )
    inside = (recording.time > 3.01) & (recording.time < 3.49)
    assert not recording.valid[POSITION][inside].any()
    assert recording.valid[POSITION][~inside].mean() > 0.98
    assert recording.valid[PRESSURE].mean() == pytest.approx(0.2, abs=0.02)
    assert any("gap" in text for text in recording.repairs)


def test_bad_samples_are_dropped_and_reported() -> None:
    time = np.arange(2000) * 0.002
    values = motion(time)
    values[500] = 40.0
    values[700] = np.nan
    time[900] = time[899]
    time[[1200, 1201]] = time[[1201, 1200]]
    recording = resample(raw(position=(time, values)))
    assert np.abs(recording.values[POSITION]).max() < 0.5
    text = " ".join(recording.repairs)
    for word in ("spike", "missing", "repeated", "ran back"):
        assert word in text


@pytest.mark.parametrize(
    ("content", "word"),
    [("a,b\n1,2\n", "time"), ("time,x\n1,2\n", "contract"), ("", "readable")],
)
def test_useless_tables_say_why(tmp_path: Path, content: str, word: str) -> None:
    path = tmp_path / "recording.csv"
    path.write_text(content)
    with pytest.raises(RecordingError, match=word):
        import_recording(path)


@pytest.mark.parametrize("resolution", [0.0, 244.0])
def test_noise_is_found_under_motion(resolution: float) -> None:
    random = np.random.default_rng(1)
    time = np.arange(20000) * 0.002
    values = 2e5 + 1e5 * motion(time) + 150.0 * random.standard_normal(time.size)
    if resolution:
        values = np.round(values / resolution) * resolution
    noise = channel_noise(values)
    expected = np.hypot(150.0, resolution / np.sqrt(12))
    assert noise.deviation == pytest.approx(expected, rel=0.05)
    assert noise.resolution == pytest.approx(resolution)


def test_quantisation_survives_rounded_decimals() -> None:
    random = np.random.default_rng(2)
    step = 2 * np.pi / 16384
    values = np.round(np.round(random.normal(0, 0.01, 4000) / step) * step, 5)
    assert quantisation(values) == pytest.approx(step, rel=0.05)


def test_a_recording_that_would_cost_too_much_memory_is_refused() -> None:
    time = np.arange(5200) * 4.0
    raw = RawRecording(Path("log.csv"), {"pressure_states.flexor": RawChannel(time, np.sin(time))})
    with pytest.raises(RecordingError, match="stamp that is far off"):
        resample(raw, step=2e-3)


def test_a_stamp_that_is_far_off_is_a_pause() -> None:
    time = np.append(np.arange(1000) * 2e-3, 1e12)
    raw = RawRecording(Path("log.csv"), {"pressure_states.flexor": RawChannel(time, np.sin(time))})
    read = resample(raw)
    assert read.duration < 8.0
    assert "1 pauses of 1e+12 s" in " ".join(read.repairs)


def test_two_recordings_in_one_file_are_refused(tmp_path: Path) -> None:
    """Sorted by stamp, their samples were mixed, and the mixture was diagnosed."""
    time = np.arange(2000) * 0.002
    twice = np.concatenate([time, time + 1e-4])
    frame = pd.DataFrame({"time": twice, POSITION: np.concatenate([motion(time), 0.3 + 0 * time])})
    frame.to_csv(tmp_path / "log.csv", index=False)
    with pytest.raises(RecordingError, match=r"log\.csv: .*goes back from 3\.998 s.*sample 2001"):
        import_recording(tmp_path / "log.csv")


def test_lost_rows_are_told_once_for_all_channels() -> None:
    time = np.arange(4000) * 0.002
    keep = np.ones(4000, dtype=bool)
    keep[100:3900:37] = False
    keep[2000:2100] = False
    channel = (time[keep], 1e5 + 1e3 * motion(time[keep]))
    recording = resample(
        raw(pressure=channel, position=(time[keep], motion(time[keep])), command=(time, 0 * time))
    )
    told = [text for text in recording.repairs if "missing" in text]
    assert len(told) == 2
    assert all("of 3900 samples are missing" in text for text in told)
    columns = {n: RawChannel(*channel) for n in (PRESSURE, POSITION, "supply_pressure")}
    (one,) = [t for t in resample(RawRecording(Path("m"), columns)).repairs if "missing" in t]
    assert one.startswith("all channels: ")
