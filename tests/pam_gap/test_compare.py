"""Diagnoses side by side: a change is told where it is more than noise, and nowhere else."""

import json
import math
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from pam_gap.__main__ import main
from pam_gap.answer.compare import Answer, compare, difference

CHANNEL = "joint_states.elbow.position"


def interval(value, reach=0.05):
    return {"value": value, "low": value - reach, "high": value + reach, "unit": "N m"}


def content(torque=None, verdict=None, joint="elbow", **changes):
    found = {} if torque is None else {"coulomb_friction": {"torque": interval(torque)}}
    named = "named" if found else "none"
    size = {"motion": 0.8, "before": 0.0071, "retuned": 0.006, "after": 0.0004, "limit": 0.0008,
            "limit_unexplained": 0.0024, "unit": "rad"}  # fmt: skip
    return {
        "verdict": verdict or named, "joint": joint, "effects": list(found), "parameters": found,
        "gap": {}, "closed": None, "sentence": "The cause is <dry> friction.", "not_shown": [],
        "materiality": {"channels": {CHANNEL: size}},
    } | changes  # fmt: skip


def folder(place: Path, **given) -> Path:
    place.mkdir(parents=True)
    (place / "diagnosis.json").write_text(json.dumps(content(**given)))
    return place


def compared(first, *others):
    groups = [[Answer(name, c)] for name, c in zip("ABC", (first, *others), strict=False)]
    (joint,) = compare(groups)
    return joint


def judged(first, other):
    ((change,),) = [row.differences for row in compared(first, other).parameters]
    return change


def test_a_difference_within_the_intervals_is_noise_and_a_larger_one_is_not():
    assert not judged(content(0.50), content(0.56)).sure
    change = judged(content(0.50), content(0.80))
    assert change.sure and "rose" in change.words
    assert change.z == pytest.approx(0.3 / (math.hypot(0.05, 0.05) / 1.645))
    assert judged(content(0.80), content(0.50)).z == pytest.approx(-change.z)


def test_equal_rigs_differ_in_five_percent_of_draws():
    random = np.random.default_rng(0)
    values = 0.5 + random.normal(0.0, 0.05 / 1.645, (4000, 2))
    sure = [difference(interval(a), interval(b))[1] for a, b in values.tolist()]
    assert np.mean(sure) == pytest.approx(0.05, abs=0.012)


def test_the_halves_of_the_intervals_that_face_each_other_count():
    low = {"value": 0.0, "low": 0.0, "high": 0.1}  # at a bound
    high = {"value": 0.3, "low": 0.1, "high": 0.3}
    z, _ = difference(low, high)
    assert z == pytest.approx(0.3 / (math.hypot(0.1, 0.2) / 1.645))


def test_an_effect_that_is_gone_is_told_and_judged_against_no_effect():
    gone = judged(content(0.5), content())
    assert gone.sure and gone.words.startswith("gone, 16.")
    assert not judged(content(0.04), content()).sure
    assert judged(content(), content(0.5)).words.startswith("new, 16.")


def test_a_recording_that_could_not_show_the_effect_is_no_repair():
    blind = judged(content(0.5), content(not_shown=["coulomb_friction"]))
    assert not blind.sure and "could not show" in blind.words
    assert "unknown" in judged(content(0.5), content(verdict="unknown")).words


def test_equal_values_without_intervals_are_no_change():
    sharp = content(0.5, parameters={"coulomb_friction": {"torque": interval(0.5, 0.0)}})
    assert not judged(sharp, sharp).sure


def test_three_diagnoses_are_compared_with_the_first():
    joint = compared(content(0.5), content(0.5), content())
    assert [d.sure for d in joint.parameters[0].differences] == [False, True]
    assert any(text.startswith("C: the verdict changed") for text in joint.changes)


class _Images(HTMLParser):
    alt = ""

    def handle_starttag(self, tag, attrs):
        if tag == "img":
            self.alt = str(dict(attrs)["alt"])


def test_different_rig_files_are_a_caution():
    """A corrected rig file changes every value although the robot stayed the same."""

    def rig(path, digest):
        return {"provenance": {"rig": {"path": path, "sha256": digest}}}

    old, new = rig("old.yaml", "1"), rig("new.yaml", "2")
    told = compared(content(0.5, **old), content(0.1, **new)).caution
    assert "different rig files (A: old.yaml, B: new.yaml)" in told
    assert compared(content(0.5, **old), content(0.5, **rig("copy.yaml", "1"))).caution == ""
    assert compared(content(0.5, **old), content(0.5)).caution == ""


def test_the_command_writes_page_table_and_json(tmp_path, capsys):
    before, after = folder(tmp_path / "a", torque=0.5), folder(tmp_path / "b")
    line = ["compare", str(before), str(after), "--out", str(tmp_path / "out")]
    assert main(line) == 0
    shown = capsys.readouterr().out
    assert "Coulomb friction, torque: gone, 16." in shown and "7.1 mrad" in shown
    page = (tmp_path / "out" / "compare.html").read_text()
    assert "&lt;dry&gt;" in page and "<dry>" not in page
    for text in ("7.1 mrad", "0.5 (0.45 to 0.55) N m", "prefers-color-scheme: dark",
                 "width=device-width", "z-test"):  # fmt: skip
        assert text in page
    images = _Images()
    images.feed(page)
    assert "7.1 mrad as written" in images.alt
    assert main([*line, "--json", "--check"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["joints"][0]["changes"]
    assert main([*line[:1], str(before), str(before), *line[3:], "--check"]) == 0


def test_mistakes_are_one_line(tmp_path, capsys):
    good = folder(tmp_path / "a", torque=0.5)
    other = folder(tmp_path / "b", joint="wrist")
    (tmp_path / "text.json").write_text("no json")
    (tmp_path / "list.json").write_text("{}")
    (tmp_path / "empty").mkdir()
    for second, said in (
        (other, "diagnosis of wrist; expected elbow"),
        (tmp_path / "text.json", "not a diagnosis: no JSON"),
        (tmp_path / "list.json", "not a diagnosis; expected the keys"),
        (tmp_path / "empty", "no diagnosis.json in this folder"),
        (tmp_path / "missing", "no such file or folder"),
        (None, "only one diagnosis"),
    ):
        given = [str(good)] + ([str(second)] if second else [])
        assert main(["compare", *given, "--out", str(tmp_path / "out")]) == 2
        error = capsys.readouterr().err
        assert said in error and error.count("\n") == 1


def test_joints_in_folders_are_compared_one_by_one(tmp_path):
    for run, torque in (("before", 0.5), ("after", 0.9)):
        for joint in ("elbow", "wrist"):
            folder(tmp_path / run / joint, torque=torque, joint=joint)
    assert main(["compare", str(tmp_path / "before"), str(tmp_path / "after"),
                 "--out", str(tmp_path / "out")]) == 0  # fmt: skip
    page = (tmp_path / "out" / "compare.html").read_text()
    assert "<h2>elbow</h2>" in page and "<h2>wrist</h2>" in page
