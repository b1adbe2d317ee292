"""The topics `~/state` and `~/lamp` of the driver, which are published when they change."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from std_msgs.msg import String

from pam_driver.safety.states import LAMPS, SafetyState
from pam_ros.driver_state import LATCHED, driver_state_message


class DriverStateTopic:
    """Publishes the state of a driver and its lamp, both latched.

    Parameters
    ----------
    name : str
        Of the driver's node.
    create_publisher : callable
        Creates a plain publisher of the node: that of a lifecycle node is silent until the node is
        active.
    also : callable, optional
        Is given every message on `~/state` as well.

    Attributes
    ----------
    text : str
        The last message on `~/state`, for people.
    """

    def __init__(
        self,
        name: str,
        create_publisher: Callable[..., Any],
        also: Callable[[Any], object] | None = None,
    ) -> None:
        self._states = create_publisher(DiagnosticStatus, "~/state", LATCHED)
        self._lamps = create_publisher(String, "~/lamp", LATCHED)
        self._name = name
        self._also = also
        self.text = self._lamp = ""
        self._activation = 0

    def publish(
        self, state: SafetyState, reason: str, *, reduced: bool = False, activation: int = 0
    ) -> None:
        """Publish what has changed; the arguments are those of `driver_state_message`."""
        message = driver_state_message(
            self._name, state.value, reason, reduced=reduced, activation=activation
        )
        if (message.message, activation) != (self.text, self._activation):
            self.text, self._activation = message.message, activation
            self._states.publish(message)
            if self._also is not None:
                self._also(message)
        if LAMPS[state] != self._lamp:
            self._lamp = LAMPS[state]
            self._lamps.publish(String(data=self._lamp))
