"""What the driver's node reports of itself: the driver's state, and why it is in this state."""

from __future__ import annotations

import time

from pam_driver.driver import Driver
from pam_driver.driver_state_topic import DriverStateTopic
from pam_driver.safety.states import FAULTY, SafetyState
from pam_driver.start_up import StartUp


class ReportedState:
    """Publishes the state of the driver with its reason, if either has changed.

    Parameters
    ----------
    topic : DriverStateTopic
        `~/state` and `~/lamp`.
    start_up : StartUp
        Knows the fault that was latched before a clean-up.
    has_full_speed_input : bool
        Whether an input of the rig permits full speed; without it, the speed is not reduced.

    Attributes
    ----------
    vent_reason : str
        Why the valves vent, where no fault is the reason.
    broken : str
        The exception that ends the process; empty if there is none.
    """

    def __init__(
        self, topic: DriverStateTopic, start_up: StartUp, *, has_full_speed_input: bool
    ) -> None:
        self._topic, self._start_up = topic, start_up
        self._has_full_speed_input = has_full_speed_input
        self._activation = 0  # names the last one
        self.vent_reason = self.broken = ""

    def activated(self) -> None:
        """Valves follow commands from now on."""
        self._activation = time.monotonic_ns()
        self.vent_reason = ""

    def publish(self, driver: Driver | None) -> None:
        """Publish the state of the driver; None if the node is not configured."""
        state = SafetyState.UNCONFIGURED if driver is None else driver.state
        reason = self.vent_reason
        if driver is not None and state in FAULTY:
            reason = "; ".join(str(fault) for fault in driver.faults)
        elif driver is None and self.broken:
            state, reason = SafetyState.FAULT, self.broken
        elif self._start_up.latched:
            reason = f"a fault is latched from before the clean-up: {self._start_up.latched}"
        reduced = self._has_full_speed_input and (
            driver is None or driver.people.reduced_speed(time.monotonic())
        )
        self._topic.publish(state, reason, reduced=reduced, activation=self._activation)
