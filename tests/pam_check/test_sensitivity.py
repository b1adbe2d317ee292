"""The sensitivity table of a campaign, made from evidence that its diagnoses kept."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

from pam_check.__main__ import main
from pam_check.blind.sensitivity import (
    Campaign,
    diagnosed_again,
    sensitivity,
    to_markdown,
)
from pam_gap.diagnosis_files import IMPROVED_RIG
from pam_gap.inference.decide import decide, decided_answer
from pam_gap.inference.evidence import Evidence
from pam_gap.inference.score import Score
from pam_gap.rules import DEFAULT, table
from pam_gap.rules.rule import DECISION
from pam_gap.rules.statement import STATEMENT
from pam_model.errors import PamError

SENSITIVITY = "pam_check.blind.sensitivity"


def score(effects: tuple[str, ...], rms: float) -> Score:
    counts = np.full((12, 3), 40.0)
    return Score(effects, " + ".join(effects), len(effects), counts * rms**2, counts)


def kept(nominal: float, best: float) -> Evidence[Score]:
    """Creep leaves `best` of an RMS error of `nominal` floors."""
    creep = score(("creep",), best)
    return Evidence(
        floor=np.ones(3),
        background=np.zeros(3),
        present=np.ones(3, dtype=bool),
        motion=np.zeros(3),
        written=score((), nominal + 1.0),
        nominal=score((), nominal),
        tried=(creep, score(("leakage",), nominal)),
        singles=("creep", "leakage"),
        stages=(),
        settled={0: creep},
    )


CASES = {
    # hardly more than noise: named, and `none` where a false name costs 30 % more
    "000": ("one", ["creep"], kept(1.26, 1.0)),
    "001": ("one", ["creep"], kept(8.0, 1.1)),
    "002": ("none", [], kept(1.05, 1.0)),
    "003": ("outside", ["backlash"], kept(8.0, 6.5)),
}


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """The folder of a finished campaign."""
    labels = []
    for name, (kind, effects, evidence) in CASES.items():
        place = tmp_path / "answers" / name
        place.mkdir(parents=True)
        answer = decided_answer(evidence, decide(evidence, DEFAULT), DEFAULT)
        (place / "diagnosis.json").write_text(json.dumps(answer))
        evidence.save(place / "evidence.npz")
        labels.append(
            {"case": name, "kind": kind, "effects": effects, "stages": ["muscle"] * len(effects),
             "gap_over_floor": 10.0}
        )  # fmt: skip
    (tmp_path / "sealed").mkdir()
    text = json.dumps(labels)
    (tmp_path / "sealed" / "labels.json").write_text(text)
    digest = hashlib.sha256(text.encode()).hexdigest()
    (tmp_path / "score.json").write_text(json.dumps({"labels_sha256": digest}))
    return tmp_path


def test_the_constants_in_use_give_every_stored_verdict_again(campaign: Path) -> None:
    read = Campaign.read(campaign)
    read.check()
    answers, inexact = read.decided(DEFAULT)
    assert inexact == 0
    verdicts = [answers[name]["verdict"] for name in sorted(answers)]
    assert verdicts == ["named", "named", "none", "unknown"]


def test_a_verdict_that_the_evidence_does_not_give_is_refused(campaign: Path) -> None:
    place = campaign / "answers" / "001" / "diagnosis.json"
    place.write_text(json.dumps(json.loads(place.read_text()) | {"verdict": "unknown"}))
    with pytest.raises(PamError, match="other verdicts for 001"):
        sensitivity(Campaign.read(campaign))


def test_rules_of_another_version_are_compared_with_the_stored_verdicts(
    campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A campaign of older rules is decided again, and every answer that changes is told."""
    assert main(["decide-again", str(campaign)]) == 0
    assert "0 answers change" in capsys.readouterr().out
    stored = campaign / "answers" / "001" / "diagnosis.json"
    answer = json.loads(stored.read_text())
    stored.write_text(json.dumps(answer | {"verdict": "unknown", "effects": [], "stage": None}))
    assert main(["decide-again", str(campaign)]) == 0
    told = capsys.readouterr().out
    assert "001: creep hidden; unknown -> named creep" in told
    assert "1 answers change" in told
    (both,) = [line for line in told.splitlines() if line.startswith("truth_in_set ")]
    # before and after, each with its interval, and of how many
    assert re.fullmatch(r"truth_in_set +1 \(3% to 97%\) +2 \(22% to 100%\) +2", both)
    assert "surprise after" in told


