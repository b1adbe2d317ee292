"""The parameters of a node in one table: declared with unit and range, and checked when set.

A node is made with `automatically_declare_parameters_from_overrides=True`, so that it receives
every key of its parameter files: its own parameters, the keys of anything else that the file
describes (the robot, for most nodes), and unknown keys, which ROS would silently ignore and which
are refused here. The node passes a function that reads the keys that are not its own parameters.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, Protocol

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.parameter import Parameter as RosParameter

from pam_ros.errors import ParameterError
from pam_ros.foreign_text import shown
from pam_ros.parameter_files import given_files, refuse_doubled_keys, refuse_lost_sections
from pam_ros.parameter_row import Parameter, Value

OnChange = Callable[[Mapping[str, Value]], str | None]
_OF_ROS = ("use_sim_time", "start_type_description_service", "qos_overrides")


class OtherKey(Protocol):
    """The description of a key that is not the node's own: a number if its bounds differ."""

    @property
    def text(self) -> str:
        """One line."""

    @property
    def unit(self) -> str:
        """SI unit, "-" for none."""

    @property
    def low(self) -> float:
        """Lower bound."""

    @property
    def high(self) -> float:
        """Upper bound."""


def _descriptor(name: str, text: str, unit: str, read_only: bool) -> Any:
    return ParameterDescriptor(name=name, description=f"{text} [{unit}]", read_only=read_only)


def _declaration(parameter: Parameter) -> Any:
    """The description that `ros2 param describe` shows: text, unit and range."""
    made = _descriptor(
        parameter.name, parameter.description, parameter.unit, not parameter.changeable
    )
    low, high = parameter.low, parameter.high
    if type(parameter.default) is float:
        made.floating_point_range = [
            FloatingPointRange(from_value=float(low), to_value=float(high))
        ]
    elif type(parameter.default) is int:
        made.integer_range = [IntegerRange(from_value=int(low), to_value=int(high))]
    return made


def _declaration_of_other(name: str, value: Any, key: OtherKey) -> tuple[Any, Any]:
    """Value and descriptor of a key that is only read at the start."""
    descriptor = _descriptor(name, key.text, key.unit, read_only=True)
    if not key.low < key.high:
        return value, descriptor
    between = FloatingPointRange(from_value=float(key.low), to_value=float(key.high))
    if isinstance(value, array | Sequence) and not isinstance(value, str):
        descriptor.additional_constraints = f"each from {key.low:g} to {key.high:g} {key.unit}"
        return value, descriptor
    descriptor.floating_point_range = [between]
    return float(value), descriptor


class NodeParameters[Described]:
    """The parameters of a running node, and the other content of its parameter file.

    Parameters
    ----------
    node : rclpy.node.Node
        Made with `automatically_declare_parameters_from_overrides=True`.
    table : sequence of Parameter
        The node's own parameters.
    read_others : callable
        Reads the keys that are not in the table, for example a robot description. It takes these
        keys with their values and the names in the table (so that its message about an unknown key
        can suggest one of them), and raises an exception for a key that it does not know.
    describe : callable
        Describes a key that is not in the table; takes the result of `read_others` and
        the key's name.
    usual_name : str
        Name of the node unless it is renamed: sections of parameter files with this name that
        ROS does not apply are refused, see `pam_ros.parameter_files`.
    keeps_real_time : bool, optional
        Refuse `use_sim_time`, at the start and while the node runs. It must be set for a node that
        moves air or judges the age of measurements: with a simulated clock that stops, old values
        would never become too old.
    on_change : callable, optional
        Takes a mapping of the values that change, after they were checked; it refuses the change
        by raising a ParameterError. It may return a remark for the person who asked, see
        `with_remark`.

    Raises
    ------
    ParameterError
        If a parameter is out of bounds or of a wrong type, or a section of a parameter file was
        meant for this node and is not applied.

    Attributes
    ----------
    described : object
        The result of `read_others`.
    """

    def __init__(
        self,
        node: Any,
        table: Sequence[Parameter],
        read_others: Callable[[Mapping[str, Any], Collection[str]], Described],
        on_change: OnChange | None = None,
        *,
        describe: Callable[[Described, str], OtherKey],
        usual_name: str,
        keeps_real_time: bool = False,
    ) -> None:
        full_name = node.get_fully_qualified_name()
        refuse_doubled_keys(full_name, given_files())
        for warning in refuse_lost_sections(full_name, usual_name, given_files()):
            node.get_logger().warning(warning)
        self._node = node
        self._remark = ""
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
            # ROS has declared a parameter of a file without unit and range, perhaps as an integer
            if name in given:
                node.undeclare_parameter(name)
            node.declare_parameter(
                name, self._values[name], _declaration(parameter), ignore_override=True
            )
        for name, value in others.items():
            known, descriptor = _declaration_of_other(name, value, describe(self.described, name))
            node.undeclare_parameter(name)
            node.declare_parameter(name, known, descriptor, ignore_override=True)
        node.add_on_set_parameters_callback(self._set)

    def __getitem__(self, name: str) -> Value:
        return self._values[name]

    def number(self, name: str) -> float:
        """The value of a numeric parameter as a float."""
        return float(self._values[name])

    def with_remark(self, result: Any) -> Any:
        """The result of the last change with the remark of `on_change`, which rclpy drops."""
        if result.successful:
            result.reason = self._remark
        return result

    def restore(self, values: Mapping[str, Value]) -> None:
        """Set parameters back to former values, which are not checked again."""
        self._values.update(values)  # so that `_set` finds no change
        self._node.set_parameters([RosParameter(name, value=v) for name, v in values.items()])

    def _check_clock(self, name: str, value: Any) -> None:
        if self._keeps_real_time and name == "use_sim_time" and value is True:
            raise ParameterError(
                "use_sim_time = true: refused, because this node judges the age of commands and "
                "measurements, and they would never become too old if a simulated clock stops"
            )

    def _set(self, requested: Sequence[Any]) -> Any:
        changes: dict[str, Value] = {}
        self._remark = ""
        try:
            for entry in requested:
                parameter = self._table.get(entry.name)
                self._check_clock(entry.name, entry.value)
                if parameter is None:
                    if entry.name.split(".")[0] in _OF_ROS:
                        continue
                    told = shown(entry.name)
                    raise ParameterError(
                        f"{told}: is only read from the parameter file when the node starts"
                    )
                value = parameter.check(entry.value)
                if not parameter.changeable:
                    raise ParameterError(f"{parameter.name}: can only be changed by a restart")
                changes[entry.name] = value
            # a value that is set again and again must not cost a new design each time
            changes = {name: new for name, new in changes.items() if new != self._values[name]}
            if changes and self._on_change is not None:
                self._remark = self._on_change(changes) or ""
        except ParameterError as error:
            return SetParametersResult(successful=False, reason=str(error))
        self._values.update(changes)
        return SetParametersResult(successful=True)
