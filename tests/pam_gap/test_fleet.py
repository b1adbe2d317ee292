"""Many recordings: found, timed, diagnosed in parallel, none lost, and told on one page."""

import json
import os
import re
import signal
from dataclasses import replace
from datetime import UTC, datetime
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pam_gap.__main__ import main
from pam_gap.fleet import fleet
from pam_gap.fleet.diagnose_job import (
    DONE,
    DiagnosisTask,
    diagnose_job,
    folder_name,
    kept_result,
    key_of,
)
from pam_gap.fleet.fleet_page import render
from pam_gap.fleet.follow_all import follow_all, share_where_it_helps
from pam_gap.fleet.jobs import Job, find_recordings, many_rigs, one_rig
from pam_gap.fleet.recording_time import FILE, STAMPS, TABLE, time_of
from pam_gap.fleet.series import WEEK, Point, as_json, in_words, make_series, soonest
from pam_gap.fleet.tables import PARAMETERS, RECORDINGS
from pam_gap.fleet.tracking import effects_to_follow, labels_found, typical_values
from pam_gap.fleet.workers import Ended, cluster, run_all
from pam_gap.rules.fleet_rules import FleetRules
from pam_model.errors import PamError
from pam_model.rig import save_rig

START = datetime(2026, 1, 5, tzinfo=UTC).timestamp()


def write(path: Path, start: float = START) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    pd.DataFrame({"time": start + 0.01 * np.arange(5), "x": np.arange(5)}).to_csv(path, index=False)
    return path


def answer(verdict="named", torque=0.5, **changes):
    """What a diagnosis of the elbow says, as far as the fleet reads it."""
    parameters = {
        "coulomb_friction": {
            "torque": {"value": torque, "low": torque - 0.05, "high": torque + 0.05, "unit": "N m"}
        }
    }
    named = verdict in ("named", "ambiguous")
    return {
        "joint": "elbow", "verdict": verdict, "stage": "joint" if named else None,
        "effects": ["coulomb_friction"] if named else [], "sentence": "The joint rubs.",
        "parameters": parameters if named else {}, "closed": None, "indistinguishable": [],
        "ranking": [{"effects": ["coulomb_friction"], "label": "coulomb_friction"}],
    } | changes  # fmt: skip


@pytest.fixture
def rig_file(rig, tmp_path) -> Path:
    save_rig(rig, tmp_path / "rig.yaml")
    return tmp_path / "rig.yaml"


# --- which recordings, and of which rig ---


def test_recordings_are_found_in_folders_of_any_depth_without_the_results(tmp_path):
    write(tmp_path / "a.csv")
    write(tmp_path / "week 2" / "b.csv")
    write(tmp_path / "out" / "recordings" / "c.csv")
    bag = tmp_path / "week 2" / "bag"
    bag.mkdir()
    (bag / "metadata.yaml").write_text("")
    (bag / "bag_0.mcap").write_text("")
    found = find_recordings(tmp_path, [tmp_path / "out"])
    assert [str(p.relative_to(tmp_path)) for p in found] == ["a.csv", "week 2/b.csv", "week 2/bag"]


def test_a_table_gives_each_recording_its_rig_robot_and_time(tmp_path, rig_file):
    write(tmp_path / "bags" / "a.csv", start=0.0)
    table = tmp_path / "rigs.csv"
    table.write_text("recording,rig,robot,time\na.csv,rig.yaml,left arm,2026-02-03T10:00\n")
    (job,) = many_rigs(tmp_path / "bags", table)
    assert (job.name, job.robot, job.rig) == ("a.csv", "left arm", rig_file)
    assert job.stated_time == datetime(2026, 2, 3, 10, tzinfo=UTC).timestamp()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("recording\na.csv\n", "no column 'rig'"),
        ("recording,rig\nb.csv,rig.yaml\n", "line 2: recording"),
        ("recording,rig\na.csv,other.yaml\n", "line 2: rig"),
        ("recording,rig,time\na.csv,rig.yaml,yesterday\n", "'yesterday' is no date"),
        ("recording,rig\na.csv,rig.yaml\na.csv,rig.yaml\n", "several lines"),
        ("recording,rig\n", "no recording"),
    ],
)
def test_a_mistake_in_the_table_is_one_line(text, said, tmp_path, rig_file, capsys):
    write(tmp_path / "bags" / "a.csv")
    (tmp_path / "rigs.csv").write_text(text)
    line = f"fleet {tmp_path}/bags --rigs {tmp_path}/rigs.csv --out {tmp_path}/out".split()
    assert main(line) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


