"""One parameter of a node: name, default, unit, range and description, without ROS.

A node's `--help` is made of such rows, and answers before ROS is imported.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any, Final

from pam_ros.errors import ParameterError
from pam_ros.foreign_text import value_shown

Value = bool | int | float | str


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of a node.

    Attributes
    ----------
    name : str
        Name as in a parameter file.
    default : bool, int, float or str
        Default value; its type is the type of the parameter.
    unit : str
        SI unit, "-" for none.
    low, high : float
        Bounds of a number; ignored for text and bool.
    description : str
        One line.
    changeable : bool
        Whether it may change while the node runs.
    """

    name: str
    default: Value
    unit: str
    low: float
    high: float
    description: str
    changeable: bool = False

    def check(self, value: object) -> Value:
        """The value, converted to the type of the parameter.

        Raises
        ------
        ParameterError
            If the value is wrong; the text names parameter, value, unit and what was expected.
        """
        kind = type(self.default)
        if kind is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if type(value) is not kind:
            expected = {float: "a number", int: "a whole number", bool: "true or false"}
            raise ParameterError(
                f"{self.name} = {value_shown(value)}: must be {expected.get(kind, 'text')}"
                + (f" in {self.unit}" if self.unit != "-" else "")
            )
        if isinstance(value, int | float) and not isinstance(value, bool):
            if not math.isfinite(value):
                raise ParameterError(f"{self.name} = {value} {self.unit}: must be a finite number")
            if not self.low <= value <= self.high:
                told = f"{value:g}"
                if self.low <= float(told) <= self.high:  # rounded to the limit
                    told = repr(value)
                raise ParameterError(
                    f"{self.name} = {told} {self.unit}: must be from {self.low:g} to "
                    f"{self.high:g} {self.unit}"
                )
        assert isinstance(value, bool | int | float | str)
        return value


_ROW: Final = "parameter"


def declared(default: Value, unit: str, low: float, high: float, description: str) -> Any:
    """A field of a dataclass that is the parameter of a node of the same name, see `Parameter`."""
    return field(default=default, metadata={_ROW: (unit, low, high, description)})


def declared_rows(settings: type) -> tuple[Parameter, ...]:
    """The parameters that the fields of a dataclass declare."""
    found: list[Any] = [one for one in fields(settings) if _ROW in one.metadata]
    return tuple(Parameter(one.name, one.default, *one.metadata[_ROW]) for one in found)
