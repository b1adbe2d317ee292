"""A node's parameters, written down once: declared with unit and range, checked when set.

A node is made with `automatically_declare_parameters_from_overrides=True`, so that everything in
its parameter files is seen: the node's own parameters, the keys of whatever else the file
describes (the robot, for most nodes), and keys that nobody knows, which ROS would drop in silence
and which are refused here. What those other keys mean is for the node to say: it hands in the
function that reads them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)

from pam_ros.errors import ParameterError

Value = bool | int | float | str
_OF_ROS = ("use_sim_time", "start_type_description_service", "qos_overrides")


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of a node.

    Attributes
    ----------
    name : str
        As in a parameter file.
    default : bool, int, float or str
        Its type is the parameter's.
    unit : str
        SI, "-" for none.
    low, high : float
        Bounds of a number; ignored for text and switches.
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
        """The value in the parameter's type.

        Raises
        ------
        ParameterError
            Naming parameter, value, unit and what was expected.
        """
        kind = type(self.default)
        if kind is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if type(value) is not kind:
            expected = {float: "a number", int: "a whole number", bool: "true or false"}
            raise ParameterError(
                f"{self.name} = {value!r}: must be {expected.get(kind, 'text')}"
                + (f" in {self.unit}" if self.unit != "-" else "")
            )
        if isinstance(value, int | float) and not isinstance(value, bool):
            if not math.isfinite(value):
                raise ParameterError(f"{self.name} = {value} {self.unit}: must be a finite number")
            if not self.low <= value <= self.high:
                raise ParameterError(
                    f"{self.name} = {value:g} {self.unit}: must be from {self.low:g} to "
                    f"{self.high:g} {self.unit}"
                )
        assert isinstance(value, bool | int | float | str)
        return value

    def descriptor(self) -> Any:
        """What `ros2 param describe` shows: text, unit and range."""
        descriptor = ParameterDescriptor(
            name=self.name,
            description=f"{self.description} [{self.unit}]",
            read_only=not self.changeable,
        )
        if type(self.default) is float:
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=float(self.low), to_value=float(self.high))
            ]
        elif type(self.default) is int:
            descriptor.integer_range = [
                IntegerRange(from_value=int(self.low), to_value=int(self.high))
            ]
        return descriptor


class NodeParameters[Described]:
    """The parameters of a running node, and what else its parameter file describes.

    Parameters
    ----------
    node : rclpy.node.Node
        Made with `automatically_declare_parameters_from_overrides=True`.
    table : sequence of Parameter
        All the node has of its own.
    read_others : callable
        Makes something of the keys that are not in the table, for example a robot description.
        It takes these keys with their values and the names of the table (so that its message
        about an unknown key can suggest one of them), and raises for a key that it does not know.
    keeps_real_time : bool, optional
        The node moves air or decides by the age of a measurement, so `use_sim_time` is refused, at
        the start and while it runs: a simulated clock that stops would keep old values young.
    on_change : callable, optional
        Takes a mapping of the values that change, after they were checked; a ParameterError it
        raises refuses the change.

    Raises
    ------
    ParameterError
        For a parameter that is out of bounds or of another type.

    Attributes
    ----------
    described : object
        What `read_others` has made.
    """

    def __init__(
        self,
        node: Any,
        table: Sequence[Parameter],
        read_others: Callable[[Mapping[str, Any], Collection[str]], Described],
        on_change: Callable[[Mapping[str, Value]], None] | None = None,
        *,
        keeps_real_time: bool = False,
    ) -> None:
        self._keeps_real_time = keeps_real_time
        self._check_clock("use_sim_time", node.get_parameter("use_sim_time").value)
        self._table = {parameter.name: parameter for parameter in table}
        self._on_change = on_change
        given = {name: entry.value for name, entry in node.get_parameters_by_prefix("").items()}
        others = {
            name: value
            for name, value in given.items()
            if name not in self._table and name.split(".")[0] not in _OF_ROS
        }
        self.described = read_others(others, tuple(self._table))
        self._values: dict[str, Value] = {
            name: parameter.check(given.get(name, parameter.default))
            for name, parameter in self._table.items()
        }
        for name, parameter in self._table.items():
            # what a file brought was declared without unit and range, perhaps as an integer
            if name in given:
                node.undeclare_parameter(name)
            node.declare_parameter(
                name, self._values[name], parameter.descriptor(), ignore_override=True
            )
        node.add_on_set_parameters_callback(self._set)

    def __getitem__(self, name: str) -> Value:
        return self._values[name]

    def number(self, name: str) -> float:
        """The value of a numeric parameter as a float."""
        return float(self._values[name])

    def _check_clock(self, name: str, value: Any) -> None:
        if self._keeps_real_time and name == "use_sim_time" and value is True:
            raise ParameterError(
                "use_sim_time = true: refused, because this node judges the age of commands and "
                "measurements, and a simulated clock that stops would keep them young for ever"
            )

    def _set(self, requested: Sequence[Any]) -> Any:
        changes: dict[str, Value] = {}
        try:
            for entry in requested:
                parameter = self._table.get(entry.name)
                self._check_clock(entry.name, entry.value)
                if parameter is None:
                    if entry.name.split(".")[0] in _OF_ROS:
                        continue
                    raise ParameterError(
                        f"{entry.name}: is read from the parameter file when the node starts"
                    )
                value = parameter.check(entry.value)
                if not parameter.changeable:
                    raise ParameterError(f"{entry.name}: only a restart changes it")
                changes[entry.name] = value
            if changes and self._on_change is not None:
                self._on_change(changes)
        except ParameterError as error:
            return SetParametersResult(successful=False, reason=str(error))
        self._values.update(changes)
        return SetParametersResult(successful=True)
