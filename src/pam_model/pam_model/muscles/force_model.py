"""The interface of all length-force models of a muscle, and the register of models by name.

Conventions (everywhere in this package): SI units; force is positive when the muscle pulls its
ends together; pressure is gauge; stiffness is dF/dL, positive for a muscle under pressure.
Arguments are floats or arrays that broadcast against each other; the result has their common
shape, and is a float for floats. Forces are not limited to positive values here, because
extensors do push; the joint model enforces that other muscles cannot push.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from difflib import get_close_matches
from inspect import signature
from typing import Any, ClassVar, Protocol, runtime_checkable

from pam_model.bounds import within
from pam_model.errors import DomainError, RigError
from pam_model.names import Named
from pam_ros.program_name import PROGRAM


@dataclass(frozen=True, slots=True)
class ModelParameter:
    """One free constant of a force model, as `<muscle>.model_parameters.<name>` gives it.

    Attributes
    ----------
    default : float or None
        The value if a rig file gives none; None if the rig file has to give one.
    unit : str
        SI unit.
    low, high : float
        The closed range of allowed values.
    description : str
        Meaning of the constant, for messages and tables.
    when_zero : callable, optional
        For a constant whose value 0 means "take it from the geometry": the value that is then
        used. A fit starts from this value, since a value close to 0 gives a different model.
    """

    default: float | None
    unit: str
    low: float
    high: float
    description: str
    when_zero: Callable[[MuscleGeometry], float] | None = None


@dataclass(frozen=True, slots=True)
class MuscleGeometry:
    """The geometry that a rig file gives for every muscle, independent of its model.

    Attributes
    ----------
    thread_length : float
        b, length of one braid thread [m].
    turns : float
        n, turns of one thread about the axis [-].
    rest_length : float
        Unpressurised braid length [m].
    wall_thickness : float
        t_k, bladder and sheath [m].

    Raises
    ------
    DomainError
        For a value that is not finite and above 0, or a wall thickness below 0.
    """

    thread_length: float
    turns: float
    rest_length: float
    wall_thickness: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is no length or number of turns."""
        least = {"thread_length": 0.0, "turns": 0.0, "rest_length": 0.0, "wall_thickness": None}
        for name, above in least.items():
            value, unit = getattr(self, name), "-" if name == "turns" else "m"
            if isinstance(value, float | int | str | None):  # a fit takes slopes by dual numbers
                low = -math.inf if above is not None else 0.0
                within(name, value, low, unit=unit, above=above, error=DomainError)


@runtime_checkable
class ForceModel(Protocol):
    """A muscle as a relation between pressure, length and force."""

    name: ClassVar[str]
    parameters: ClassVar[Mapping[str, ModelParameter]]

    @property
    def length_bounds(self) -> tuple[float, float]:
        """Shortest and longest length that the model covers [m]."""
        ...

    def force(self, pressure: Any, length: Any, velocity: Any = 0.0) -> Any:
        """Pull [N] at gauge pressure [Pa], length [m] and lengthening speed dL/dt [m/s]."""
        ...

    def stiffness(self, pressure: Any, length: Any) -> Any:
        """dF/dL at constant pressure [N/m], without velocity terms."""
        ...

    def volume(self, length: Any) -> Any:
        """Gas volume [m^3], without the rig's dead volume."""
        ...

    def volume_slope(self, length: Any) -> Any:
        """dV/dL [m^2]."""
        ...

    def closed_stiffness(
        self,
        pressure: Any,
        length: Any,
        *,
        dead_volume: float,
        ambient_pressure: float,
        exponent: float,
    ) -> Any:
        """dF/dL with the chamber shut [N/m]: P_abs (V + dead_volume)^exponent stays constant."""
        ...


@runtime_checkable
class AffineForceModel(ForceModel, Protocol):
    """A force model with F = pressure * A(L) + B(L), so that its inverse is exact."""

    def coefficients(self, length: Any) -> tuple[Any, Any]:
        """A(L) [m^2] and B(L) [N]."""
        ...

    def coefficient_slopes(self, length: Any) -> tuple[Any, Any]:
        """dA/dL [m] and dB/dL [N/m]."""
        ...


