"""What an ideal rig leaves out: every effect by its name, found in the files of this folder.

A rig file names effects under `<muscle>.effects.<effect>.<parameter>`,
`<joint>.effects.<effect>.<parameter>` or, for what the whole rig shares,
`effects.<effect>.<parameter>`. Simulation applies them, diagnosis fits them, estimator, controller
and plausibility check take them into account. A parameter at its `neutral` value adds nothing. Some
parameters only shape an effect that another one switches on (a time constant, a volume): their
neutral value is what applies when a rig file leaves them out.

One effect is one file `pam_model/effects/<name>.py` that makes one `EFFECT = Effect(...)`
(declaration.py lists the parts, parts.py what they are made of, slots.py where a law may enter the
plant). Nothing else names the effects: the plant's parameters, layout and calls, the keys of the
rig file, the candidates of the diagnosis and the tables of the docs are made from `EFFECTS`.
Effects of your own need not stand in this folder: the environment variable PAM_EFFECTS names
further folders (separated as in PATH).

How to use an effect elsewhere:

- `EFFECTS[name]` has all parts; `EFFECTS[name].values(muscle.effects)` its parameters in order, as
  every law takes them; `effect_value(muscle.effects, effect, parameter)` a single one.
- `adjusted(target, written, effects)` is a number of the ideal rig after all effects that change
  it: `adjusted("joint.inertia", joint.inertia, joint.effects)` holds the payload,
  `adjusted("valve.time_constant", valve.time_constant, muscle.effects)` the slower spool. Targets
  are in `slots.TARGETS`; sensors, delays, tube, reservoir and cable are targets as well, with an
  ideal value that need not be given (`adjusted("pressure_sensor.gain", None, muscle.effects)`).
- `filled(kind)` lists the effects that fill a slot in the order in which the plant applies them:
  `for effect, slot in filled(Opening): x = slot.law(x, *effect.values(muscle.effects))`.
- `EFFECTS[name].control` and `.plausibility` declare what is done about it: `Inverse` carries the
  inverse law; to undo a chain of Opening laws apply the inverses in reverse order.
- What else plant and controller share is a plain function: in the effect's file
  (`hysteresis.friction_area`, `creep.maxwell_step`, `stribeck_friction.stribeck_curve`), or on the
  ground floor where several effects use it (`pam_model.physics.dahl`, `pam_model.gas`).
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Final

from pam_model.effects.declaration import Effect, EffectError
from pam_model.effects.parts import EffectValues
from pam_model.effects.slots import TARGETS, Adjusts, Chamber, Opening, Slot, Thread

HOUSE: Final = ("__init__", "declaration", "parts", "registry", "slots")
"""Files of this folder that are no effects."""
_HERE: Final = Path(__file__).parent


def effect_files() -> tuple[Path, ...]:
    """The files of all effects: of this folder, then of those that PAM_EFFECTS names.

    Raises
    ------
    EffectError
        For a folder that is not there.
    """
    found = [path for path in sorted(_HERE.glob("*.py")) if path.stem not in HOUSE]
    for entry in filter(None, os.environ.get("PAM_EFFECTS", "").split(os.pathsep)):
        if not Path(entry).is_dir():
            raise EffectError(f"PAM_EFFECTS names {entry}, which is no folder")
        found += sorted(Path(entry).glob("*.py"))
    return tuple(found)


def _module(path: Path) -> ModuleType:
    if path.parent == _HERE:
        return importlib.import_module(f"pam_model.effects.{path.stem}")
    name = f"pam_effects_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise EffectError(f"{path} cannot be imported")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def load_effect(path: Path) -> Effect:
    """The effect that a file declares.

    Raises
    ------
    EffectError
        For a file without `EFFECT`, of another name than its effect, or an incomplete effect.
    """
    effect = getattr(_module(path), "EFFECT", None)
    if not isinstance(effect, Effect):
        raise EffectError(f"{path}: makes no EFFECT = Effect(...)")
    if effect.name != path.stem:
        raise EffectError(f"{path}: holds the effect {effect.name}; its file must have its name")
    return effect


def check_together(effects: Mapping[str, Effect]) -> None:
    """Check what effects must agree on.

    Raises
    ------
    EffectError
        For a place or a structural slot that two effects claim.
    """
    claimed: dict[object, str] = {}
    for effect in effects.values():
        claims: list[object] = [("order", effect.order)]
        for slot in effect.slots:
            if isinstance(slot, Chamber | Thread):
                claims.append(("slot", type(slot).__name__))
            if isinstance(slot, Opening):
                claims.append(("Opening place", slot.place))
            if isinstance(slot, Adjusts) and TARGETS[slot.target].is_structural:
                claims.append(("target", slot.target))
        for claim in claims:
            other = claimed.setdefault(claim, effect.name)
            if other != effect.name:
                raise EffectError(
                    f"effects {other} and {effect.name} both claim {claim}: only one may"
                )
        richer = effect.search.richer
        if richer is not None and richer.than not in effects:
            raise EffectError(f"effect {effect.name}: no effect {richer.than!r} to be richer than")


def _discover() -> dict[str, Effect]:
    found: dict[str, Effect] = {}
    for path in effect_files():
        effect = load_effect(path)
        if effect.name in found:
            raise EffectError(f"{path}: there is an effect {effect.name} already")
        found[effect.name] = effect
    ordered = dict(sorted(found.items(), key=lambda item: item[1].order))
    check_together(ordered)
    return ordered


EFFECTS: Final[Mapping[str, Effect]] = _discover()
"""Every effect by its name, in order from the command to the measurement."""


def effect_value(effects: EffectValues, effect: str, parameter: str) -> float:
    """One parameter of one effect, its neutral value where a rig does not name it.

    Parameters
    ----------
    effects : mapping
        `muscle.effects`, `joint.effects` or `rig.effects`.
    effect, parameter : str
        As in `EFFECTS`.
    """
    found = effects.get(effect)
    if found is not None and parameter in found:
        return found[parameter]
    return EFFECTS[effect].parameters[parameter].neutral


def active(effect: Effect, effects: EffectValues) -> bool:
    """Whether the parameters that a muscle, joint or rig carries switch an effect on."""
    return effect.name in effects and not effect.is_neutral(effects[effect.name])


def filled[S: Slot](kind: type[S]) -> tuple[tuple[Effect, S], ...]:
    """The effects that fill a kind of slot, in the order in which the plant applies them."""
    found = [
        (effect, slot)
        for effect in EFFECTS.values()
        for slot in effect.slots
        if isinstance(slot, kind)
    ]
    return tuple(
        sorted(found, key=lambda pair: pair[1].place if isinstance(pair[1], Opening) else 0)
    )


def adjusted(target: str, written: float | None, effects: EffectValues) -> float:
    """A number of the ideal rig after every effect that changes it.

    Parameters
    ----------
    target : str
        One of `slots.TARGETS`.
    written : float or None
        As the rig file states it; None for a target that has an ideal value.
    effects : mapping
        `muscle.effects` for a target of a muscle, `joint.effects` for one of a joint, `rig.effects`
        for the reservoir's.

    Raises
    ------
    EffectError
        For an unknown target, or None where the rig file has to state the value.
    """
    if target not in TARGETS:
        raise EffectError(f"no target {target!r}; known: {', '.join(TARGETS)}")
    value = TARGETS[target].ideal if written is None else written
    if value is None:
        raise EffectError(f"target {target} has no ideal value; give the rig file's")
    for effect, slot in _ADJUSTS:
        if slot.target == target and effect.name in effects:
            value = slot.law(value, *effect.values(effects))
    return value


_ADJUSTS: Final = filled(Adjusts)
