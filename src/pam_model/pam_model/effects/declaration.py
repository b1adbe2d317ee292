"""The declaration of one effect: everything that simulation, control, diagnosis and docs need.

A file `pam_model/effects/<name>.py` creates one `EFFECT = Effect(...)`. If a part is missing, the
constructor raises an error that names the effect and the part.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pam_model.effects.parts import (
    SAMPLE_SCALES,
    EffectParameter,
    EffectValues,
    Inverse,
    PlausibilityTreatment,
    Portrait,
    Scope,
    Search,
    Stage,
    TorqueFeedforward,
    Treatment,
)
from pam_model.effects.slots import (
    SCOPES,
    TARGETS,
    Adjusts,
    DryFriction,
    Opening,
    PullState,
    Slot,
    laws_of,
)
from pam_model.errors import PamError


class EffectError(PamError):
    """The file of an effect is incomplete or contradicts itself."""


_MISSING: Any = object()
PARTS: Mapping[str, str] = {
    "name": "the identifier used in rig files",
    "order": "the position in the chain from command to measurement",
    "stage": "valve, muscle, joint or sensing",
    "scope": "muscle, joint or rig",
    "description": "one line that says what it is",
    "law": "the formula, in the parameters' symbols",
    "source": "the literature of the law",
    "parameters": "its parameters, by their names in a rig file",
    "slots": "the law's functions and where the plant calls them",
    "control": "what the controller does about it",
    "plausibility": "what the driver's plausibility check does",
    "search": "starting points and bounds of the diagnosis",
    "portrait": "what the page of effects shows",
}
"""Every part of an effect, and its meaning."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """One effect that the ideal rig does not have.

    Attributes
    ----------
    name : str
        Identifier used by rig files, reports and diagnoses; the name of its file.
    order : int
        Its position in the chain from command to measurement; effects are listed in this order.
    stage : str
        The stage of that chain in which it acts: valve, muscle, joint or sensing.
    scope : str
        Whether each muscle, each joint or the whole rig has its own parameters.
    description : str
        One line that says what it is.
    law : str
        The formula, in the symbols of the parameters.
    source : str
        The literature of the law.
    parameters : mapping of str to EffectParameter
        The parameters by their names in a rig file.
    slots : tuple of Slot
        The law as code: its functions, and where the plant calls them.
    control : Treatment
        What the controller does about it.
    plausibility : Treatment
        What the driver's plausibility check does about it.
    search : Search
        How the diagnosis searches for it.
    portrait : Portrait
        What the page of effects shows.

    Raises
    ------
    EffectError
        If a part is missing, a law does not take the effect's parameters, or the search or portrait
        does not fit them.
    """

    name: str = _MISSING
    order: int = _MISSING
    stage: Stage = _MISSING
    scope: Scope = _MISSING
    description: str = _MISSING
    law: str = _MISSING
    source: str = _MISSING
    parameters: Mapping[str, EffectParameter] = _MISSING
    slots: tuple[Slot, ...] = _MISSING
    control: Treatment = _MISSING
    plausibility: PlausibilityTreatment = _MISSING
    search: Search = _MISSING
    portrait: Portrait = _MISSING

    def __post_init__(self) -> None:
        for part, meaning in PARTS.items():
            if getattr(self, part) is _MISSING:
                name = self.name if self.name is not _MISSING else "without a name"
                raise EffectError(f"effect {name}: part {part!r} is missing ({meaning})")
        for text in ("name", "description", "law", "source"):
            if not getattr(self, text):
                self._refuse(f"part {text!r} is empty")
        if not self.magnitudes:
            self._refuse("part 'parameters' has no magnitude that switches the effect on")
        if not self.slots:
            self._refuse("part 'slots' is empty: no law reaches the plant")
        for part_name in ("control", "plausibility"):
            if not getattr(self, part_name).how:
                self._refuse(f"part {part_name!r} has no text `how`: what is done, or why nothing")
        self._check_laws()
        self._check_search()
        self._check_portrait()

    @property
    def magnitudes(self) -> tuple[str, ...]:
        """The parameters that switch the effect off when all are at their neutral values."""
        return tuple(key for key, entry in self.parameters.items() if not entry.is_shape)

    def is_neutral(self, values: Mapping[str, float]) -> bool:
        """Whether the effect does nothing at these values."""
        return all(
            self.parameters[key].is_neutral(values.get(key, self.parameters[key].neutral))
            for key in self.magnitudes
        )

    def values(self, effects: EffectValues) -> tuple[float, ...]:
        """Its parameters in order, from e.g. `muscle.effects`; neutral values where not given."""
        given = effects.get(self.name, {})
        return tuple(given.get(key, entry.neutral) for key, entry in self.parameters.items())

    @property
    def is_of_the_valve(self) -> bool:
        """Whether it belongs to a muscle's valve or pressure sensor, and not to the muscle."""
        parts = ("valve.", "pressure_sensor.")
        return any(
            isinstance(slot, Opening)
            or (isinstance(slot, Adjusts) and slot.target.startswith(parts))
            for slot in self.slots
        )

    def counted_the_other_way(self, values: Mapping[str, float]) -> Mapping[str, float]:
        """The same effect where the angle of the joint is counted the other way."""
        if not any(
            isinstance(slot, Adjusts) and slot.target == "position_sensor.offset"
            for slot in self.slots
        ):
            return values
        return {key: -value if key in self.magnitudes else value for key, value in values.items()}

    def _refuse(self, text: str) -> None:
        raise EffectError(f"effect {self.name}: {text}")

    def _check_laws(self) -> None:
        for slot in self.slots:
            kind = type(slot).__name__
            wanted = SCOPES.get(type(slot), self.scope)
            if isinstance(slot, Adjusts):
                if slot.target not in TARGETS:
                    self._refuse(f"no target {slot.target!r}; known: {', '.join(TARGETS)}")
                wanted = TARGETS[slot.target].scope
            if ("muscle" if self.scope == "muscle" else "joint") != wanted:
                self._refuse(f"slot {kind} is for effects of scope {wanted}, not {self.scope}")
            if isinstance(slot, DryFriction) and slot.presliding not in self.parameters:
                self._refuse(f"slot DryFriction: no parameter {slot.presliding!r}")
            for name, (context, law) in laws_of(slot).items():
                self._check_arguments(f"slot {kind}: {name}", law, context)
        if isinstance(self.control, Inverse):
            self._check_arguments("control: law", self.control.law, ("opening",))
        self._check_feedforward()

    def _check_feedforward(self) -> None:
        if isinstance(self.control, TorqueFeedforward) and any(
            isinstance(slot, PullState) for slot in self.slots
        ):
            if self.control.step is None:
                self._refuse("control: a TorqueFeedforward of a PullState needs a step")
            else:
                self._check_arguments(
                    "control: step", self.control.step, ("state", "stroke", "duration")
                )

    def _check_arguments(
        self, what: str, law: Callable[..., object], context: tuple[str, ...]
    ) -> None:
        count = len(inspect.signature(law).parameters)
        wanted = (*context, *self.parameters)
        if count != len(wanted):
            self._refuse(f"{what} takes {count} arguments; it must take ({', '.join(wanted)})")

    def _check_search(self) -> None:
        found = set(self.search.ranges(SAMPLE_SCALES))
        for key in self.parameters:
            if key not in found:
                self._refuse(f"part 'search' has no range for the parameter {key!r}")
        for key in sorted(found - set(self.parameters)):
            self._refuse(f"part 'search' has a range for {key!r}, which is not a parameter")

    def _check_portrait(self) -> None:
        for key in self.portrait.sizes:
            if key not in self.parameters:
                self._refuse(f"part 'portrait' has a size for {key!r}, which is not a parameter")
        if self.is_neutral(self.portrait.sizes):
            self._refuse("part 'portrait' shows the effect at its neutral values")
        for text in ("signature", "easily_taken_for", "told_apart_by"):
            if not getattr(self.portrait, text):
                self._refuse(f"part 'portrait' has no {text}")
