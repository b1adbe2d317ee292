"""A rig file in which numbers are missing or given as ranges, and who reads it."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from pam_model.errors import RigError
from pam_model.rig import load_rig, save_rig
from pam_model.rig.partial import load_partial_rig
from pam_model.rig.types import NUMBERS

ELBOW = Path(__file__).parents[2] / "config" / "elbow.yaml"


def _tree() -> dict[str, Any]:
    tree: dict[str, Any] = yaml.safe_load(ELBOW.read_text(encoding="utf-8"))
    return tree["/**"]["ros__parameters"]


def _write(tree: dict[str, Any], path: Path) -> Path:
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": tree}}), encoding="utf-8")
    return path


def _places() -> list[tuple[str, str, bool]]:
    """Dotted section, key, and whether the key may be missing, of every calibrated number."""
    where = {"": "", "joint": "elbow", "muscle": "elbow_flexor", "valve": "elbow_flexor.valve"}
    return [
        (where[section], name, key.guess is not None)
        for section in where
        for name, key in NUMBERS[section].items()
        if key.may_be_range
    ]


def _fixed() -> list[tuple[str, str]]:
    """Dotted section and key of numbers that no recording determines."""
    where = {"": "", "gas": "gas", "joint": "elbow", "muscle": "elbow_flexor"}
    numbers = [
        (where[section], name)
        for section in where
        for name, key in NUMBERS[section].items()
        if not key.may_be_range
    ]
    return [*numbers, ("elbow.effects.payload", "mass"), ("elbow_flexor.effects.creep", "ratio")]


@pytest.mark.parametrize("load", [load_partial_rig, load_rig])
@pytest.mark.parametrize(("where", "key"), _fixed())
def test_what_no_recording_determines_is_no_range_and_is_not_to_be_calibrated(
    tmp_path: Path, load: Callable[[Path], object], where: str, key: str
) -> None:
    tree = _tree()
    branch = tree
    for step in where.split(".") if where else ():
        branch = branch.setdefault(step, {})
    branch[key] = {"between": [0.1, 0.2]}
    with pytest.raises(RigError, match=f"{where}.{key}: a range".lstrip(".")) as told:
        load(_write(tree, tmp_path / "rig.yaml"))
    assert "calibrate" not in str(told.value)


def _branch(tree: dict[str, Any], where: str) -> dict[str, Any]:
    for step in where.split(".") if where else ():
        tree = tree[step]
    return tree


def test_a_complete_rig_file_is_read_as_it_is() -> None:
    partial = load_partial_rig(ELBOW)
    assert partial.rig == load_rig(ELBOW)
    assert not partial.ranges
    written = _tree()
    assert all(
        key.rpartition(".")[2] not in _branch(written, key.rpartition(".")[0])
        for key in partial.missing
    )


@pytest.mark.parametrize(("where", "key", "may_miss"), _places())
def test_every_calibrated_number_may_be_a_range(
    tmp_path: Path, where: str, key: str, may_miss: bool
) -> None:
    tree = _tree()
    value = load_partial_rig(ELBOW).rig.to_parameters()
    number = float(_branch(value, where)[key]) or 0.1
    ends = sorted((0.9 * number, 1.1 * number))
    _branch(tree, where)[key] = {"between": ends}
    path = _write(tree, tmp_path / "rig.yaml")
    partial = load_partial_rig(path)
    full = f"{where}.{key}".lstrip(".")
    assert partial.ranges == {full: tuple(ends)}
    found = float(_branch(partial.rig.to_parameters(), where)[key])
    assert ends[0] <= found <= ends[1]
    with pytest.raises(RigError, match=rf"{full}: a range.*gap calibrate"):
        load_rig(path)


@pytest.mark.parametrize(("where", "key", "may_miss"), _places())
def test_what_no_log_determines_must_be_stated(
    tmp_path: Path, where: str, key: str, may_miss: bool
) -> None:
    tree = _tree()
    _branch(tree, where).pop(key, None)
    path = _write(tree, tmp_path / "rig.yaml")
    full = f"{where}.{key}".lstrip(".")
    if may_miss:
        partial = load_partial_rig(path)
        assert full in partial.missing
        if partial.is_rough:
            with pytest.raises(RigError, match=rf"{full}: missing.*gap calibrate"):
                load_rig(path)
        else:
            load_rig(path)
    else:
        with pytest.raises(RigError, match=rf"{full}: missing"):
            load_partial_rig(path)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"between": [0.1]}, "a range as"),
        ({"between": 0.1}, "a range as"),
        ({"from": 0.1}, "a range as"),
        ({"between": [0.2, 0.1]}, "lower must be below upper"),
        ({"between": [0.1, 5000.0]}, "must be from"),
        ({"between": ["a", "b"]}, "must be a number"),
    ],
)
def test_a_wrong_range_is_named_with_its_key(tmp_path: Path, given: object, words: str) -> None:
    tree = copy.deepcopy(_tree())
    tree["elbow"]["inertia"] = given
    with pytest.raises(RigError, match=rf"rig\.yaml: elbow\.inertia.*{words}"):
        load_partial_rig(_write(tree, tmp_path / "rig.yaml"))


def test_a_number_that_is_not_calibrated_is_no_range(tmp_path: Path) -> None:
    tree = _tree()
    tree["elbow"]["max_velocity"] = {"between": [1.0, 2.0]}
    with pytest.raises(RigError, match=r"elbow\.max_velocity: a range"):
        load_partial_rig(_write(tree, tmp_path / "rig.yaml"))


def test_comments_stand_behind_their_numbers(tmp_path: Path) -> None:
    rig = load_rig(ELBOW)
    path = tmp_path / "rig.yaml"
    notes = {"elbow.inertia": "first", "elbow_extensor.valve.time_constant": "second\nline"}
    save_rig(rig, path, comments=notes)
    assert load_rig(path) == rig
    lines = [line.strip() for line in path.read_text(encoding="utf-8").splitlines()]
    commented = [line for line in lines if "  # " in line]
    assert len(commented) == 2
    assert commented[0].startswith("inertia:") and commented[0].endswith("# first")
    assert commented[1].startswith("time_constant:") and commented[1].endswith("# second line")


def test_a_range_and_a_guess_count_what_effects_change(tmp_path: Path) -> None:
    """A range is of the number that holds, as the value of a number is."""
    tree = _tree()
    tree["elbow"]["effects"] = {"payload": {"mass": 2.0, "distance": 0.5}}
    tree["elbow"]["inertia"] = {"between": [0.02, 0.08]}
    tree["elbow_flexor"]["valve"]["time_constant"] = {"between": [0.004, 0.02]}
    tree["elbow_flexor"]["effects"] = {"valve_lag": {"extra_time_constant": 0.03}}
    partial = load_partial_rig(_write(tree, tmp_path / "rig.yaml"))
    assert partial.ranges["elbow.inertia"] == pytest.approx((0.52, 0.58))
    assert partial.ranges["elbow_flexor.valve.time_constant"] == pytest.approx((0.034, 0.05))
    assert partial.rig.joint("elbow").inertia == pytest.approx(0.54)
    del tree["elbow"]["inertia"]
    guessed = load_partial_rig(_write(tree, tmp_path / "guess.yaml"))
    del tree["elbow"]["effects"]
    alone = load_partial_rig(_write(tree, tmp_path / "alone.yaml"))
    more = guessed.rig.joint("elbow").inertia - alone.rig.joint("elbow").inertia
    assert more == pytest.approx(0.5)


def test_an_effect_that_leads_out_of_the_bounds_of_its_number_is_refused(tmp_path: Path) -> None:
    tree = load_rig(ELBOW).to_parameters()
    tree["elbow_flexor"]["dead_volume"] = 11e-3
    tree["elbow_flexor"]["effects"] = {"dead_volume": {"extra_volume": 5e-3}}
    path = _write(tree, tmp_path / "rig.yaml")
    for load in (load_rig, load_partial_rig):
        with pytest.raises(
            RigError, match=r"elbow_flexor\.dead_volume = 0\.016 m\^3.*effect dead_volume"
        ):
            load(path)
