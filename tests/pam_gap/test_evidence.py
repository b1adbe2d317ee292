"""Verdicts decided again from kept evidence, with the same constants and with others."""

from __future__ import annotations

import ast
import contextlib
from dataclasses import FrozenInstanceError, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pam_gap
from pam_gap.__main__ import main
from pam_gap.inference.decide import close_calls, decide, decided_answer
from pam_gap.inference.evidence import Evidence, load_evidence
from pam_gap.inference.score import Score
from pam_gap.prediction.locate import StageGap
from pam_gap.rules import DEFAULT, Rules, changed
from pam_model.errors import PamError

BLOCKS, CHANNELS = 20, 3


def score(effects: tuple[str, ...], rms: float) -> Score:
    """A score with this RMS error over floor in every channel."""
    generator = np.random.default_rng(len(effects) + round(10 * rms))
    spread = np.exp(0.05 * generator.standard_normal((BLOCKS, CHANNELS)))
    counts = np.full((BLOCKS, CHANNELS), 40.0)
    sums = counts * rms**2 * spread / spread.mean(axis=0)
    return Score(effects, " + ".join(effects), len(effects), sums, counts)


def evidence(**changes: object) -> Evidence[Score]:
    """Creep explains what is left; coupled with a leak it explains a little more."""
    tried = (
        score(("creep",), 1.2),
        score(("hysteresis",), 3.0),
        score(("leakage",), 4.0),
        score(("creep", "leakage"), 1.15),
    )
    kept = Evidence(
        floor=np.ones(CHANNELS),
        background=np.zeros(CHANNELS),
        present=np.array([True, True, True]),
        motion=np.zeros(CHANNELS),
        written=score((), 9.0),
        nominal=score((), 6.0),
        tried=tried,
        settled={0: score(("creep",), 1.1)},
        singles=("creep", "hysteresis", "leakage"),
        stages=(StageGap("valve", "commands", 1.1), StageGap("muscle", "pressures", 4.0)),
    )
    return replace(kept, **changes)


def answer(kept: Evidence[Score], rules: Rules = DEFAULT) -> dict[str, Any]:
    """What the decision gives of diagnosis.json."""
    return decided_answer(kept, decide(kept, rules), rules)


def test_evidence_read_back_gives_the_same_decision(tmp_path: Path) -> None:
    kept = evidence()
    kept.save(tmp_path / "evidence.npz")
    read = load_evidence(tmp_path / "evidence.npz")
    first = answer(kept)
    assert first == answer(read)
    assert decide(read, DEFAULT).is_exact
    assert first["verdict"] == "named"
    assert first["effects"] == ["creep"]
    assert first["stage"] == "muscle"
    assert 0.9 < first["closed"]["value"] <= 1.0


