"""Whether the interval of a parameter holds the true value is counted for comparable parameters."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pam_check.blind.cases import Label, make_case
from pam_check.blind.effect_cases import KNOWN
from pam_check.blind.parameter_coverage import (
    StatedParameter,
    as_json,
    by_parameter,
    stated_parameters,
)
from pam_check.blind.plants import FIRST
from pam_model.effects import EFFECTS
from pam_model.rig import load_rig

SECOND = "second"


def drawn(folder: Path, monkeypatch: pytest.MonkeyPatch, *effects: str) -> Label:
    """A case with these hidden effects, without its recordings."""
    monkeypatch.setattr("pam_check.blind.cases.drawn_effects", lambda *_: list(effects))
    random = np.random.default_rng(3)
    return make_case("000", "two", folder, folder, random, write=lambda *_: None)


def answer(effect: str, **parameters: tuple[float, float, float]) -> dict[str, object]:
    stated = {
        name: {"low": low, "value": value, "high": high, "unit": "-"}
        for name, (low, value, high) in parameters.items()
    }
    return {"verdict": "named", "effects": [effect], "parameters": {effect: stated}}


def as_label(label: Label) -> dict[str, object]:
    return {
        "case": label.case, "kind": label.kind, "effects": label.effects,
        "joint": label.joint, "muscles": label.muscles,
    }  # fmt: skip


def test_every_comparable_parameter_is_one_of_an_effect_that_is_drawn() -> None:
    named = [(effect, {*case.of_joint, *case.of_muscle}) for effect, case in KNOWN.items()]
    assert sum(len(parameters) for _, parameters in named) > 15
    for effect, parameters in named:
        assert parameters <= set(EFFECTS[effect].parameters), effect


def test_an_interval_is_compared_with_the_true_value_beyond_the_rig_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    label = drawn(tmp_path, monkeypatch, "viscous_friction", "dead_volume")
    rig = load_rig(tmp_path / "000" / "rig.yaml")
    extra = label.joint["viscous_friction"] - rig.joints[0].viscous_friction
    assert extra > 0.1
    near = answer("viscous_friction", extra=(extra - 0.01, extra + 0.02, extra + 0.03))
    [one] = stated_parameters([as_label(label)], {"000": near}, tmp_path)
    assert one.true == pytest.approx(extra)
    assert one.is_covered
    total = label.joint["viscous_friction"]
    far = answer("viscous_friction", extra=(total - 0.01, total, total + 0.01))
    [one] = stated_parameters([as_label(label)], {"000": far}, tmp_path)
    assert not one.is_covered
    assert as_json([one])[0] | {"covers": False, "case": "000"} == as_json([one])[0]


def test_each_side_is_compared_with_its_own_muscle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    label = drawn(tmp_path, monkeypatch, "pressure_bias", "valve_null_offset")
    biases = [muscle["pressure_bias"] for muscle in label.muscles]
    nulls = [muscle["null_offset"] for muscle in label.muscles]
    hit, other = (0, 1) if biases[0] else (1, 0)
    assert biases[hit] != 0.0 == biases[other]
    sides = ("agonist", "antagonist")
    for side, true in zip(sides, biases, strict=True):
        stated = answer("pressure_bias", **{f"bias.{side}": (true - 1.0, true, true + 1.0)})
        [one] = stated_parameters([as_label(label)], {"000": stated}, tmp_path)
        assert one.is_covered
        assert one.true == true
    # The valve opens at zero command by what shuts it, with the opposite sign.
    for side, null in zip(sides, nulls, strict=True):
        stated = answer("valve_null_offset", **{f"offset.{side}": (-null - 0.01, -null, 0.1)})
        [one] = stated_parameters([as_label(label)], {"000": stated}, tmp_path)
        assert one.true == pytest.approx(-null)


def test_wrong_names_and_laws_that_differ_do_not_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    label = as_label(drawn(tmp_path, monkeypatch, "end_caps", "command_delay"))
    wide = (-9.0, 0.0, 9.0)

    def counted(stated: dict[str, object], plant: str) -> int:
        found = stated_parameters([label], {"000": stated}, tmp_path, plant)
        return sum(one.counts for one in found)

    assert counted(answer("position_delay", delay=wide), FIRST) == 0
    assert counted(answer("end_caps", factor=wide), FIRST) == 1
    assert counted(answer("end_caps", factor=wide), SECOND) == 0
    assert counted(answer("command_delay", delay=wide), SECOND) == 1
    worn = label | {"effects": ["valve_dead_zone"]}  # its edges are rounded in the plants
    stated = answer("valve_dead_zone", overlap=wide)
    [one] = stated_parameters([worn], {"000": stated}, tmp_path, FIRST)
    assert not one.counts
    assert stated_parameters([label], {}, tmp_path) == []


def test_both_sides_of_a_parameter_are_counted_together() -> None:
    stated = [
        StatedParameter("000", "command_delay", f"delay.{side}", low, 0.01, 0.02, 0.012, True)
        for side, low in (("agonist", 0.009), ("antagonist", 0.0121))
    ]
    stated.append(StatedParameter("001", "coulomb_friction", "torque", 0.1, 0.2, 0.3, 0.2, True))
    counts = {name: (one["hits"], one["of"]) for name, one in by_parameter(stated).items()}
    assert counts == {"command_delay.delay": (1, 2), "coulomb_friction.torque": (1, 1)}
