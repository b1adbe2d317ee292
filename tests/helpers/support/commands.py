"""Valve commands from a sender that does not care about the driver's state."""

from __future__ import annotations

from pam_driver.driver import Driver
from pam_driver.safety.valve_command_intake import CommandRefusedError, NamedCommand


def offer(driver: Driver, command: NamedCommand, now: float) -> bool:
    """Send a command; whether the driver took it. Only "not active" is accepted as a refusal."""
    try:
        driver.set_commands(command, now)
    except CommandRefusedError as error:
        if error.kind != "not_active":
            raise
        return False
    return True
