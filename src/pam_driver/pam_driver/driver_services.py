"""The services of the driver's node: `~/vent` and `~/clear_faults`."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from std_srvs.srv import Trigger

from pam_driver.driver import Driver
from pam_driver.driver_log import DriverLog
from pam_driver.reported_state import ReportedState
from pam_driver.safety.states import FAULTY, MOVING
from pam_driver.start_up import StartUp

_NOT_CONFIGURED = "not configured: the bus is not open"


class DriverServices:
    """Answers the services of a driver, which may not be configured.

    Parameters
    ----------
    node : rclpy.node.Node
        The driver's node.
    driver : callable
        Returns the driver, or None.
    start_up : StartUp
        Its activation at start-up, which a vent cancels.
    reported : ReportedState
        Gets the reasons.
    """

    def __init__(
        self,
        node: Any,
        driver: Callable[[], Driver | None],
        start_up: StartUp,
        reported: ReportedState,
        log: DriverLog,
    ) -> None:
        self._driver, self._start_up = driver, start_up
        self._reported, self._log = reported, log
        node.create_service(Trigger, "~/vent", self.on_vent)
        node.create_service(Trigger, "~/clear_faults", self.on_clear_faults)

    def vent(self, reason: str) -> None:
        """Lower the joints and vent; the frames are sent before this returns."""
        driver = self._driver()
        if driver is not None:
            driver.vent(time.monotonic())
            self._reported.vent_reason = reason

    def cancel_start(self, reason: str) -> bool:
        """Cancel the activation at start-up, if one is waiting, and say so."""
        if self._start_up.cancel():
            self._log.start_cancelled(reason)
            return True
        return False

    def on_vent(self, request: Any, response: Any) -> Any:
        """Answer a call of `~/vent`."""
        driver = self._driver()
        if driver is None:
            response.success, response.message = False, _NOT_CONFIGURED
            return response
        self.vent("a call of ~/vent")
        self._reported.publish(driver)
        done = "lowering; call again to vent at once" if driver.lowers else "valves vented"
        if self.cancel_start("a call of ~/vent"):
            done += ", and the activation at start-up is cancelled"
        response.success, response.message = True, f"{done}; activate to move"
        return response

    def on_clear_faults(self, request: Any, response: Any) -> Any:
        """Answer a call of `~/clear_faults`."""
        driver = self._driver()
        if driver is None:
            response.success, response.message = False, _NOT_CONFIGURED
            return response
        self._start_up.clear_faults(driver, time.monotonic())
        self._log.faults_cleared()
        rests = driver.state not in MOVING and not driver.lowers
        if rests:
            self._reported.vent_reason = "faults cleared, not activated yet"
            self._reported.publish(driver)
        response.success = driver.state not in FAULTY
        response.message = driver.state.value + ("; activate to move" if rests else "")
        return response
