"""Which field of a sensor_msgs/JointState contains a valve's command, as on `valve_commands`.

The kind of valve decides the field. The command of a flow valve is the opening of its spool, from
-1 (exhaust fully open) over 0 (shut) to 1 (supply fully open), in the field `position`. The command
of a pressure regulator is its set point [Pa gauge], in the field `effort`. `velocity` is not used.
A field that no muscle of the rig uses is empty; on a rig with both kinds of valve, both fields have
one value per muscle, which is NaN for the muscles that use the other field.

This module needs no ROS. A muscle is a name with a kind of valve, and the fields of a message are
sequences of numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

from pam_ros.foreign_text import shown

FLOW: Final = "flow"
PRESSURE_REGULATOR: Final = "pressure_regulator"

_VENTED: Final = {FLOW: -1.0, PRESSURE_REGULATOR: 0.0}
_EXPECTED: Final = {
    FLOW: "a flow valve takes position (-1 to 1), and no other field",
    PRESSURE_REGULATOR: "a pressure regulator takes effort (Pa gauge), and no other field",
}


class ValveCommandError(ValueError):
    """A message that is not a valid command for the valves; the text names muscle and field.

    Attributes
    ----------
    kind : str
        What is wrong, for counting: "size", "name" or "field".
    """

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(text)
        self.kind = kind


class ValveFields(NamedTuple):
    """The two fields of a message that carry commands."""

    position: list[float]  # spool openings of flow valves [-1..1]
    effort: list[float]  # set points of pressure regulators [Pa gauge]


class ValveCommandFormat:
    """Writes and reads the valve commands of one rig.

    Parameters
    ----------
    kinds : mapping
        Muscle -> "flow" or "pressure_regulator", in the order of every array on every topic.

    Raises
    ------
    ValueError
        For another kind of valve.

    Attributes
    ----------
    names : tuple of str
        The muscles.
    vented : tuple of float
        The command that empties each muscle: -1 of a flow valve, 0 Pa of a pressure regulator.
    """

    def __init__(self, kinds: Mapping[str, str]) -> None:
        for name, kind in kinds.items():
            if kind not in _VENTED:
                raise ValueError(
                    f"{name}: {kind!r} is not a kind of valve; expected {' or '.join(_VENTED)}"
                )
        self.names = tuple(kinds)
        self.vented = tuple(_VENTED[kind] for kind in kinds.values())
        self._kinds = tuple(kinds.values())
        self._is_flow = tuple(kind == FLOW for kind in self._kinds)
        self._all_flow = all(self._is_flow)
        self._index = {name: index for index, name in enumerate(kinds)}

    def pack(self, commands: Iterable[float]) -> ValveFields:
        """The fields of a message.

        Parameters
        ----------
        commands : iterable of float
            One for each muscle, in order: -1..1 of a flow valve, Pa gauge of a regulator.
        """
        if self._all_flow:
            return ValveFields(list(commands), [])
        pairs = list(zip(commands, self._is_flow, strict=True))
        position = [value if is_flow else math.nan for value, is_flow in pairs]
        effort = [math.nan if is_flow else value for value, is_flow in pairs]
        return ValveFields(position if any(self._is_flow) else [], effort)

    def unpack(
        self,
        names: Sequence[str],
        position: Sequence[float],
        velocity: Sequence[float],
        effort: Sequence[float],
    ) -> list[float]:
        """The commands of a message that must have every muscle once, each in its field.

        Parameters
        ----------
        names, position, velocity, effort : sequence
            Fields of the message; the names may be in any order.

        Returns
        -------
        list of float
            In the order of the rig, as for `pack`. The values are not checked: they may be out of
            range, infinite or NaN.

        Raises
        ------
        ValveCommandError
            For a muscle that is unknown, missing or named twice, a field of a wrong length, or a
            number in a field that the muscle's valve does not use.
        """
        count = len(self.names)
        fields_of_flow = len(position) == count and not len(velocity) and not len(effort)
        if self._all_flow and fields_of_flow and names == self.names:
            return list(position)  # as the controller of the suite sends it
        if len(names) != count:
            raise ValveCommandError(
                "size", f"{len(names)} names, expected {count}: every muscle once"
            )
        for field, values in (("position", position), ("velocity", velocity), ("effort", effort)):
            if len(values) not in {0, count}:
                raise ValveCommandError(
                    "size", f"{len(values)} values in {field}, expected {count}"
                )
        commands: list[float | None] = [None] * count
        for place, name in enumerate(names):
            index = self._index.get(name)
            if index is None:
                raise ValveCommandError("name", f"no muscle called {shown(name)}")
            if commands[index] is not None:
                raise ValveCommandError("name", f"{self.names[index]} is named twice")
            used, unused = (position, effort) if self._is_flow[index] else (effort, position)
            stray = any(len(other) and not math.isnan(other[place]) for other in (unused, velocity))
            if stray or not len(used):
                raise ValveCommandError(
                    "field", f"{self.names[index]}: {_EXPECTED[self._kinds[index]]}"
                )
            commands[index] = used[place]
        return [value for value in commands if value is not None]

    def known(
        self, names: Sequence[str], position: Sequence[float], effort: Sequence[float]
    ) -> dict[str, float]:
        """The commands for the rig's muscles in a message that need not be complete.

        Parameters
        ----------
        names, position, effort : sequence
            Fields of the message, which may have fewer or more muscles than the rig.

        Returns
        -------
        dict of str to float
            Muscle -> finite command, as for `pack`.
        """
        found: dict[str, float] = {}
        for place, name in enumerate(names):
            index = self._index.get(name)
            if index is None:
                continue
            used = position if self._is_flow[index] else effort
            if len(used) == len(names) and math.isfinite(used[place]):
                found[name] = float(used[place])
        return found