Factory = Callable[[MuscleGeometry, Mapping[str, float]], ForceModel]


@dataclass(frozen=True, slots=True)
class RegisteredModel:
    """A model's class, its factory, and its line in `pam model list`."""

    name: str
    factory: Factory
    model: type[Any]
    equations: str
    status: str
    summary: str
    row: str


_REGISTER: dict[str, RegisteredModel] = {}


def register(
    *, equations: str, status: str, summary: str, row: str = ""
) -> Callable[[type[Any]], type[Any]]:
    """Register a model class under its `name`.

    Its arguments are numbers of a `MuscleGeometry` and its own constants, by their names; a class
    with other arguments has a class method `from_geometry(geometry, constants)`.

    Parameters
    ----------
    equations : str
        Equation numbers in the review, such as "(7)-(8)".
    status : str
        "derived", "published", "empirical" or "stand-in".
    summary : str
        One line for the list of models.
    row : str
        Name of the catalogue row that describes the model, if it differs from the model's name.
        The error message for a rig file that names the row then gives the model's name.
    """

    def enter(model: type[Any]) -> type[Any]:
        name = model.name
        if name in _REGISTER:
            raise RuntimeError(f"two force models are called {name!r}")
        _REGISTER[name] = RegisteredModel(
            name, _factory_of(model), model, equations, status, summary, row or name
        )
        return model

    return enter


def _factory_of(model: type[Any]) -> Factory:
    """How a model is made for a muscle of a rig file."""
    if hasattr(model, "from_geometry"):
        factory: Factory = model.from_geometry
        return factory
    arguments = signature(model).parameters
    sizes = [entry.name for entry in fields(MuscleGeometry) if entry.name in arguments]

    def factory_by_names(geometry: MuscleGeometry, constants: Mapping[str, float]) -> Any:
        return model(**{name: getattr(geometry, name) for name in sizes}, **constants)

    return factory_by_names


def registered_models() -> Mapping[str, RegisteredModel]:
    """Every length-force model by the name a rig file uses, in alphabetical order."""
    return Named("force model", sorted(_REGISTER.items()))


def unknown_model(name: object) -> str:
    """The error message for an unknown model name, with the most similar known name."""
    models = registered_models()
    of_row = [entry.name for entry in models.values() if entry.row == name]
    if of_row:
        return (
            f"unknown force model {name!r}: that is a row of `{PROGRAM} model list`, whose "
            f"model for a rig file is {', '.join(of_row)}"
        )
    close = get_close_matches(str(name), models, 1)
    hint = f"did you mean {close[0]}?" if close else f"known: {', '.join(models)}"
    return f"unknown force model {name!r}; {hint}"


def create_force_model(
    name: str, geometry: MuscleGeometry, constants: Mapping[str, float] | None = None
) -> ForceModel:
    """Make the force model called `name` for a muscle of this geometry.

    Parameters
    ----------
    name : str
        As in a rig file's `<muscle>.model`.
    geometry : MuscleGeometry
        The muscle.
    constants : mapping of str to float, optional
        The model's own constants; missing ones take the model's defaults.

    Raises
    ------
    RigError
        For an unknown model, an unknown or missing constant, or one out of bounds.
    DomainError
        For a geometry the model does not cover.
    """
    models = registered_models()
    if name not in models:
        raise RigError(unknown_model(name))
    entry = models[name]
    declared: Mapping[str, ModelParameter] = entry.model.parameters
    given = dict(constants or {})
    values: dict[str, float] = {}
    for key, parameter in declared.items():
        value = given.pop(key, parameter.default)
        if value is None:
            raise RigError(f"model {name}: needs {key} [{parameter.unit}], {parameter.description}")
        if not parameter.low <= value <= parameter.high:
            raise RigError(
                f"model {name}: {key} = {value:g} {parameter.unit} is outside "
                f"[{parameter.low:g}, {parameter.high:g}] ({parameter.description})"
            )
        values[key] = float(value)
    if given:
        raise RigError(
            f"model {name}: unknown constant {', '.join(sorted(given))}; "
            f"it has {', '.join(declared) or 'none'}"
        )
    return entry.factory(geometry, values)
