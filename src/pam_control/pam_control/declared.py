"""Parameters that are declared once, at the field that holds their value.

A field of `ControlSettings`, or of a control law, states its name in a parameter file, unit,
bounds, default and text. The node's parameters, `config/controller.yaml`, the table in
docs/controller.md and `pam control parameters` are made from these declarations
(`controller_parameters`, `parameter_file`), and so are the settings from the values of a parameter
file.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from pam_model.bounds import check_numbers
from pam_model.errors import PamError

Value = bool | int | float | str
BY_SIZE: Final = -1.0
"""A value that follows from the size of each joint; see `pam_control.joint_scale`."""
_DECLARED: Final = "declared"


@dataclass(frozen=True, slots=True)
class BySize:
    """How a value follows from the size of a joint."""

    text: str  # for people, after "-1: "
    of: Callable[[Any, Any], float]  # takes the joint's `JointScale` and its complete settings


def share_of_torque(share: float) -> BySize:
    """A share [-] of the largest torque of a joint."""
    return BySize(
        f"{100.0 * share:.0f} % of the largest torque", lambda size, _: share * size.torque
    )


def share_of_stiffness(share: float, per: str = "") -> BySize:
    """A share [-] of the largest stiffness of a joint; `per` follows in the text."""
    text = f"{100.0 * share:.0f} % of the largest stiffness{per}"
    return BySize(text, lambda size, _: share * size.stiffness)


@dataclass(frozen=True, slots=True)
class Declared:
    """One parameter."""

    key: str  # name in a parameter file
    default: Value  # its type is the type of the parameter
    unit: str  # SI unit, "-" for none
    # low, high: bounds of a number in a parameter file; for one that is by size, of every other
    # value
    low: float
    high: float
    text: str  # what it is, one line
    fixed: bool = False  # whether it is only read at the start
    # whether it is part of the linear loop, whose gains are designed and checked
    loop: bool = False
    # wider bounds for a program; by default every number that is not negative
    possible: tuple[float, float] | None = None
    by_size: BySize | None = None  # what -1 stands for
    # makes the value of the field from that of the parameter file
    read: Callable[[Any], Any] | None = None
    # The laws that use it; empty: all. Of a law's own parameter they are known from its field.
    laws: tuple[str, ...] = ()

    def field(self) -> Any:
        """A field of a dataclass that holds the value of this parameter."""
        return dataclasses.field(default=self.taken(self.default), metadata={_DECLARED: self})

    def taken(self, value: Value) -> Any:
        """The value of the field for one of the parameter file.

        Raises
        ------
        PamError
            For a number that is neither within the bounds nor -1, for what is by size.
        """
        if self.by_size is not None and value != BY_SIZE and not self.low <= float(value):
            raise PamError(
                f"{self.key} = {float(value):g}: must be at least {self.low:g}, or -1 for the "
                "value that follows from the size of each joint"
            )
        return value if self.read is None else self.read(value)

    @property
    def lowest(self) -> float:
        """Lower bound in a parameter file."""
        return self.low if self.by_size is None else BY_SIZE

    @property
    def description(self) -> str:
        """One line with what a person needs to know."""
        used = f" (law {' or '.join(self.laws)})" if self.laws else ""
        size = f"; -1: {self.by_size.text}" if self.by_size is not None else ""
        return f"{self.text}{used}{size}"


def declared(
    key: str, default: Value, unit: str, low: float, high: float, text: str, **how: Any
) -> Any:
    """A field that holds the value of a parameter; see `Declared` for the arguments."""
    return Declared(key, default, unit, low, high, text, **how).field()


def switch(key: str, default: Value, text: str, **how: Any) -> Any:
    """A field for a parameter that is text, true or false."""
    return Declared(key, default, "-", 0, 0, text, **how).field()


def declarations(owner: Any) -> Iterator[tuple[str, Declared]]:
    """The declared fields of a dataclass or of an instance, by the name of the field."""
    for entry in dataclasses.fields(owner):
        if _DECLARED in entry.metadata:
            yield entry.name, entry.metadata[_DECLARED]


def read_fields(owner: Any, values: Mapping[str, Value]) -> dict[str, Any]:
    """The values of the declared fields of a dataclass.

    Parameters
    ----------
    values : mapping
        By name in a parameter file; a field whose parameter is missing is left out.

    Raises
    ------
    PamError
        For a number that is neither within its bounds nor -1, where -1 means "by size".
    """
    return {
        name: each.taken(values[each.key])
        for name, each in declarations(owner)
        if each.key in values
    }


def check_fields(owner: object) -> None:
    """Refuse numbers without a meaning; a parameter file has narrower bounds.

    Raises
    ------
    PamError
        For a number that is not finite, or has a sign or size without a meaning.
    """
    bounds = {}
    for name, each in declarations(owner):
        if type(each.default) is float:
            low = BY_SIZE if each.by_size is not None else 0.0
            bounds[name] = (*(each.possible or (low, math.inf)), "-")
    check_numbers(owner, type(owner).__name__, bounds)


def sized[T](owner: T, size: Any, settings: Any = None) -> T:
    """A copy of a dataclass in which every value that is `BY_SIZE` follows from a joint's size.

    Parameters
    ----------
    owner : dataclass instance
        Settings or a law.
    settings : ControlSettings, optional
        The complete settings of the joint, for values that follow from them as well.
    """
    found = {
        name: each.by_size.of(size, settings)
        for name, each in declarations(owner)
        if each.by_size is not None and getattr(owner, name) == BY_SIZE
    }
    return dataclasses.replace(owner, **found) if found else owner  # type: ignore[type-var]


def changes_loop(one: object, other: object) -> bool:
    """Whether the linear loop of two settings, or of two laws of one kind, differs."""
    return any(
        getattr(one, name) != getattr(other, name) for name, each in declarations(one) if each.loop
    )
