"""Checks valve commands by name, field, value and age; a wrong command is refused as a whole.

`pam_ros.valve_command` defines which field of the message holds the command of a muscle.

Two publishers that command the same valves are recognised by the sources that their commands name
(`pam_ros.message_sources`).

After a refused command the previous one stays valid until it is too old. A continuous stream of
refused commands therefore ends in a vent.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from pam_driver.boards.protocol import Condition
from pam_model.errors import PamError
from pam_model.rig import Muscle, Rig
from pam_model.within_limits import beyond, within
from pam_ros.message_sources import MessageSources
from pam_ros.valve_command import ValveCommandError, ValveCommandFormat, ValveFields

# A stamp may be ahead of the receiver's clock by so much, since clocks on one machine differ [s].
_FUTURE: Final = 0.01


class CommandRefusedError(PamError):
    """A valve command that is refused; `kind` is the name under which it is counted."""

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(text)
        self.kind = kind


class NamedCommand(NamedTuple):
    """A valve command as received in a JointState."""

    names: Sequence[str]  # every muscle of the rig once, in any order
    # position, velocity, effort: the fields of the message, see `pam_ros.valve_command`
    position: Sequence[float] = ()
    velocity: Sequence[float] = ()
    effort: Sequence[float] = ()
    age: float = 0.0  # time since the command was computed [s]
    source: str = ""  # who computed it; empty if the publisher does not say


class ValveCommandIntake:
    """Turns named commands in their units into fractions of full scale, in the rig's order.

    Attributes
    ----------
    rejected : Counter
        Number of refused commands by kind.
    last_rejection : str
        Why the last one was refused.
    accepted : int
        Number of accepted commands.
    vented : tuple of float
        The fractions of full scale that empty each muscle.
    """

    def __init__(self, rig: Rig, timeout: float) -> None:
        self.timeout = timeout
        self.rejected: Counter[str] = Counter()
        self.last_rejection = ""
        self.accepted = 0
        self._format = ValveCommandFormat(rig.valve_kinds)
        self._scale = tuple(_scale(muscle) for muscle in rig.muscles)
        # -1 for a flow valve, 0 for a pressure regulator
        self.vented = self._format.vented
        self._newest = -math.inf
        self._sources = MessageSources()

    def hear(self, source: str, now: float) -> None:
        """Note whose command has arrived, whether or not it will be used.

        Parameters
        ----------
        source : str
            As in `NamedCommand`.
        now : float
            Monotonic time [s].
        """
        self._sources.hear(source, now)

    def conditions(self, now: float) -> Iterator[Condition]:
        """Whether two publishers command the valves."""
        who = self._sources.taking_turns(now)
        if who:
            text = f"two nodes publish commands, {who}: stop one of them"
            yield Condition("two_publishers", "valve_commands", text)

    def take(self, command: NamedCommand, now: float) -> tuple[float, ...]:
        """Fractions of full scale by muscle.

        Raises
        ------
        CommandRefusedError
            If the command is refused; the text says what is wrong. The command is counted and must
            not be used.
        """
        try:
            values = self._checked(command, now)
        except CommandRefusedError as error:
            self._count(error)
            raise
        self._newest = now - command.age
        self.accepted += 1
        return values

    def refuse(self, kind: str, reason: str) -> None:
        """Count a command that is refused for a reason outside of it.

        Parameters
        ----------
        kind : str
            Name under which it is counted.
        reason : str
            Why it is refused.

        Raises
        ------
        CommandRefusedError
            Always.
        """
        error = CommandRefusedError(kind, reason)
        self._count(error)
        raise error

    def _count(self, error: CommandRefusedError) -> None:
        self.rejected[error.kind] += 1
        self.last_rejection = str(error)

    def in_units(self, fractions: Sequence[float]) -> ValveFields:
        """Fractions of full scale, by muscle, as the fields of a JointState."""
        return self._format.pack(
            part * scale[2] for part, scale in zip(fractions, self._scale, strict=True)
        )

    def _checked(self, command: NamedCommand, now: float) -> tuple[float, ...]:
        self._check_age(command.age, now)
        try:
            values = self._format.unpack(
                command.names, command.position, command.velocity, command.effort
            )
        except ValveCommandError as error:
            raise CommandRefusedError(error.kind, str(error)) from None
        return tuple(self._fraction(index, value) for index, value in enumerate(values))

    def _check_age(self, age: float, now: float) -> None:
        if not age >= -_FUTURE:
            raise CommandRefusedError("stamp", f"stamped {-age:.3f} s in the future")
        if age > self.timeout:
            raise CommandRefusedError(
                "old", f"{age:.3f} s old, command_timeout is {self.timeout:g} s"
            )
        if now - age < self._newest - _FUTURE:
            raise CommandRefusedError("out_of_order", "older than the previous command")

    def _fraction(self, index: int, value: float) -> float:
        lowest, highest, scale, unit = self._scale[index]
        if lowest <= value <= highest:
            return value / scale
        name = self._format.names[index]
        if not math.isfinite(value):
            raise CommandRefusedError("not_finite", f"{name}: {value} is not a finite number")
        if not within(value, lowest, highest):
            told, low, high = beyond(value, lowest, highest)
            raise CommandRefusedError(
                "out_of_range", f"{name}: {told} {unit}, expected {low} to {high} {unit}"
            )
        return min(max(value, lowest), highest) / scale


def _scale(muscle: Muscle) -> tuple[float, float, float, str]:
    """Lowest, highest and full-scale command of a muscle, with its unit."""
    valve = muscle.valve
    if valve.kind == "flow":
        return -1.0, 1.0, 1.0, "of full opening"
    if valve.full_scale is None or not valve.full_scale > 0.0:
        raise PamError(f"{muscle.name}.valve.full_scale: a pressure regulator needs it [Pa gauge]")
    return 0.0, min(valve.full_scale, muscle.max_pressure), valve.full_scale, "Pa"