def test_a_folder_without_recordings_is_a_mistake(tmp_path, rig_file):
    (tmp_path / "empty").mkdir()
    with pytest.raises(PamError, match="no recording in this folder"):
        one_rig(tmp_path / "empty", rig_file)


def test_the_time_is_that_of_the_stamps_then_of_the_table_then_of_the_file(tmp_path):
    dated, plain = write(tmp_path / "a.csv"), write(tmp_path / "b.csv", start=0.0)
    os.utime(plain, (START + 7.0, START + 7.0))
    assert (time_of(dated, 5.0).seconds, time_of(dated).source) == (START, STAMPS)
    assert (time_of(plain, 5.0).seconds, time_of(plain, 5.0).source) == (5.0, TABLE)
    assert (time_of(plain).seconds, time_of(plain).source) == (START + 7.0, FILE)


# --- one recording is a result, whatever is wrong with it ---


def test_a_corrupt_recording_is_a_result_and_is_not_diagnosed_again(tmp_path, rig_file):
    (tmp_path / "bags").mkdir()
    (tmp_path / "bags" / "a.csv.gz").write_bytes(b"this is no recording")
    (job,) = one_rig(tmp_path / "bags", rig_file)
    task = DiagnosisTask(job, tmp_path / "out" / "a")
    result = diagnose_job(task)
    assert "not a readable table" in result["failure"] and "\n" not in result["failure"]
    assert kept_result(task, key_of(task)) == result
    assert not list((tmp_path / "out").glob("*.part"))


def test_another_recording_rig_version_or_constant_is_diagnosed_again(
    tmp_path, rig_file, monkeypatch
):
    (job,) = one_rig(write(tmp_path / "bags" / "a.csv").parent, rig_file)
    task = DiagnosisTask(job, tmp_path / "out")
    task.folder.mkdir()
    key = key_of(task)
    (task.folder / DONE).write_text(json.dumps({"key": key}))
    assert kept_result(task, key_of(task)) is not None
    rules = replace(task.rules, decision=replace(task.rules.decision, material_share=0.002))
    assert kept_result(task, key_of(replace(task, rules=rules))) is None
    monkeypatch.setattr("pam_gap.__version__", "99.0")
    assert kept_result(task, key_of(task)) is None
    monkeypatch.undo()
    monkeypatch.setattr("pam_gap.fleet.diagnose_job.source_hash", lambda: "changed code")
    assert kept_result(task, key_of(task)) is None
    monkeypatch.undo()
    rig_file.write_text(rig_file.read_text() + "\n# changed\n")
    assert kept_result(task, key_of(task)) is None


def test_names_of_folders_cannot_leave_the_results():
    assert folder_name("../week 2/a.csv") == "__week_2__a.csv"
    assert folder_name("..") == "_"


# --- workers ---


def test_a_killed_worker_loses_nothing_and_failures_are_results(tmp_path):
    def stub(job):
        number, place = job
        if number == 1 and not (place / "killed").exists():
            (place / "killed").touch()
            os.kill(os.getpid(), signal.SIGKILL)
        if number == 2:
            raise PamError("bag 2: no topics")
        if number == 3:
            raise ValueError("of a\nlibrary")
        return 10 * number

    with cluster(1) as client:
        ended = sorted(
            run_all(client, stub, [(k, tmp_path) for k in range(5)]), key=lambda e: e.number
        )
    assert (tmp_path / "killed").exists()
    assert [e.result for e in ended] == [0, 10, None, None, 40]
    assert [e.failure for e in ended] == [
        "",
        "",
        "bag 2: no topics",
        "ValueError: of a library",
        "",
    ]


