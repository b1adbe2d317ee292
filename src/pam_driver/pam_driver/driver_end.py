"""The orderly end of a driver: lower the arm, stop the I/O thread, vent, close the buses."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Final

from pam_driver.can_bus.bus import CanPort
from pam_driver.driver import Driver
from pam_ros.periodic import Loop
from pam_ros.unforeseen import described

# The final vent is sent several times: a frame may be lost, and the bus is closed afterwards.
_LAST_VENTS: Final = 5
_POLL: Final = 0.005  # s


def end_driver(
    driver: Driver | None,
    loop: Loop | None,
    ports: Iterable[CanPort],
    hurry: Callable[[], bool],
    complain: Callable[[str], None],
) -> None:
    """Lower the joints if they hold, then vent and close the buses.

    Parameters
    ----------
    driver : Driver or None
        The driver, if it exists.
    loop : Loop or None
        Runs its cycles.
    ports : iterable of CanPort
        The open buses.
    hurry : callable
        Whether the lowering must be cut short.
    complain : callable
        Takes the message of an error that happened on the way; the valves vent all the same.
    """

    def attempt(what: str, act: Callable[[], object]) -> None:
        try:
            act()
        except Exception as error:  # no error on the way must keep the valves open
            complain(f"{what}: {described(error)}")

    if driver is not None and loop is not None:
        attempt("lowering", lambda: _lower(driver, loop, hurry))
    if loop is not None:
        attempt("I/O thread", lambda: loop.stop(timeout=1.0))
    if driver is not None:
        for _ in range(_LAST_VENTS):
            attempt("venting", lambda: driver.vent_at_once(time.monotonic()))
            time.sleep(0.002)
        attempt("the end of the driver", lambda: driver.close(time.monotonic()))
    for port in ports:
        attempt(f"closing {port.name}", port.close)


def _lower(driver: Driver, loop: Loop, hurry: Callable[[], bool]) -> None:
    driver.deactivate(time.monotonic())
    # it ends by itself after lowering_timeout as long as the thread runs
    while driver.lowers and loop.running and not hurry():
        time.sleep(_POLL)
