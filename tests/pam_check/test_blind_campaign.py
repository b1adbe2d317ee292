"""A blind campaign: what it counts, and how it goes on after an interruption."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from pam_check.blind.campaign import diagnose_case, run_campaign
from pam_check.blind.score import reliability, reliability_of_causes
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

    def draw(cases: int, seed: int, out: Path, background: bool) -> str:
        names = [f"{k:03d}" for k in range(cases)]
        for name in names:
            (out / "cases" / name).mkdir(parents=True)
        text = json.dumps([label("none", [], name) for name in names])
        (out / "sealed").mkdir()
        (out / "sealed" / "labels.json").write_text(text)
        return hashlib.sha256(text.encode()).hexdigest()

    def diagnose(case: Path, out: Path, *_options: object) -> dict[str, object]:
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
    monkeypatch.setattr(f"{CAMPAIGN}.diagnose_case", diagnose)
    monkeypatch.setattr(f"{CAMPAIGN}.draw_confusion", lambda pairs, path: None)
    with pytest.raises(PamError, match="no campaign to resume"):
        run_campaign(2, 5, tmp_path, 1, resume=True)
    with pytest.raises(RuntimeError, match="went off"):
        run_campaign(2, 5, tmp_path, 1)
    with pytest.raises(PamError, match="give another --out, or --resume"):
        run_campaign(2, 5, tmp_path, 1)
    with pytest.raises(PamError, match="give the same --cases, --seed and --background"):
        run_campaign(2, 6, tmp_path, 1, resume=True)
    result = run_campaign(2, 5, tmp_path, 1, resume=True)
    assert begun == ["000", "001", "001"]
    assert result["shares"]["false_name_on_clean"]["of"] == 2


@pytest.mark.parametrize("experiment", [False, True])
def test_a_campaign_seeks_an_experiment_only_if_it_is_run(
    experiment: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[str] = []

    def run(command: list[str], **_options: object) -> SimpleNamespace:
        given.extend(command)
        return SimpleNamespace(returncode=1, stderr="")

    monkeypatch.setattr("subprocess.run", run)
    assert diagnose_case(tmp_path, tmp_path, experiment=experiment)["verdict"] == "crash"
    assert ("--answer-only" in given) is not experiment