def test_the_whole_way_with_a_stub_keeps_failures_and_diagnoses_only_what_is_new(
    tmp_path, rig_file, monkeypatch
):
    folder, out = tmp_path / "bags", tmp_path / "out"
    for k in range(3):
        write(folder / f"{k}.csv", START + k * WEEK)

    def stub(task):
        from pam_gap.fleet.diagnose_job import DONE, key_of
        from pam_model.errors import PamError

        if task.job.name == "1.csv":
            raise PamError("1.csv: corrupt")
        result = {"key": key_of(task), "time": START, "time_from": "stamps", "seconds": 0.0,
                  "joints": [answer("none")], "failure": ""}  # fmt: skip
        task.folder.mkdir(parents=True, exist_ok=True)
        (task.folder / DONE).write_text(json.dumps(result))
        return result

    settings = fleet.Settings(folder, out, rig=rig_file, workers=1)
    first = fleet.analyse_fleet(settings, stub)
    assert first["diagnosed_now"] == 3
    assert {r["recording"]: r["failure"] for r in first["recordings"]}["1.csv"] == "1.csv: corrupt"
    table = pd.read_parquet(out / RECORDINGS).set_index("recording")
    assert len(table) == 3 and table.loc["0.csv", "verdict"] == "none"
    assert str(table["time"].dtype.tz) == "UTC"
    assert len(pd.read_parquet(out / PARAMETERS)) == 0
    assert "1.csv: corrupt" in (out / fleet.PAGE).read_text()
    write(folder / "3.csv")
    again = []
    monkeypatch.setattr(
        fleet, "run_all", lambda client, function, jobs: again.extend(jobs) or iter(())
    )
    fleet.diagnose_all(None, [DiagnosisTask(j, out / "recordings" / folder_name(j.name))
                              for j in one_rig(folder, rig_file)], settings)  # fmt: skip
    assert [task.job.name for task in again] == ["1.csv", "3.csv"]


def test_one_recording_of_each_period_is_diagnosed_and_a_failed_one_is_replaced():
    """Later recordings do not change the choice, so that nothing is diagnosed twice."""
    robots, times = ["a"] * 5 + ["b"], [START + k * WEEK / 2.0 for k in range(5)] + [START]
    nothing = [None] * 6
    assert fleet.to_diagnose(robots, times, nothing, 0.0) == [0, 1, 2, 3, 4, 5]
    first = fleet.to_diagnose(robots, times, nothing, 7.0)
    assert 0 in first and 5 in first and len(first) == 4
    failed, good = {"joints": []}, {"joints": [answer()]}
    results = [failed if k == first[1] else good if k in first else None for k in range(6)]
    (replaced,) = fleet.to_diagnose(robots, times, results, 7.0)
    assert replaced == first[1] + 1
    results[replaced] = good
    assert fleet.to_diagnose(robots, times, results, 7.0) == []