def test_a_change_is_counted_as_the_blind_check_counts(campaign: Path) -> None:
    rows = sensitivity(Campaign.read(campaign), only=["statement.false_name", "statement.hidden"])
    down, up, *others = rows
    in_use = (STATEMENT.false_name, STATEMENT.hidden)
    assert [row.value for row in rows] == pytest.approx(
        [factor * value for value in in_use for factor in (0.7, 1.3)]
    )
    assert [row.moved for row in (down, *others)] == [0, 0, 0]
    assert (up.moved, up.before["top1"], up.counts["top1"]) == (1, (2, 2), (1, 2))
    assert "1/2 (was 2/2)" in to_markdown(rows)


@pytest.mark.long("the tests around it change some of the constants, and read the same table")
def test_every_constant_has_its_rows_and_the_table_says_how(campaign: Path) -> None:
    assert main(["sensitivity", str(campaign)]) == 0
    rows = json.loads((campaign / "sensitivity.json").read_text())
    assert len(rows) == 2 * len(table())
    decided = {row["constant"] for row in rows if row["how"] == "decided again"}
    assert decided == {entry.path for entry in table() if entry.acts == DECISION}
    assert {row["how"] for row in rows} == {"decided again", "not run", "changes no verdict"}
    page = (campaign / "sensitivity.md").read_text()
    assert "Not run: " in page
    assert "| `statement.false_name` | 1 | 1.3 | decided again | 4 | 1 |" in page
    assert "no verdict or count moved: " in page


def test_a_larger_change_is_an_option(campaign: Path) -> None:
    only = ["--only", "statement.false_name"]
    assert main(["sensitivity", str(campaign), "--percent", "10", *only]) == 0
    rows = json.loads((campaign / "sensitivity.json").read_text())
    assert [row["changed_to"] for row in rows] == pytest.approx([0.9, 1.1])
    assert [row["verdicts_moved"] for row in rows] == [0, 0]


def test_a_folder_without_evidence_is_a_mistake_of_the_user(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (campaign / "answers" / "002" / "evidence.npz").unlink()
    assert main(["sensitivity", str(campaign)]) == 2
    assert "--keep-evidence" in capsys.readouterr().err
    (tmp_path / "empty").mkdir()
    assert main(["sensitivity", str(tmp_path / "empty")]) == 2
    assert "no finished campaign" in capsys.readouterr().err


def test_labels_that_were_not_sealed_are_refused(campaign: Path) -> None:
    labels = campaign / "sealed" / "labels.json"
    labels.write_text(labels.read_text().replace("creep", "leakage"))
    with pytest.raises(PamError, match="not the labels that were sealed"):
        Campaign.read(campaign)


def test_a_new_diagnosis_is_scored_on_the_second_recording_too(
    campaign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without it, every row of a new diagnosis says that no interval could be checked."""

    class Found:
        def to_json(self) -> dict[str, object]:
            return {"verdict": "named", "closed": {"value": 0.9, "low": 0.8, "high": 0.95}}

    def diagnosed(recordings: list[Path], rig: Path, out: Path, **_: object) -> list[Found]:
        out.mkdir(parents=True)
        (out / IMPROVED_RIG).write_text("")
        return [Found()]

    compared: list[tuple[Path, Path, Path]] = []

    def closed(written: Path, improved: Path, recording: Path) -> float:
        compared.append((written, improved, recording))
        return 0.85

    monkeypatch.setattr(f"{SENSITIVITY}.diagnose_files", diagnosed)
    monkeypatch.setattr("pam_check.blind.untouched.untouched_closed", closed)
    out = campaign / "again"
    answer = diagnosed_again((campaign, "001", DEFAULT, out))
    assert answer["closed"]["untouched"] == 0.85
    place = campaign / "cases" / "001" / "rig.yaml"
    sealed = campaign / "sealed" / "001" / "recording.csv.gz"
    assert compared == [(place, out / IMPROVED_RIG, sealed)]
