"""What may happen next: acts of an operator, processes that end or start, faults, time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from pam_check.state_walk.system import (
    MISSING,
    TICK,
    ControllerProcess,
    DriverProcess,
    System,
    too_high,
)
from pam_check.state_walk.watcher import Watcher

Act = Callable[[System, Watcher], bool]
"""Changes the system and tells the watcher; False if it is not possible now."""


def _configured(system: System) -> bool:
    return system.driver is not None and system.driver.driver is not None


def nothing(system: System, watcher: Watcher) -> bool:
    """Only time passes."""
    return True


def start_driver(system: System, watcher: Watcher) -> bool:
    """The driver starts and measures (autostart)."""
    return _start(system, watcher, autostart=True, activates=False)


def start_driver_that_activates(system: System, watcher: Watcher) -> bool:
    """The driver starts and is asked to activate itself (activate_on_start)."""
    return _start(system, watcher, autostart=True, activates=True)


def start_driver_without_autostart(system: System, watcher: Watcher) -> bool:
    """The driver starts and waits to be configured."""
    return _start(system, watcher, autostart=False, activates=False)


def _start(system: System, watcher: Watcher, *, autostart: bool, activates: bool) -> bool:
    if system.driver is not None:
        return False
    system.driver = DriverProcess(system.rig, system.wiring, system.wire)
    if system.one_process:
        system.controller = ControllerProcess(system.rig)
    system.publish()
    if autostart:
        system.driver.autostart(activates, system.now)
        system.publish()
    watcher.driver_starts(activates)
    return True


def kill_driver(system: System, watcher: Watcher) -> bool:
    """The driver is killed (kill -9)."""
    if system.driver is None:
        return False
    watcher.driver_ends(system)
    _gone(system)
    system.published = ""
    return True


def _gone(system: System) -> None:
    """The driver's process has ended, with all that it runs."""
    system.driver = None
    if system.one_process:
        system.controller = None


def end_driver(system: System, watcher: Watcher) -> bool:
    """The driver ends after a signal (Ctrl-C)."""
    if system.driver is None:
        return False
    system.driver.close(system.now)
    system.publish()
    watcher.driver_ends(system)
    _gone(system)
    return True


def configure(system: System, watcher: Watcher) -> bool:
    """The operator configures the driver."""
    if system.driver is None or system.driver.driver is not None:
        return False
    system.driver.configure()
    system.publish()
    return True


def clean_up(system: System, watcher: Watcher) -> bool:
    """The operator cleans the driver up."""
    if system.driver is None or system.driver.driver is None or system.driver.active:
        return False
    watcher.stops(system)
    system.driver.start_up.cancel()
    system.driver.close(system.now)
    system.publish()
    return True


def activate(system: System, watcher: Watcher) -> bool:
    """The operator activates the driver."""
    process = system.driver
    if process is None or process.driver is None or process.active:
        return False
    if not process.activate(system.now):
        return False
    system.publish()
    watcher.is_activated(system)
    return True


def deactivate(system: System, watcher: Watcher) -> bool:
    """The operator deactivates the driver."""
    if system.driver is None or not system.driver.active:
        return False
    watcher.stops(system)
    system.driver.deactivate(system.now)
    system.publish()
    return True


def vent(system: System, watcher: Watcher) -> bool:
    """The operator calls ~/vent."""
    if not _configured(system):
        return False
    assert system.driver is not None
    watcher.stops(system)
    system.driver.vent(system.now)
    system.publish()
    return True


def clear_faults(system: System, watcher: Watcher) -> bool:
    """The operator calls ~/clear_faults."""
    if not _configured(system):
        return False
    assert system.driver is not None
    system.driver.clear_faults(system.now)
    system.publish()
    watcher.is_cleared()
    return True


def switch_board_off_and_on(system: System, watcher: Watcher) -> bool:
    """The board loses its power for a moment; not again before its uptime is longer than then."""
    if system.now - system.powered_at < 2.0 * TICK:
        return False
    watcher.board_loses_power(system)
    restarted = system.board.restarted(system.now)
    assert isinstance(restarted, type(system.board))
    system.wire.board = restarted
    system.powered_at = system.now
    return True


def pressure_too_high(system: System, watcher: Watcher) -> bool:
    """A pressure is too high for the driver, and not for the board, for a moment."""
    system.disturbance = too_high(system.rig)
    return True


def sensor_missing(system: System, watcher: Watcher) -> bool:
    """A pressure sensor is disconnected for a moment."""
    system.disturbance = MISSING
    return True


def start_controller(system: System, watcher: Watcher) -> bool:
    """The controller starts; it hears the last message that a running driver has published."""
    if system.controller is not None:
        return False
    system.controller = ControllerProcess(system.rig)
    if system.driver is not None:
        system.controller.hear(system.published)
    return True


def kill_controller(system: System, watcher: Watcher) -> bool:
    """The controller is killed."""
    if system.controller is None:
        return False
    system.controller = None
    return True


def send_reference(system: System, watcher: Watcher) -> bool:
    """The user sends a reference to the controller."""
    controller = system.controller
    if controller is None or controller.follows:
        return False
    if not controller.take_reference(system.now):
        return False
    watcher.reference_is_accepted()
    return True


def hold_message_up(system: System, watcher: Watcher) -> bool:
    """The valve command that is on its way is held up."""
    if system.command is None or system.held is not None:
        return False
    system.held, system.command = system.command, None
    return True


def deliver_held_message(system: System, watcher: Watcher) -> bool:
    """The valve command that was held up arrives."""
    if system.held is None:
        return False
    command, system.held = system.held, None
    system.deliver(command)
    system.publish()
    return True


ACTS: Final[Mapping[str, Act]] = {
    "time passes": nothing,
    "the driver starts (autostart)": start_driver,
    "the driver starts (autostart, activate_on_start)": start_driver_that_activates,
    "the driver starts (no autostart)": start_driver_without_autostart,
    "the driver is killed": kill_driver,
    "the driver is ended with Ctrl-C": end_driver,
    "the operator configures": configure,
    "the operator cleans up": clean_up,
    "the operator activates": activate,
    "the operator deactivates": deactivate,
    "the operator vents": vent,
    "the operator clears the faults": clear_faults,
    "the board is switched off and on": switch_board_off_and_on,
    "the driver measures a pressure that is too high": pressure_too_high,
    "a pressure sensor is lost for a moment": sensor_missing,
    "the controller starts": start_controller,
    "the controller is killed": kill_controller,
    "the user sends a reference": send_reference,
    "a valve command is held up": hold_message_up,
    "the valve command that was held up arrives": deliver_held_message,
}
"""Every act by its name in words."""

OF_TWO_PROCESSES: Final = frozenset(
    {start_controller, kill_controller, hold_message_up, deliver_held_message}
)
"""Acts that one process with driver and controller does not have."""

AT_ONCE: Final = frozenset({hold_message_up, deliver_held_message})
"""Acts after which no time passes; everything runs once after each of the others."""


def carry_out(act: Act, system: System, watcher: Watcher) -> bool:
    """One act and the step of time that follows it; whether the act was possible."""
    if not act(system, watcher):
        return False
    if act not in AT_ONCE:
        system.tick()
        if system.activated_itself:
            system.activated_itself = False
            watcher.driver_activates_itself(system)
    return True