def test_recordings_that_are_only_followed_are_points_and_damaged_ones_failures(
    tmp_path, rig_file, monkeypatch
):
    folder, out = tmp_path / "bags", tmp_path / "out"
    for k in range(6):
        write(folder / f"{k}.csv", START + k * WEEK / 7.0)

    def diagnosed(client, function, tasks):
        for number, task in enumerate(tasks):
            row = {"key": key_of(task), "time": START, "time_from": "stamps", "seconds": 0.0,
                   "joints": [answer()], "failure": ""}  # fmt: skip
            yield Ended(number, row)

    def fitted(client, function, tasks):
        for number, task in enumerate(tasks):
            fit = {"effect": "coulomb_friction", "parameter": "torque", "value": 0.5, "low": 0.4,
                   "high": 0.6, "unit": "N m", "is_shape": False, "improvement": 1.0}  # fmt: skip
            damaged = task.recording.name == "4.csv"
            yield Ended(number, None, "4.csv: damaged") if damaged else Ended(number, [fit])

    monkeypatch.setattr(fleet, "run_all", diagnosed)
    monkeypatch.setattr("pam_gap.fleet.follow_all.run_all", fitted)
    monkeypatch.setattr("pam_gap.fleet.tracking.RULES", FleetRules(several=1))
    settings = fleet.Settings(folder, out, rig=rig_file, workers=1, full_every=365.0)
    document = fleet.analyse_fleet(settings)
    assert document["diagnosed_now"] == 1
    rows = {row["recording"]: row for row in document["recordings"]}
    assert [name for name, row in rows.items() if row["failure"]] == ["4.csv"]
    assert [name for name, row in rows.items() if row["verdict"]] == ["0.csv"]
    assert len(document["series"][0]["points"]) == 5
    assert "Only followed, not diagnosed" in (out / fleet.PAGE).read_text()


def test_a_scheduler_that_does_not_answer_is_one_line(monkeypatch):
    monkeypatch.setattr("pam_gap.fleet.workers.WAIT", 0.3)
    with (
        pytest.raises(PamError, match="no Dask scheduler answers"),
        cluster(1, "tcp://127.0.0.1:9"),
    ):
        pass


# --- which effects are followed ---


def test_effects_of_several_recordings_are_followed_and_their_rivals_are_not():
    rival = answer("ambiguous", indistinguishable=[["coulomb_friction", "hysteresis"]])
    odd = answer(parameters={"hysteresis": {}}, effects=["hysteresis"],
                 ranking=[{"effects": ["hysteresis"], "label": "hysteresis"}])  # fmt: skip
    bias = answer(
        parameters={"pressure_bias": {}}, effects=["pressure_bias"],
        ranking=[{"effects": ["pressure_bias"], "label": "pressure_bias (agonist)"}],
    )  # fmt: skip
    once = answer(parameters={"leakage": {}}, effects=["leakage"], ranking=[])
    answers = [answer(), answer(), rival, odd, odd, bias, bias, once, answer("none")]
    assert labels_found(bias) == ("pressure_bias (agonist)",)
    assert effects_to_follow(answers) == ("coulomb_friction", "pressure_bias (agonist)")
    assert effects_to_follow([answer(), answer("none")]) == ()


def test_the_fit_starts_at_what_the_diagnoses_found():
    answers = [answer(torque=0.4), answer(torque=0.6), answer(torque=0.5), answer("none")]
    assert typical_values(answers, ["coulomb_friction"]) == ({"torque": 0.5},)


def test_an_effect_counts_where_it_helps_most():
    all_ = np.full(8, 20.0)
    assert share_where_it_helps(all_, all_ - 1.0) == pytest.approx(0.05)
    leak_in_a_quarter = np.where(np.arange(8) < 2, 5.0, 20.0)
    assert share_where_it_helps(all_, leak_in_a_quarter) == pytest.approx(0.75)
    assert share_where_it_helps(np.array([np.nan]), np.array([1.0])) == 0.0


def test_of_effects_that_look_alike_only_the_needed_are_followed(tmp_path, monkeypatch):
    """What explains the error alone in half of the recordings stays; its imitation goes."""
    worth = {"leakage": 15.0, "coulomb_friction": 6.0, "hysteresis": 3.0}

    def fits(client, function, tasks):
        for number, task in enumerate(tasks):
            best = max((worth[x] for x in task.labels if x != "leakage"), default=0.0)
            fall = best + worth["leakage"] * ("leakage" in task.labels)
            yield Ended(number, [{"improvement": fall}])

    monkeypatch.setattr("pam_gap.fleet.follow_all.run_all", fits)
    three = answer(
        parameters={name: {} for name in worth}, effects=list(worth),
        ranking=[{"effects": list(worth), "label": " + ".join(worth)}],
    )  # fmt: skip
    tasks = [DiagnosisTask(Job(f"{k}", tmp_path, tmp_path, "arm"), tmp_path) for k in range(3)]
    results = [{"key": {"n": k}, "time": k, "joints": [three]} for k in range(3)]
    (found,) = follow_all(None, tasks, results)
    assert found.labels == ("coulomb_friction", "leakage")
    assert len(found.rows) == 3 and not found.failures


