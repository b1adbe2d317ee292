"""What one effect declares: all that simulation, control, safety, diagnosis and docs ask of it.

A file `pam_model/effects/<name>.py` makes one `EFFECT = Effect(...)`. An effect without one of its
parts is refused when it is made, with a message that names effect and part.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from pam_model.effects.slots import SCOPES, TARGETS, Adjusts, DryFriction, PullState, Slot, laws_of
from pam_model.errors import PamError

Stage = Literal["valve", "muscle", "joint", "sensing"]
Scope = Literal["muscle", "joint", "rig"]
Channel = Literal["commands", "position", "pulls"]
EffectValues = Mapping[str, Mapping[str, float]]
"""Effect name -> parameter name -> value, as a muscle, a joint or a rig carries it."""


class EffectError(PamError):
    """An effect's file is incomplete or contradicts itself."""


@dataclass(frozen=True, slots=True)
class EffectParameter:
    """One number of an effect.

    Attributes
    ----------
    symbol : str
        As formulas write it.
    unit : str
        SI.
    neutral : float
        What applies when a rig file leaves it out; for a magnitude, the value that adds nothing.
    low, high : float
        What a rig file may say and a fit may try.
    description : str
        One line.
    is_shape : bool
        It shapes an effect that another parameter switches on; alone it adds nothing.
    """

    symbol: str
    unit: str
    neutral: float
    low: float
    high: float
    description: str
    is_shape: bool = False

    def is_neutral(self, value: float) -> bool:
        """Whether this value adds nothing: the neutral one, or beyond it where none is allowed."""
        return value <= self.neutral if self.low == self.neutral else value == self.neutral


# --- what controller and plausibility check do about it ----------------------------------------


@dataclass(frozen=True, slots=True)
class Inverse:
    """The controller undoes it between what a valve should pass and its command.

    Attributes
    ----------
    how : str
        One or two sentences, for the controller's page.
    law : callable
        law(opening, *parameters) -> the opening to ask for, so that the valve has `opening`.
    """

    how: str
    law: Callable[..., float]


@dataclass(frozen=True, slots=True)
class Lead:
    """The controller advances its command by a first-order lead with the true time constant."""

    how: str


@dataclass(frozen=True, slots=True)
class Delay:
    """The controller looks ahead, or compares with an earlier reference, by a known time."""

    how: str


@dataclass(frozen=True, slots=True)
class TorqueFeedforward:
    """The controller adds the torque that it costs along the reference.

    Attributes
    ----------
    how : str
        One or two sentences, for the controller's page.
    step : callable, optional
        For an effect with a PullState: step(state, stroke, duration, *parameters) -> the state
        after the muscle has lengthened evenly by `stroke` [m] within `duration` [s].
    """

    how: str
    step: Callable[..., float] | None = None


@dataclass(frozen=True, slots=True)
class Correction:
    """The measurement is corrected before anything uses it."""

    how: str


@dataclass(frozen=True, slots=True)
class Included:
    """It is part of a model that is used as a whole, such as the effective force model."""

    how: str


@dataclass(frozen=True, slots=True)
class Nothing:
    """Nothing is done about it, for the reason that `how` gives."""

    how: str


Treatment = Inverse | Lead | Delay | TorqueFeedforward | Correction | Included | Nothing
PlausibilityTreatment = Inverse | Lead | Delay | Correction | Included | Nothing


# --- what the diagnosis does about it ----------------------------------------------------------


@dataclass(frozen=True, slots=True)
class RigScales:
    """Quantities of a rig that set how large an effect on it is.

    Attributes
    ----------
    flow : float
        Sonic conductance of the agonist's valve [m^3/(s Pa)].
    volume : float
        Gas volume of the agonist at its neutral length [m^3].
    force : float
        Its pull there at 40 % of the supply's gauge pressure [N].
    torque : float
        That pull on the pulley [N m].
    stroke : float
        Rest length less neutral length, at least 2 % of the rest length [m].
    pressure : float
        40 % of the supply's gauge pressure [Pa].
    reach : float
        That pressure times the neutral length [Pa m].
    viscous_friction : float
        As written for the joint [N m s/rad].
    contraction_factor : float
        The larger one that the muscles' force models have already [-].
    """

    flow: float
    volume: float
    force: float
    torque: float
    stroke: float
    pressure: float
    reach: float
    viscous_friction: float
    contraction_factor: float


SAMPLE_SCALES = RigScales(
    flow=2e-9,
    volume=1e-4,
    force=200.0,
    torque=5.0,
    stroke=0.03,
    pressure=2.4e5,
    reach=5e4,
    viscous_friction=0.05,
    contraction_factor=1.0,
)
"""An ordinary rig, on which an effect's search is tried out when the effect is made."""


@dataclass(frozen=True, slots=True)
class Range:
    """Where a search for one parameter may go.

    Attributes
    ----------
    low, high : float
        Bounds, cut to those of the parameter.
    size : float
        A sizeable change: of the value, or of its logarithm.
    starts : tuple of float
        Where searches begin.
    logarithmic : bool
        The search moves the logarithm.
    """

    low: float
    high: float
    size: float
    starts: tuple[float, ...]
    logarithmic: bool = False