@pytest.mark.parametrize(
    ("path", "value", "verdict", "effects"),
    [
        ("decision.material_share", 0.5, "none", []),
        ("statement.outside", 1e30, "unknown", []),
        ("decision.motion_spread", 0.9, "named", ["creep"]),
    ],
)
def test_another_constant_gives_another_verdict(
    path: str, value: float, verdict: str, effects: list[str]
) -> None:
    found = answer(evidence(motion=np.full(CHANNELS, 20.0**2)), changed(path, value))
    assert found["verdict"] == verdict
    assert found["effects"] == effects


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ("silence=-1", "statement.silence=-1: expected a number above 0"),
        ("outside=nan", "statement.outside=nan: expected a number above 0"),
        ("law_error=0.1", "unknown belief 'law_error'"),
        ("out_side=0.1", "did you mean outside"),
        ("outside", "expected NAME=NUMBER"),
    ],
)
def test_beliefs_that_make_no_sense_are_refused(
    given: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("log.csv", "rig.yaml"):
        (tmp_path / name).touch()
    files = [str(tmp_path / "log.csv"), "--rig", str(tmp_path / "rig.yaml")]
    arguments = ["diagnose", *files, "--out", str(tmp_path / "out"), "--belief", given]
    with contextlib.suppress(SystemExit):  # of a mistake in the form
        assert main(arguments) == 2
    assert told in capsys.readouterr().err


def test_a_cost_that_is_set_reaches_the_decision() -> None:
    weak = evidence(nominal=score((), 1.5), tried=(score(("creep",), 1.1),), settled={})
    assert answer(weak)["verdict"] == "named"
    dear = changed("statement.false_name", 30.0)
    assert answer(weak, dear)["verdict"] == "none"
    assert answer(weak, dear)["probabilities"] == answer(weak)["probabilities"]


def test_a_wider_spread_widens_the_interval_alone() -> None:
    plain = answer(evidence(), DEFAULT)
    wide = answer(evidence(), changed("decision.motion_spread", 0.9))
    assert wide["closed"]["low"] < plain["closed"]["low"]
    assert wide | {"closed": 0} == plain | {"closed": 0}


def test_the_stage_of_unknown_needs_a_gap() -> None:
    unknown = changed("statement.outside", 1e30)
    assert answer(evidence(), unknown)["stage"] == "muscle"
    deaf = changed("prediction.stage_from", 5.0, unknown)
    assert answer(evidence(), deaf)["stage"] is None


def test_a_fit_that_was_never_made_is_told() -> None:
    """The pair was not fitted to its end, since it was improbable with the constants in use."""
    assert not decide(evidence(), changed("search.completed_from", 1e-6)).is_exact
    assert not decide(evidence(settled={}), DEFAULT).is_exact


def test_only_what_is_probable_is_completed() -> None:
    assert close_calls(evidence(), DEFAULT) == (0,)
    alike = evidence(tried=(score(("creep",), 1.2), score(("hysteresis",), 1.2)), settled={})
    assert close_calls(alike, DEFAULT) == (0, 1)
    nothing = evidence(nominal=score((), 1.0), written=score((), 1.0))
    assert close_calls(nothing, DEFAULT) == ()


def test_a_cause_outside_the_table_that_leaves_less_makes_the_verdict_unknown(
    tmp_path: Path,
) -> None:
    """An eccentric encoder looks almost like an offset, which must not be named then."""
    encoder = replace(score((), 1.0), unlisted="an eccentricity of the encoder", free_numbers=2)
    offset = score(("creep",), 1.4)  # so close that it would be named for it
    kept = evidence(unlisted=(encoder,), tried=(offset,), settled={})
    kept.save(tmp_path / "evidence.npz")
    read = load_evidence(tmp_path / "evidence.npz")
    assert answer(read, DEFAULT)["verdict"] == "unknown"
    worse = replace(score((), 1.5), unlisted="a drift", free_numbers=1)
    assert answer(evidence(unlisted=(worse,)), DEFAULT)["effects"] == ["creep"]


def test_the_decision_is_made_in_one_place() -> None:
    """Lengths that are wrong are the only other explanation that is weighed."""
    parts = {"posterior", "least_cost"}
    package = Path(pam_gap.__file__).parent
    users = {
        path.relative_to(package).as_posix()
        for path in package.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and node.module == "pam_gap.inference.posterior"
        if parts & {name.name for name in node.names}
    }
    assert users == {"inference/decide.py", "inference/loose_lengths.py"}


def test_what_goes_in_and_what_comes_out_is_frozen() -> None:
    kept = evidence()
    for one, name in ((kept, "tried"), (decide(kept, DEFAULT), "effects")):
        with pytest.raises(FrozenInstanceError):
            setattr(one, name, ())


def test_a_file_that_is_no_evidence_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "evidence.npz"
    path.write_bytes(b"nothing")
    with pytest.raises(PamError, match="not the evidence of a diagnosis"):
        load_evidence(path)
    with pytest.raises(PamError, match="not the evidence of a diagnosis"):
        load_evidence(tmp_path / "missing.npz")


def test_what_is_closed_is_that_of_the_improved_rig_file(tmp_path: Path) -> None:
    better = replace(score(("creep", "hysteresis"), 1.05), ordinary=("hysteresis",))
    kept = evidence(improved=better, improved_for="creep")
    kept.save(tmp_path / "evidence.npz")
    read = answer(load_evidence(tmp_path / "evidence.npz"), DEFAULT)
    plain = answer(evidence(), DEFAULT)
    assert read["closed"]["value"] > plain["closed"]["value"]
    assert read | {"closed": 0} == plain | {"closed": 0}
    without = answer(evidence(improved=None, improved_for="creep"), DEFAULT)
    assert without == plain | {"closed": None}  # no file improves the rig
