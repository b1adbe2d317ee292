"""The types of the parts of an effect's declaration; see declaration.py."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

Stage = Literal["valve", "muscle", "joint", "sensing"]
Scope = Literal["muscle", "joint", "rig"]
Channel = Literal["commands", "position", "pulls"]
EffectValues = Mapping[str, Mapping[str, float]]
"""Effect name -> parameter name -> value, as stored in a muscle, a joint or a rig."""


@dataclass(frozen=True, slots=True)
class EffectParameter:
    """One parameter of an effect.

    Attributes
    ----------
    symbol : str
        Its symbol in formulas.
    unit : str
        SI unit.
    neutral : float
        The default in a rig file; for a magnitude, the value at which the effect does nothing.
    low, high : float
        Bounds in a rig file and in a fit.
    description : str
        One line.
    is_shape : bool
        It only shapes an effect that another parameter (a magnitude) switches on.
    """

    symbol: str
    unit: str
    neutral: float
    low: float
    high: float
    description: str
    is_shape: bool = False

    def is_neutral(self, value: float) -> bool:
        """Whether the value is neutral; below a neutral lower bound it counts as neutral."""
        return value <= self.neutral if self.low == self.neutral else value == self.neutral


# --- what controller and plausibility check do about it ----------------------------------------


@dataclass(frozen=True, slots=True)
class Inverse:
    """The controller applies the inverse law between the wanted opening of a valve and its command.

    Attributes
    ----------
    how : str
        One or two sentences, for the controller's page.
    law : callable
        law(opening, *parameters) -> the opening to command, so that the valve has `opening`.
    """

    how: str
    law: Callable[..., float]


@dataclass(frozen=True, slots=True)
class Lead:
    """The controller advances its command by a first-order lead with the true time constant."""

    how: str


@dataclass(frozen=True, slots=True)
class Delay:
    """The controller shifts its command or its reference in time by the known delay."""

    how: str


@dataclass(frozen=True, slots=True)
class TorqueFeedforward:
    """The controller adds the torque that the effect costs along the reference.

    Attributes
    ----------
    how : str
        One or two sentences, for the controller's page.
    step : callable, optional
        For an effect with a PullState: step(state, stroke, duration, *parameters) -> the state
        after lengthening by `stroke` [m] at constant speed within `duration` [s].
    """

    how: str
    step: Callable[..., float] | None = None


@dataclass(frozen=True, slots=True)
class Correction:
    """The measurement is corrected before anything uses it."""

    how: str


@dataclass(frozen=True, slots=True)
class Included:
    """The effect is part of a model that is used as a whole, such as the effective force model."""

    how: str


@dataclass(frozen=True, slots=True)
class Nothing:
    """Nothing is done about the effect; `how` gives the reason."""

    how: str


Treatment = Inverse | Lead | Delay | TorqueFeedforward | Correction | Included | Nothing
PlausibilityTreatment = Inverse | Lead | Delay | Correction | Included | Nothing


# --- what the diagnosis does about it ----------------------------------------------------------


@dataclass(frozen=True, slots=True)
class RigScales:
    """Quantities of a rig that determine the typical size of an effect.

    Attributes
    ----------
    flow : float
        Sonic conductance of the agonist's valve [m^3/(s Pa)].
    volume : float
        Gas volume of the agonist at its neutral length [m^3].
    force : float
        Pull of the agonist at this length and at 40 % of the supply's gauge pressure [N].
    torque : float
        Torque of this pull on the pulley [N m].
    stroke : float
        Rest length minus neutral length, at least 2 % of the rest length [m].
    pressure : float
        40 % of the supply's gauge pressure [Pa].
    reach : float
        This pressure times the neutral length [Pa m].
    viscous_friction : float
        Of the joint, as stated in the rig file [N m s/rad].
    gravity_torque : float
        Of the joint, as stated in the rig file [N m].
    contraction_factor : float
        The larger contraction factor of the two muscles' force models [-].
    is_regulated : bool
        Whether pressure regulators drive the muscles.
    """

    flow: float
    volume: float
    force: float
    torque: float
    stroke: float
    pressure: float
    reach: float
    viscous_friction: float
    gravity_torque: float
    contraction_factor: float
    is_regulated: bool


SAMPLE_SCALES = RigScales(
    flow=2e-9,
    volume=1e-4,
    force=200.0,
    torque=5.0,
    stroke=0.03,
    pressure=2.4e5,
    reach=5e4,
    viscous_friction=0.05,
    gravity_torque=1.0,
    contraction_factor=1.0,
    is_regulated=False,
)
"""A typical rig, for which the ranges of an effect are checked when the effect is created."""


@dataclass(frozen=True, slots=True)
class Range:
    """Bounds, step size and starting points of the search for one parameter.

    Attributes
    ----------
    low, high : float
        Bounds, limited to those of the parameter.
    size : float
        A considerable change of the value or, with `logarithmic`, of its logarithm.
    starts : tuple of float
        Starting points.
    logarithmic : bool
        The search variable is the logarithm of the value.
    ordinary : float
        Largest distance from the neutral value on an ordinary good rig. Up to this size the effect
        belongs to the background and is no cause; 0 if a good rig has none of it.
    """

    low: float
    high: float
    size: float
    starts: tuple[float, ...]
    logarithmic: bool = False
    ordinary: float = 0.0


@dataclass(frozen=True, slots=True)
class Richer:
    """The effect contains a simpler one as a special case, and is also searched from its values.

    Attributes
    ----------
    than : str
        Name of the simpler effect.
    starts : callable
        starts(values of the simpler effect by parameter name) -> one mapping of parameter name to
        value per search. A parameter that the mapping does not name starts at the value of the
        simpler effect's parameter of the same name or, without one, at its own starting point.
    """

    than: str
    starts: Callable[[Mapping[str, float]], tuple[Mapping[str, float], ...]]


@dataclass(frozen=True, slots=True)
class Search:
    """Starting points and bounds of the diagnosis, and what it needs to see the effect.

    Attributes
    ----------
    ranges : callable
        ranges(RigScales) -> Range of every parameter.
    shown_by : tuple of str
        Recorded channels of which at least one is needed; empty if the pressures alone suffice.
    is_one_sided : bool
        The effect belongs to one valve or one sensor; the diagnosis has one candidate per muscle.
    shows_when_shut : bool
        For the valve stage: the effect is visible while the valves are shut.
    is_sharp : bool
        The law has only one form, so that a residual after its fit has another cause.
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
    """What the page of effects shows.

    Attributes
    ----------
    sizes : mapping of str to float
        Parameter values of the picture.
    signature : str
        What a person sees in the recording, in full sentences.
    easily_taken_for : str
        Other effects that look similar.
    told_apart_by : str
        The motion or measurement that distinguishes them best.
    """

    sizes: Mapping[str, float]
    signature: str
    easily_taken_for: str
    told_apart_by: str
