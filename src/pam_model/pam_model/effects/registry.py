"""The registry of effects: every effect by its name, found in the files of this folder.

A rig file names effects under `<muscle>.effects.<effect>.<parameter>`,
`<joint>.effects.<effect>.<parameter>` or, for the whole rig, `effects.<effect>.<parameter>`. The
simulation applies them, the diagnosis fits them, and estimator, controller and plausibility check
take them into account. An effect whose magnitudes have their `neutral` values does nothing. Other
parameters only shape an effect (a time constant, a volume): their neutral value is the default that
applies when a rig file does not state them.

One effect is one file `pam_model/effects/<name>.py` that creates one `EFFECT = Effect(...)`.
declaration.py lists the parts, parts.py holds their types, slots.py lists the places where a law
may enter the plant. Nothing else names the effects: the plant's parameters, layout and calls, the
keys of the rig file, the candidates of the diagnosis and the tables of the docs are generated from
`EFFECTS`. Your own effects may be in other folders: the environment variable PAM_EFFECTS lists them
(separated as in PATH).

How to use an effect elsewhere:

- `EFFECTS[name]` has all parts. `EFFECTS[name].values(muscle.effects)` gives the parameters in the
  order of every law's arguments, `effect_value(muscle.effects, effect, parameter)` a single one.
- `pam_model.robot.compose(rig)` gives the robot: every number after all effects that change it, and
  the other laws by muscle and joint (`muscle.laws(Leak)`). `adjusted(target, written, effects)` is
  one such number: `adjusted("joint.inertia", joint.inertia, joint.effects)` includes the payload.
  `slots.TARGETS` lists the targets. Those of sensors, delays, tube, reservoir and cable have an
  ideal value, so that `written` is None.
- `filled(kind)` lists the effects that fill a slot in the order in which the plant applies them:
  `for effect, slot in filled(Opening): x = slot.law(x, *effect.values(muscle.effects))`.
- `EFFECTS[name].control` and `.plausibility` declare what controller and plausibility check do.
  `Inverse` holds the inverse law; to invert a chain of Opening laws, apply the inverses in reverse
  order.
- Other laws that plant and controller share are plain functions in the effect's file
  (`hysteresis.friction_area`, `creep.maxwell_step`, `stribeck_friction.stribeck_curve`) or, if
  several effects use them, in `pam_model.physics` and `pam_model.gas`.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Final

from pam_model.effects.declaration import Effect, EffectError
from pam_model.effects.parts import EffectValues
from pam_model.effects.slots import TARGETS, Adjusts, Chamber, Opening, Slot, Thread
from pam_model.names import Named

HOUSE: Final = ("__init__", "declaration", "parts", "registry", "slots")
"""Files of this folder that declare no effect."""
_HERE: Final = Path(__file__).parent


def effect_files() -> tuple[Path, ...]:
    """The files of all effects: of this folder, then of the folders listed in PAM_EFFECTS.

    Raises
    ------
    EffectError
        If a folder does not exist.
    """
    found = [path for path in sorted(_HERE.glob("*.py")) if path.stem not in HOUSE]
    for entry in filter(None, os.environ.get("PAM_EFFECTS", "").split(os.pathsep)):
        if not Path(entry).is_dir():
            raise EffectError(f"PAM_EFFECTS names {entry}, which is not a folder")
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
    """Load the effect that a file declares.

    Raises
    ------
    EffectError
        If the file has no `EFFECT` or another name than its effect, or the effect is incomplete.
    """
    effect = getattr(_module(path), "EFFECT", None)
    if not isinstance(effect, Effect):
        raise EffectError(f"{path}: creates no EFFECT = Effect(...)")
    if effect.name != path.stem:
        raise EffectError(f"{path}: contains the effect {effect.name}; the file must have its name")
    return effect


def check_together(effects: Mapping[str, Effect]) -> None:
    """Check that no two effects claim the same thing.

    Raises
    ------
    EffectError
        If two effects claim the same order, place, structural slot or structural target, or if the
        simpler effect of `Richer` does not exist.
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
                    f"effects {other} and {effect.name} both claim {claim}; only one of them may"
                )
        richer = effect.search.richer
        if richer is not None and richer.than not in effects:
            raise EffectError(f"effect {effect.name}: part 'search': no effect {richer.than!r}")


def _discover() -> dict[str, Effect]:
    found: dict[str, Effect] = {}
    for path in effect_files():
        effect = load_effect(path)
        if effect.name in found:
            raise EffectError(f"{path}: another file declares the effect {effect.name} as well")
        found[effect.name] = effect
    ordered = dict(sorted(found.items(), key=lambda item: item[1].order))
    check_together(ordered)
    return ordered


EFFECTS: Final[Mapping[str, Effect]] = Named("effect", _discover().items())
"""Every effect by its name, in order from the command to the measurement."""


def effect_value(effects: EffectValues, effect: str, parameter: str) -> float:
    """One parameter of one effect, or its neutral value if the rig does not state it.

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
    """Whether the effects of a muscle, joint or rig switch this effect on."""
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


def switched_on[S: Slot](
    kind: type[S], effects: EffectValues
) -> list[tuple[Effect, S, tuple[float, ...]]]:
    """The effects that fill a kind of slot and that a muscle, joint or rig has.

    Parameters
    ----------
    effects : mapping
        The effects of the muscle, joint or rig.

    Returns
    -------
    list of (Effect, Slot, tuple of float)
        Effect, slot and parameter values, in the order in which the plant applies them.
    """
    if not effects:  # the usual case, in each part of a robot that is composed
        return []
    return [
        (effect, slot, effect.values(effects))
        for effect, slot in filled(kind)
        if active(effect, effects)
    ]


def bound(law: Callable[..., float], values: tuple[float, ...]) -> Callable[..., float]:
    """A law with its last arguments, the parameter values, filled in."""
    return lambda *arguments: law(*arguments, *values)


def adjusted(target: str, written: float | None, effects: EffectValues) -> float:
    """A number of the ideal rig after every effect that changes it.

    Parameters
    ----------
    target : str
        One of `slots.TARGETS`.
    written : float or None
        The value stated in the rig file; None for a target that has an ideal value.
    effects : mapping
        `muscle.effects` for a target of a muscle, `joint.effects` for one of a joint, `rig.effects`
        for the reservoir's.

    Raises
    ------
    EffectError
        For an unknown target, or for None where the target has no ideal value.
    """
    if target not in TARGETS:
        raise EffectError(f"no target {target!r}; known: {', '.join(TARGETS)}")
    value = TARGETS[target].ideal if written is None else written
    if value is None:
        raise EffectError(f"target {target} has no ideal value; give the rig file's")
    for effect, slot in _ADJUSTS if effects else ():
        if slot.target == target and effect.name in effects:
            value = slot.law(value, *effect.values(effects))
    return value


_ADJUSTS: Final = filled(Adjusts)