# --- words and page ---


def series(law, limit=None, n=16):
    random = np.random.default_rng(3)
    points = []
    for k in range(n):
        weeks = 8.0 * k / (n - 1)
        value = law(weeks) + random.normal(0.0, 0.01)
        points.append(Point(f"{k}.csv", START + weeks * WEEK, value, value - 0.02, value + 0.02))
    names = ("arm", "elbow", "coulomb_friction", "torque")
    return make_series(names, "N m", points[::-1], limit)


def test_growth_is_told_with_rate_date_and_what_is_left():
    found = series(lambda w: 0.5 + 0.1 * max(0.0, w - 3.0), limit=1.5)
    said = " ".join(in_words(found))
    assert re.search(r"Coulomb friction, torque \(elbow\) has grown by 0\.1\d* N m a week", said)
    assert re.search(r"since \d+ January 2026", said)
    assert re.search(r"reaches 1\.5 N m in about (4\.\d|5|5\.\d) weeks", said)
    ((_, weeks, _),) = soonest([found])
    assert weeks == pytest.approx(5.0, abs=0.7)
    assert "doubles to 2" in " ".join(in_words(replace(found, limit=None)))


def test_a_repair_is_told_with_its_dates_and_needs_no_repair():
    found = series(lambda w: 0.5 if w < 5.0 else 0.1)
    assert "fell by 0.4 N m" in in_words(found)[0]
    assert soonest([found]) == []
    entry = as_json(found)["changes"][0]
    assert entry["kind"] == "step" and entry["earliest"] <= START + 5 * WEEK <= entry["latest"]


def test_constants_and_short_series_say_so():
    assert in_words(series(lambda w: 0.5)) == [
        "Coulomb friction, torque (elbow) stays at 0.5 N m: no change was found."
    ]
    assert "too few" in in_words(series(lambda w: 0.5, n=4))[0]


class _Images(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[dict[str, str | None]] = []

    def handle_starttag(self, tag, attrs):
        if tag == "img":
            self.found.append(dict(attrs))


def test_the_page_shows_series_recordings_and_failures_and_escapes_names():
    found = series(lambda w: 0.5 + 0.1 * max(0.0, w - 3.0))
    row = {"recording": "<b>0.csv", "robot": "arm", "joint": "elbow", "time": START,
           "time_from": "file", "verdict": "named", "effects": "coulomb_friction", "failure": "",
           "link": "recordings/0/report.html"}  # fmt: skip
    broken = row | {"recording": "1.csv", "verdict": "", "failure": "1.csv: corrupt", "link": ""}
    page = render(
        {
            "recordings": [row, broken],
            "followed": [{"robot": "arm", "joint": "elbow", "failures": [("2.csv", "too short")]}],
            "series": [as_json(found)],
            "next": [
                {"robot": "arm", "joint": "elbow", "what": "x", "weeks": 9.6, "aim": "doubles"}
            ],
        },
        [found],
    )
    assert "<b>0.csv" not in page and "&lt;b&gt;0.csv" in page
    for text in (
        "1.csv: corrupt",
        "2.csv: too short",
        "has grown by",
        "time of the file",
        "What will need repair next",
        "prefers-color-scheme: dark",
        "width=device-width",
    ):
        assert text in page
    images = _Images()
    images.feed(page)
    (image,) = images.found
    assert "16 recordings" in str(image["alt"]) and str(image["src"]).startswith("data:image/svg")
    assert "max-width: 700px" in page, "a phone has a plot of its own"
    assert not re.search(r"(src|href)=\"http", page)