@dataclass(frozen=True, slots=True)
class Richer:
    """It contains a simpler effect for some of its values, and is searched from there as well.

    Attributes
    ----------
    than : str
        The simpler effect.
    starts : callable
        starts(values of the simpler effect by parameter name) -> one mapping of parameter name to
        value per search; a parameter it does not name keeps the value of the simpler effect's
        parameter of that name, or its own start.
    """

    than: str
    starts: Callable[[Mapping[str, float]], tuple[Mapping[str, float], ...]]


@dataclass(frozen=True, slots=True)
class Search:
    """Where the diagnosis begins and how far it goes.

    Attributes
    ----------
    ranges : callable
        ranges(RigScales) -> Range of every parameter.
    shown_by : tuple of str
        Recorded channels of which at least one is needed; empty: the pressures alone show it.
    is_one_sided : bool
        It belongs to one valve or one sensor, and is tried on each muscle by itself.
    shows_when_shut : bool
        For the valve stage: it can be seen while the valves are shut.
    is_sharp : bool
        Its law has one form only, so that what it leaves unexplained is something else.
    richer : Richer, optional
        For an effect that contains a simpler one.
    """

    ranges: Callable[[RigScales], Mapping[str, Range]]
    shown_by: tuple[Channel, ...]
    is_one_sided: bool = False
    shows_when_shut: bool = False
    is_sharp: bool = False
    richer: Richer | None = None


@dataclass(frozen=True, slots=True)
class Portrait:
    """How the page of effects shows it.

    Attributes
    ----------
    sizes : mapping of str to float
        Parameters of the picture.
    signature : str
        What a person sees, in whole sentences.
    easily_taken_for : str
        Which other effects look alike.
    told_apart_by : str
        The motion or measurement that shows it best.
    """

    sizes: Mapping[str, float]
    signature: str
    easily_taken_for: str
    told_apart_by: str


_MISSING: Any = object()
PARTS: Mapping[str, str] = {
    "name": "the identifier of rig files",
    "order": "the place between command and measurement",
    "stage": "valve, muscle, joint or sensing",
    "scope": "muscle, joint or rig",
    "description": "one line on what it is",
    "law": "the formula, in the parameters' symbols",
    "source": "the literature of the law",
    "parameters": "its numbers, by their names in a rig file",
    "slots": "the law's functions and where the plant calls them",
    "control": "what the controller does about it",
    "plausibility": "what the driver's plausibility check does",
    "search": "where the diagnosis begins and how far it goes",
    "portrait": "how the page of effects shows it",
}
"""Every part of an effect, and what it says."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """One thing an ideal rig leaves out.

    Attributes
    ----------
    name : str
        Identifier used by rig files, reports and diagnoses; the name of its file.
    order : int
        Its place between command and measurement; effects are listed by it.
    stage : str
        Where between command and measurement it acts.
    scope : str
        Whether each muscle, each joint or the whole rig has its own parameters.
    description : str
        One line.
    law : str
        What is computed, in the symbols of the parameters.
    source : str
        Where the law is from.
    parameters : mapping of str to EffectParameter
        By the name a rig file uses.
    slots : tuple of Slot
        The law as code: where it enters the plant, and the functions.
    control : Treatment
        What the controller does about it.
    plausibility : Treatment
        What the driver's plausibility check does about it.
    search : Search
        How the diagnosis looks for it.
    portrait : Portrait
        How the page of effects shows it.

    Raises
    ------
    EffectError
        For a missing part, a law that does not take the effect's parameters, a search or portrait
        that does not fit them.
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
            self._refuse("part 'parameters' has no magnitude that switches it on")
        if not self.slots:
            self._refuse("part 'slots' is empty: no law reaches the plant")
        for part_name in ("control", "plausibility"):
            if not getattr(self, part_name).how:
                self._refuse(f"part {part_name!r} does not say how, or why not")
        self._check_laws()
        self._check_search()
        self._check_portrait()

    @property
    def magnitudes(self) -> tuple[str, ...]:
        """The parameters that switch the effect off when all are at their neutral values."""
        return tuple(key for key, entry in self.parameters.items() if not entry.is_shape)

    def is_neutral(self, values: Mapping[str, float]) -> bool:
        """Whether these values add nothing."""
        return all(
            self.parameters[key].is_neutral(values.get(key, self.parameters[key].neutral))
            for key in self.magnitudes
        )

    def values(self, effects: EffectValues) -> tuple[float, ...]:
        """Its parameters in order, from `muscle.effects` and the like; neutral where not given."""
        given = effects.get(self.name, {})
        return tuple(given.get(key, entry.neutral) for key, entry in self.parameters.items())

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
            self._refuse(f"{what} takes {count} arguments; it is given ({', '.join(wanted)})")

    def _check_search(self) -> None:
        found = set(self.search.ranges(SAMPLE_SCALES))
        for key in self.parameters:
            if key not in found:
                self._refuse(f"part 'search' has no range for the parameter {key!r}")
        for key in sorted(found - set(self.parameters)):
            self._refuse(f"part 'search' has a range for {key!r}, which is no parameter")

    def _check_portrait(self) -> None:
        for key in self.portrait.sizes:
            if key not in self.parameters:
                self._refuse(f"part 'portrait' has a size for {key!r}, which is no parameter")
        if self.is_neutral(self.portrait.sizes):
            self._refuse("part 'portrait' shows it at its neutral values")
        for text in ("signature", "easily_taken_for", "told_apart_by"):
            if not getattr(self.portrait, text):
                self._refuse(f"part 'portrait' has no {text}")
