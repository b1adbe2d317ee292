"""An effect is complete in its file, and its parts are consistent."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from pam_model.effects import EFFECTS, Range, adjusted
from pam_model.effects.declaration import PARTS, Effect, EffectError
from pam_model.effects.registry import check_together, effect_files, load_effect
from pam_model.effects.slots import Opening

SECOND_LEAK = '''
"""A second leak."""

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Nothing, Portrait, Range, Search
from pam_model.effects.slots import Leak


def loss(pressure, ambient_pressure, critical_ratio, conductance):
    return conductance * (pressure - ambient_pressure)


EFFECT = Effect(
    name="{name}",
    order=85,
    stage="valve",
    scope="muscle",
    description="a laminar leak",
    law="mdot = C (P - P_ambient)",
    source="Hagen-Poiseuille",
    parameters={{"conductance": EffectParameter("C", "m^3/(s Pa)", 0.0, 0.0, 1e-9, "leak")}},
    slots=(Leak(loss),),
    control=Nothing("it is small"),
    plausibility=Nothing("it is small"),
    search=Search(
        ranges=lambda rig: {{"conductance": Range(0.0, 1e-10, 1e-12, (1e-12,))}},
        shown_by=("commands",),
    ),
    portrait=Portrait({{"conductance": 1e-11}}, "It sinks.", "leakage", "Holds."),
)
'''


def plant(folder: Path, name: str, without: str = "") -> Path:
    """Write the file of an effect, optionally without one of its parts."""
    lines = SECOND_LEAK.format(name=name).splitlines()
    kept, skipping = [], False
    for line in lines:
        if line.startswith("    ") and not line.startswith("     ") and "=" in line:
            skipping = bool(without) and line.strip().startswith(f"{without}=")
        elif line == ")":
            skipping = False
        if not skipping:
            kept.append(line)
    path = folder / f"{name}.py"
    path.write_text("\n".join(kept))
    return path


def test_a_complete_file_is_an_effect(tmp_path: Path) -> None:
    effect = load_effect(plant(tmp_path, "laminar_leak"))
    assert effect.name == "laminar_leak"
    check_together({**EFFECTS, effect.name: effect})


@pytest.mark.parametrize("part", PARTS)
def test_a_missing_part_is_refused_by_name(tmp_path: Path, part: str) -> None:
    with pytest.raises(EffectError) as refused:
        load_effect(plant(tmp_path, "laminar_leak", without=part))
    assert f"part '{part}' is missing" in str(refused.value)
    assert part == "name" or "laminar_leak" in str(refused.value)


def test_every_file_of_the_folder_is_an_effect_of_its_name() -> None:
    assert [path.stem for path in effect_files()] == sorted(EFFECTS)


def test_a_file_without_an_effect_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "empty_file.py"
    path.write_text("NUMBER = 1\n")
    with pytest.raises(EffectError, match="creates no EFFECT"):
        load_effect(path)


def test_a_file_of_another_name_is_refused(tmp_path: Path) -> None:
    path = plant(tmp_path, "laminar_leak").rename(tmp_path / "other_name.py")
    with pytest.raises(EffectError, match="must have its name"):
        load_effect(path)


def changed(**parts: object) -> Effect:
    return replace(EFFECTS["leakage"], **parts)


def test_a_law_that_does_not_take_the_parameters_is_refused() -> None:
    with pytest.raises(EffectError, match="leakage: slot Leak: law takes 4 arguments"):
        changed(parameters={**EFFECTS["leakage"].parameters, **EFFECTS["creep"].parameters})


def test_a_parameter_without_a_search_range_is_refused() -> None:
    search = replace(EFFECTS["leakage"].search, ranges=lambda rig: {})
    with pytest.raises(EffectError, match="no range for the parameter 'conductance'"):
        changed(search=search)
    search = replace(
        search, ranges=lambda rig: dict.fromkeys(("conductance", "x"), Range(0, 1, 1, (1,)))
    )
    with pytest.raises(EffectError, match="range for 'x', which is not a parameter"):
        changed(search=search)


def test_a_portrait_of_nothing_is_refused() -> None:
    for sizes, message in (
        ({}, "neutral values"),
        ({"size": 1.0}, "'size', which is not a parameter"),
    ):
        with pytest.raises(EffectError, match=message):
            changed(portrait=replace(EFFECTS["leakage"].portrait, sizes=sizes))


def test_a_slot_of_another_scope_is_refused() -> None:
    with pytest.raises(EffectError, match="Leak is for effects of scope muscle, not joint"):
        changed(scope="joint")


@pytest.mark.parametrize("name", ["tube_restriction", "thermal", "braid_extensibility"])
def test_what_a_rig_has_once_cannot_be_claimed_twice(name: str) -> None:
    twin = replace(EFFECTS[name], name="twin", order=999)
    with pytest.raises(EffectError, match=f"{name} and twin both claim"):
        check_together({**EFFECTS, "twin": twin})


def test_two_effects_cannot_share_a_place() -> None:
    with pytest.raises(EffectError, match="both claim"):
        check_together({**EFFECTS, "twin": changed(name="twin")})
    dead_zone = EFFECTS["valve_dead_zone"]
    other = replace(dead_zone, name="twin", order=999, slots=(Opening(dead_zone.slots[0].law, 2),))
    with pytest.raises(EffectError, match="Opening place"):
        check_together({**EFFECTS, "twin": other})


def test_a_richer_effect_needs_the_simpler_one() -> None:
    alone = {"stribeck_friction": EFFECTS["stribeck_friction"]}
    with pytest.raises(EffectError, match="no effect 'coulomb_friction'"):
        check_together(alone)


def test_adjusted_numbers_hold_every_effect() -> None:
    load = {"payload": {"mass": 2.0, "distance": 0.5}}
    assert adjusted("joint.inertia", 0.1, load) == 0.1 + 2.0 * 0.25
    assert adjusted("joint.inertia", 0.1, {}) == 0.1
    assert adjusted("pressure_sensor.gain", None, {"pressure_gain": {"gain": 1.1}}) == 1.1
    with pytest.raises(EffectError, match="no target"):
        adjusted("joint.colour", 1.0, {})
    with pytest.raises(EffectError, match="has no ideal value"):
        adjusted("joint.inertia", None, {})


def test_what_changes_the_pull_of_a_muscle_is_sought_where_it_moves_a_joint() -> None:
    """Load cells are rare: a large threshold pressure was `unknown` without them."""
    for name, effect in EFFECTS.items():
        if effect.stage == "muscle":
            assert {"position", "pulls"} <= {*effect.search.shown_by}, name
