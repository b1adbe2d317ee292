"""The orderly end of a driver: lower the arm, stop the I/O thread, vent, close the buses."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Final

from pam_driver.can_bus.bus import CanPort
from pam_driver.driver import Driver
from pam_driver.safety.stalled_cycle import StalledCycleWatch
from pam_model.errors import PamError
from pam_ros.periodic import Loop
from pam_ros.unforeseen import described

_LOOK: Final = 0.05  # s, between two looks at the loop
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

    A loop whose cycle does not return cannot lower anything: the valves vent at once.

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

    can_vent = True
    if driver is not None and loop is not None:
        try:
            _lower(driver, loop, hurry)
        except StalledError as error:
            complain(f"lowering: {error}")
            can_vent = driver.stop_stalled(str(error), time.monotonic())
        except Exception as error:
            complain(f"lowering: {described(error)}")
    if loop is not None:
        attempt("I/O thread", lambda: loop.stop(timeout=1.0))
    if driver is not None and can_vent:
        for _ in range(_LAST_VENTS):
            attempt("venting", lambda: driver.vent_at_once(time.monotonic()))
            time.sleep(0.002)
        attempt("the end of the driver", lambda: driver.close(time.monotonic()))
    for port in ports:
        attempt(f"closing {port.name}", port.close)


class StalledError(PamError):
    """A cycle of the loop does not return."""


def _lower(driver: Driver, loop: Loop, hurry: Callable[[], bool]) -> None:
    before = loop.statistics.cycles  # also in a hurry: a stalled cycle may keep the driver's lock
    _wait_while(lambda: loop.busy and loop.statistics.cycles == before, loop, lambda: False)
    driver.deactivate(time.monotonic())
    # it ends by itself after lowering_timeout as long as the thread runs
    _wait_while(lambda: driver.lowers, loop, hurry)


def _wait_while(condition: Callable[[], bool], loop: Loop, hurry: Callable[[], bool]) -> None:
    """Wait for what the cycles of a loop bring about.

    Raises
    ------
    StalledError
        If a cycle does not return.
    """
    watch, look_at = StalledCycleWatch(_LOOK), time.monotonic()
    while condition() and loop.running and not hurry():
        now = time.monotonic()
        if now >= look_at:
            look_at = now + _LOOK
            if stalled := watch.look(loop):
                raise StalledError(stalled)
        time.sleep(_POLL)
