"""A blind campaign: what it counts, and how it goes on after an interruption."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest
from matplotlib.axes import Axes

from pam_check.blind import diagnosing_process
from pam_check.blind.campaign import DrawnFrom, run_campaign
from pam_check.blind.diagnosing_process import DiagnosingProcess
from pam_check.blind.score import reliability, reliability_of_causes
from pam_check.blind.score_plots import draw_reliability
from pam_model.errors import PamError

CAMPAIGN = "pam_check.blind.campaign"


def label(kind: str, effects: list[str], case: str) -> dict[str, object]:
    return {"case": case, "kind": kind, "effects": effects, "stages": [], "gap_over_floor": 9.0}


def test_reliability_compares_the_stated_probability_with_what_was_hidden() -> None:
    labels = [
        label("one", ["leakage"], "000"),
        label("two", ["payload", "leakage"], "001"),
        label("none", [], "002"),
        label("outside", ["backlash"], "003"),
        label("one", ["creep"], "004"),
    ]
    answers = {
        "000": {"probabilities": {"leakage": 0.9, "none": 0.1}},
        "001": {"probabilities": {"payload": 0.85, "leakage + payload": 0.15}},
        "002": {"probabilities": {"none": 1.0}},
        "003": {"probabilities": {"unknown": 0.6, "creep": 0.4}},
        "004": {"probabilities": {}},
    }
    table = reliability(labels, answers)
    assert [(row["right"]["hits"], row["right"]["of"]) for row in table] == [
        (0, 0), (1, 1), (1, 2), (1, 1),
    ]  # fmt: skip
    assert table[2]["stated_mean"] == pytest.approx(0.875)


def test_a_cause_counts_with_all_explanations_that_contain_it() -> None:
    labels = [label("one", ["leakage"], "000"), label("outside", ["backlash"], "001")]
    answers = {
        "000": {
            "verdict": "named",
            "effects": ["leakage", "creep"],
            "probabilities": {"leakage": 0.6, "creep + leakage": 0.3, "unknown": 0.1},
        },
        "001": {
            "verdict": "named",
            "effects": ["creep"],
            "probabilities": {"creep": 0.85, "unknown": 0.15},
        },
    }
    table = reliability_of_causes(labels, answers)
    assert [(row["right"]["hits"], row["right"]["of"]) for row in table] == [
        (0, 1), (0, 0), (1, 2), (0, 0),
    ]  # fmt: skip
    assert table[2]["stated_mean"] == pytest.approx(0.875)


def test_an_interrupted_campaign_goes_on_where_it_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[str] = []

    def draw(drawn: DrawnFrom, out: Path) -> str:
        names = [f"{k:03d}" for k in range(drawn.cases)]
        for name in names:
            (out / "cases" / name).mkdir(parents=True)
        text = json.dumps([label("none", [], name) for name in names])
        (out / "sealed").mkdir()
        (out / "sealed" / "labels.json").write_text(text)
        return hashlib.sha256(text.encode()).hexdigest()

    def diagnose(_process: DiagnosingProcess, case: Path, out: Path) -> dict[str, object]:
        begun.append(case.name)
        if begun == ["000", "001"]:
            raise RuntimeError("the machine went off")
        out.mkdir(parents=True)
        found = {
            "verdict": "none", "effects": [], "indistinguishable": [], "candidates": [],
            "facts": {"seconds": 2.0},
        }  # fmt: skip
        (out / "diagnosis.json").write_text(json.dumps(found))
        return found | {"wall_time": 2.0}

    monkeypatch.setattr(f"{CAMPAIGN}.draw_sealed", draw)
    monkeypatch.setattr(DiagnosingProcess, "diagnose", diagnose)
    with pytest.raises(PamError, match="no campaign to resume"):
        run_campaign(2, 5, tmp_path, 1, resume=True)
    with pytest.raises(RuntimeError, match="went off"):
        run_campaign(2, 5, tmp_path, 1)
    with pytest.raises(PamError, match="give another --out, or --resume"):
        run_campaign(2, 5, tmp_path, 1)
    with pytest.raises(PamError, match="the same --cases, --seed, --background, --varied and"):
        run_campaign(2, 6, tmp_path, 1, resume=True)
    result = run_campaign(2, 5, tmp_path, 1, resume=True)
    assert begun == ["000", "001", "001"]
    assert result["shares"]["false_name_on_clean"]["of"] == 2
    for picture in ("confusion.png", "reliability.png"):
        assert (tmp_path / picture).stat().st_size > 5000


def test_the_picture_of_reliability_shows_every_class_that_has_answers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    labels = [label("one", ["creep"], f"{k:03d}") for k in range(4)]
    stated = {"000": 0.9, "001": 0.9, "002": 0.3, "003": 0.3}
    answers = {
        case: {"verdict": "named", "effects": ["creep"], "probabilities": {"creep": p, "none": 0.2}}
        for case, p in stated.items()
    }
    shown: list[str] = []
    monkeypatch.setattr(Axes, "annotate", lambda _, text, *__, **___: shown.append(text))
    result = {
        "reliability": reliability(labels, answers),
        "reliability_of_causes": reliability_of_causes(labels, answers),
    }
    draw_reliability(result, tmp_path / "reliability.png")
    assert shown == ["2 of 2"] * 4


def broken_case(folder: Path, name: str) -> Path:
    case = folder / name
    case.mkdir()
    (case / "rig.yaml").write_text("joints: [elbow]\n")
    (case / "recording.csv.gz").write_bytes(b"")
    return case


def test_a_case_that_fails_is_counted_and_the_next_one_is_diagnosed(tmp_path: Path) -> None:
    with DiagnosingProcess() as process:
        for name in ("000", "001"):
            answer = process.diagnose(broken_case(tmp_path, name), tmp_path / "answers" / name)
            assert answer["verdict"] == "crash"
            assert f"{name}/rig.yaml" in answer["error"]


def test_a_process_that_is_killed_costs_one_case(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = broken_case(tmp_path, "000")
    with DiagnosingProcess() as process:
        with monkeypatch.context() as killed:
            killed.setattr(diagnosing_process, "DIAGNOSE_CASES", "no_such_program")
            answer = process.diagnose(case, tmp_path / "answers")
        assert answer["verdict"] == "crash"
        assert "no_such_program" in answer["error"]
        assert "rig.yaml" in process.diagnose(case, tmp_path / "answers")["error"]


@pytest.mark.parametrize("experiment", [False, True])
def test_a_campaign_seeks_an_experiment_only_if_it_is_run(
    experiment: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: dict[str, object] = {}
    monkeypatch.setattr(
        diagnosing_process, "diagnose_files", lambda *_files, **options: given.update(options)
    )
    with DiagnosingProcess(experiment=experiment) as process:
        assert diagnosing_process._diagnose(process.task(tmp_path, tmp_path)) == ""
    assert given["answer_only"] is not experiment
