"""What a driver's process may do by itself when it starts, and what a clean-up must not forget.

A process begins to measure by itself. It activates by itself only if that was asked for, once, and
only if nothing has stopped it before: a vent, a fault or a clean-up cancels the request for good.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from pam_driver.driver import ActivationError, Driver
from pam_driver.safety.states import SafetyState


class Advice(Enum):
    """What the process does next while it starts."""

    WAIT = "wait"
    ACTIVATE = "activate"
    READY = "ready"
    CANCELLED = "cancelled"
    GIVE_UP = "give up"


class StartStep(NamedTuple):
    """What the process does next, and why."""

    advice: Advice
    reason: str = ""


class StartUp:
    """The start of one process, and the fault that it was cleaned up with.

    Attributes
    ----------
    latched : str
        The fault that was latched when the node was cleaned up, if not every board keeps it; kept
        until faults are cleared.
    """

    def __init__(self) -> None:
        self.latched = ""
        self._until: float | None = None
        self._activates = False

    def begin(self, until: float, activates: bool) -> None:
        """Wait for the boards until a monotonic time [s], then activate if that is asked for."""
        self._until = until
        self._activates = activates

    def cancel(self) -> bool:
        """Cancel an activation that is waiting; whether there was one."""
        waited = self._until is not None and self._activates
        self._activates = False
        return waited

    def end(self) -> None:
        """Stop waiting: the driver is active, or there is no driver any more."""
        self._until = None
        self._activates = False

    def step(self, driver: Driver, now: float) -> StartStep:
        """What to do now while the boards are waited for."""
        if self._until is None:
            return StartStep(Advice.WAIT)
        faulty = [found for found in driver.conditions if found.kind == "board_fault"]
        faulty += driver.faults
        if faulty and self.cancel():
            return StartStep(Advice.CANCELLED, str(faulty[0]))
        problem = self.problem(driver, now)
        if not problem:
            activates = self._activates
            self.end()
            return StartStep(Advice.ACTIVATE if activates else Advice.READY)
        if now > self._until:  # a robot must not start by itself when someone plugs it in later
            self.end()
            return StartStep(Advice.GIVE_UP, problem)
        return StartStep(Advice.WAIT, problem)

    def problem(self, driver: Driver, now: float) -> str:
        """Why an activation would be refused; empty if it would succeed."""
        if self.latched:
            return (
                "a fault from before the clean-up is still latched "
                f"({self.latched}); when its cause is gone, call ~/clear_faults"
            )
        return driver.activation_problem(now)

    def activate(self, driver: Driver, now: float) -> None:
        """Activate the driver.

        Raises
        ------
        ActivationError
            If something is wrong; then nothing has changed.
        """
        if self.latched:
            raise ActivationError(self.problem(driver, now))
        driver.activate(now)

    def clear_faults(self, driver: Driver, now: float) -> None:
        """Clear the faults of the driver, of the boards, and of the time before a clean-up."""
        driver.clear_faults(now)
        self.latched = ""

    def leave(self, driver: Driver) -> None:
        """Remember a latched fault that not every board keeps, before the driver is closed."""
        lowering = driver.state is SafetyState.FAULT_LOWERING  # the boards do not keep it yet
        if lowering or (driver.state is SafetyState.FAULT and not driver.boards_keep_fault):
            self.latched = "; ".join(str(fault) for fault in driver.faults)
        self.end()
