"""The orderly end of a driver: lower the arm, stop the I/O thread, vent, close the buses."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Final

from pam_driver.can_bus.bus import CanPort
from pam_driver.driver import Driver
from pam_ros.periodic import PeriodicLoop

# The final vent is sent several times: a frame may be lost, and the bus is closed afterwards.
_LAST_VENTS: Final = 5
_POLL: Final = 0.005  # s


def end_driver(
    driver: Driver | None,
    loop: PeriodicLoop | None,
    ports: Iterable[CanPort],
    hurry: Callable[[], bool],
    complain: Callable[[str], None],
) -> None:
    """Lower the joints if they hold, then vent and close the buses.

    Parameters
    ----------
    driver : Driver or None
        The driver, if it exists.
    loop : PeriodicLoop or None
        The thread that runs its cycles.
    ports : iterable of CanPort
        The open buses.
    hurry : callable
        Whether the lowering must be cut short.
    complain : callable
        Takes the message of an error that happened on the way; the valves vent all the same.
    """
    try:
        if driver is not None and loop is not None:
            driver.deactivate(time.monotonic())
            # it ends by itself after lowering_timeout as long as the thread runs
            while driver.lowers and loop.running and not hurry():
                time.sleep(_POLL)
        if loop is not None:
            loop.stop(timeout=1.0)
    except Exception as error:  # an error of the thread must not keep the valves open
        complain(f"I/O thread: {error}")
    finally:
        if driver is not None:
            for _ in range(_LAST_VENTS):
                driver.vent_at_once(time.monotonic())
                time.sleep(0.002)
            driver.close(time.monotonic())
        for port in ports:
            port.close()
