"""All checks take effects from one table: a row there is all that they need."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from pam_check.blind.cases import make_case
from pam_check.blind.draw import Draw, believed_rig, draw_excitation
from pam_check.blind.effect_cases import (
    KNOWN,
    OUTSIDE,
    EffectCase,
    TrueValue,
    case_of,
    size_of,
    stage_of,
)
from pam_check.blind.hidden_size import HiddenSize
from pam_check.blind.parameter_coverage import stated_parameters
from pam_check.blind.plants import PLANTS
from pam_check.blind.truth_plant import TruthJoint, TruthMuscle
from pam_check.blind.variety import Variety
from pam_check.control.closed_loop import true_rig
from pam_check.control.hidden_rigs import chosen_rigs
from pam_model.effects import EFFECTS
from pam_model.errors import PamError
from pam_model.rig import load_rig
from support.rigs import ELBOW
from support.source_tree import ROOT, python_files

TABLE = ROOT / "proof/pam_check/blind/effect_cases.py"
MOST_NAMES = 3
"""A check may single out an effect or two; more of them are a table."""


def test_every_effect_has_a_row_and_every_row_is_complete() -> None:
    assert list(KNOWN) == list(EFFECTS)
    assert not KNOWN.keys() & OUTSIDE.keys()
    fields = {*TruthJoint._fields, *TruthMuscle._fields}
    for name in (*KNOWN, *OUTSIDE):
        case = case_of(name)
        assert case.first_law, name
        assert case.second_law, name
        assert set(case.magnitudes) <= fields, name
        assert stage_of(name) in {"valve", "muscle", "joint", "sensing"}, name
        assert (case.size is None) == (name in OUTSIDE), name
        assert bool(case.stage) == (name in OUTSIDE), name
        joint, muscle = believed_rig(np.random.default_rng(1))
        draw = Draw(np.random.default_rng(2), joint, [muscle, muscle])
        case.draw(draw)
        changed = (draw.joint, *draw.muscles)
        assert changed != (joint, muscle, muscle), name
        differing = {
            field
            for before, after in zip((joint, muscle, muscle), changed, strict=True)
            for field in before._fields
            if getattr(before, field) != getattr(after, field)
        }
        assert set(case.magnitudes) <= differing, name


def tables(source: str) -> Iterator[int]:
    """Lines of literals with more than a few names of effects."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Dict):
            entries = [key for key in node.keys if key is not None]
        elif isinstance(node, ast.Set | ast.List | ast.Tuple):
            entries = list(node.elts)
        else:
            continue
        names = {
            part.value
            for entry in entries
            for part in (entry.elts if isinstance(entry, ast.Tuple) else [entry])
            if isinstance(part, ast.Constant) and part.value in KNOWN
        }
        # an effect and the field of the drawn rig that it changes may have the same name
        if len(names - {*TruthJoint._fields, *TruthMuscle._fields}) > MOST_NAMES:
            yield node.lineno


def test_no_other_check_and_no_benchmark_has_a_table_of_effects() -> None:
    files = [*python_files("pam_check"), *sorted((ROOT / "benchmarks").rglob("*.py"))]
    found = {
        str(path.relative_to(ROOT)): lines
        for path in files
        if path != TABLE and (lines := list(tables(path.read_text(encoding="utf-8"))))
    }
    assert found == {}


@pytest.mark.parametrize("start", ["{%s}", "[%s]", "{%s: 1}"])
def test_the_rule_finds_a_second_table(start: str) -> None:
    names = list(KNOWN)[: MOST_NAMES + 1]
    between = ": 1, " if ":" in start else ", "
    assert list(tables(start % between.join(repr(name) for name in names)))
    assert not list(tables(start % between.join(repr(name) for name in names[:-1])))


WORN_VALVE = EffectCase(
    lambda d: d.both(dead_zone=d.span(0.05, 0.06), leak=1e-10),
    "rounded edges and a laminar leak",
    "clearance and flow in a gap",
    ("dead_zone", "leak"),
    HiddenSize("a valve after ten years", muscles=({"leak": 1e-10}, {"leak": 1e-10})),
    stage="valve",
    fades_behind_a_regulator=True,
    of_muscle={"leak": TrueValue(lambda m, _: m["leak"])},
)


def test_a_row_is_all_that_the_checks_need(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw, both plants, label, coverage, regulators and the hidden size of the control check."""
    with pytest.raises(PamError, match="worn_valve: unknown"):
        chosen_rigs("--effects", ["worn_valve"], [])
    monkeypatch.setitem(KNOWN, "worn_valve", WORN_VALVE)
    monkeypatch.setattr("pam_check.blind.cases.drawn_effects", lambda *_: ["worn_valve"])
    short = partial(draw_excitation, duration=10.0)
    monkeypatch.setattr("pam_check.blind.cases.draw_excitation", short)
    for plant in PLANTS:
        label = make_case(
            "000", "one", tmp_path / plant, tmp_path / "sealed" / plant,
            np.random.default_rng(3), plant=plant, write=lambda *_: None,
        )  # fmt: skip
        assert (label.effects, label.stages) == (["worn_valve"], ["valve"])
        assert label.gap_over_floor > 3.0
    stated = {"leak": {"low": 0.5e-10, "value": 1e-10, "high": 2e-10, "unit": "-"}}
    answer = {"effects": ["worn_valve"], "parameters": {"worn_valve": stated}}
    labels = [{"case": "000", "effects": label.effects, "joint": label.joint,
               "muscles": label.muscles}]  # fmt: skip
    (found,) = stated_parameters(labels, {"000": answer}, tmp_path / "first")
    assert found.true == pytest.approx(1e-10)
    assert found.is_covered
    assert "worn_valve" in Variety(regulator_time=0.02).hidden
    assert chosen_rigs("--effects", ["worn_valve"], []) == ["worn_valve"]
    _, muscles = size_of("worn_valve").applied(*true_rig(load_rig(ELBOW)))
    assert [muscle.leak for muscle in muscles] == [1e-10, 1e-10]


def test_a_row_without_a_size_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(KNOWN, "worn_valve", replace(WORN_VALVE, size=None))
    with pytest.raises(ValueError, match="states no size of worn_valve"):
        size_of("worn_valve")
