"""The stream of torques that a planner commands."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pam_control.references.trajectory import CommandError


class TorqueCommands:
    """The last commanded torques of all joints.

    Parameters
    ----------
    names : sequence of str
        Of the joints, in the rig's order.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        self._values: list[float] = []
        self._heard = -math.inf

    def command(self, values: Sequence[float], now: float) -> None:
        """Take the torque of every joint [N m] at a time [s].

        Raises
        ------
        CommandError
            For a wrong size or a value that is not finite; nothing is changed.
        """
        if len(values) != len(self._names):
            raise CommandError(
                f"torque command rejected: {len(values)} values for {len(self._names)} joints"
            )
        for name, value in zip(self._names, values, strict=True):
            if not math.isfinite(value):
                raise CommandError(f"torque command rejected: {name} at {value} N m")
        self._values, self._heard = [float(value) for value in values], now

    def drop(self) -> None:
        """Forget them: they do not move a joint later."""
        self._heard = -math.inf

    def at(self, time: float, timeout: float) -> Sequence[float | None]:
        """The torques [N m] that hold at a time [s]; None without one that is young enough [s]."""
        if time - self._heard <= timeout:
            return self._values
        return [None] * len(self._names)
