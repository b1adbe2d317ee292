"""What the parts of an effect's declaration are made of; see declaration.py."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

Stage = Literal["valve", "muscle", "joint", "sensing"]
Scope = Literal["muscle", "joint", "rig"]
Channel = Literal["commands", "position", "pulls"]
EffectValues = Mapping[str, Mapping[str, float]]
"""Effect name -> parameter name -> value, as a muscle, a joint or a rig carries it."""


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
