"""Follows the driver's state: while it takes no commands, nothing is followed."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from pam_control.command_intake import CommandIntake
from pam_control.controller import Controller
from pam_ros.driver_state import activation_of, permits_full_speed, reason_against_commands


class DriverFollower:
    """What the driver has said last, and what follows for the controller.

    Parameters
    ----------
    controller : Controller
        Drops its commands.
    intake : CommandIntake
        What still waits there is superseded.
    lock : Lock
        Held whenever the controller is used.
    clock : callable
        The controller's time [s].
    drop_goal : callable
        Ends the goal of an action, with the reason.

    Attributes
    ----------
    reason : str
        Why the driver takes no commands; empty if it does, or without a driver that says so.
    silence : str
        Why the controller sends no commands; empty if it does.
    said : str
        What the driver has said last about commands.
    """

    def __init__(
        self,
        controller: Controller,
        intake: CommandIntake,
        lock: threading.Lock,
        clock: Callable[[], float],
        drop_goal: Callable[[str], None],
    ) -> None:
        self._controller, self._intake, self._lock = controller, intake, lock
        self._clock, self._drop_goal = clock, drop_goal
        self._activation = ""  # the last one that was received
        self.reason = ""
        self.silence = "no measurement yet"
        self.said = "no state received"

    def take(self, message: Any) -> None:
        """Take a state: while the driver takes no commands, references are dropped and refused.

        When it takes commands again, or was activated again, the next cycle takes over the joints
        where they are.
        """
        with self._lock:
            if self._controller.rig.people.full_speed_topic:
                self._controller.limits.reduce_speed(not permits_full_speed(message), self._clock())
            self.reason = reason_against_commands(message)
            self.said = self.reason or "takes commands"
            before, self._activation = self._activation, activation_of(message)
            if self.reason or self._activation != before:
                self._drop(self.reason or "the driver was activated again")
                self.silence = self.reason

    def lose(self) -> None:
        """A state in which the driver takes no commands may have been among those lost."""
        with self._lock:
            self._drop("more messages of the driver's state arrived at once than are kept")

    def _drop(self, reason: str) -> None:
        """Drop what the controller follows; the lock is held.

        This holds although the next message, taken in the same cycle, says that all is well.
        """
        self._controller.drop_commands()
        self._intake.supersede()
        self._drop_goal(reason)

    def reason_against_references(self) -> str:
        """Why no references are taken; empty if they are."""
        if not self._controller.active:
            return f"the controller is not active: {self.silence}"
        return self._controller.reason_against_references()
