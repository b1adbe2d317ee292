"""What a board does not do for safety by itself, in words, and what makes up for it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pam_driver.boards.protocol import Board, ExplainsPromises

WITHOUT: Final[Mapping[str, tuple[str, str]]] = {
    "watchdog": (
        "no watchdog: its valves keep the last set point when the host or the cable fails",
        "a dump valve in the air supply that a watchdog relay of the host or the emergency stop "
        "opens",
    ),
    "latches": (
        "no latch: after a time-out it follows the next command at once",
        "the driver latches its own faults; commands of an old driver process must not remain",
    ),
    "keeps_host_fault": (
        "no memory for a fault of the host: a restart of the driver's process forgets it",
        "the driver's process keeps it; leave activate_on_start false",
    ),
    "needs_arming": (
        "no arming: after power-up it follows the first command that it receives",
        "the driver sends set points that vent until it is activated",
    ),
    "tells_state": (
        "no state: whether its valves follow is not known",
        "the pressures are compared with the commands (pressure_implausible)",
    ),
    "tells_faults": (
        "no fault report: a defect shows only in the measurements",
        "range, noise and physics of the measurements are checked",
    ),
    "echoes_commands": (
        "no echo: a device that receives nothing is not noticed by itself",
        "the pressures are compared with the commands (pressure_implausible)",
    ),
    "counts_samples": (
        "no counter in the measurements: a frozen device that repeats its last value is not "
        "noticed at once",
        "a reading that does not change along a motion is found by physics, within seconds",
    ),
    "has_heartbeat": (
        "no uptime: a restart is not noticed",
        "a restart that interrupts the measurements for sensor_timeout vents",
    ),
    "has_checksum": (
        "no checksum in the commands",
        "the checksum of CAN itself, which does not cover faults in host and device",
    ),
    "measures_supply": (
        "no supply pressure: a supply that sags is not noticed by itself",
        "the pressures are compared with the commands (pressure_implausible)",
    ),
}
"""By the name of a promise: what its absence means, and what makes up for it."""


_OF_VALVES: Final = frozenset(WITHOUT) - {"counts_samples", "tells_faults", "has_heartbeat"}
_OF_MEASUREMENTS: Final = frozenset({"counts_samples", "measures_supply"})


def weaker_promises(board: Board) -> list[str]:
    """One line for each promise that a board does not give; empty if it gives all of them.

    A board that is sent nothing needs no promise about valves, and one that sends nothing none
    about measurements.
    """
    words = {**WITHOUT, **(board.without if isinstance(board, ExplainsPromises) else {})}
    silent, mute = not board.identifiers.answers, not board.identifiers.commands
    lines = [
        f"{meaning}; instead: {instead}"
        for name, (meaning, instead) in words.items()
        if not getattr(board.promises, name)
        and not (mute and name in _OF_VALVES)
        and not (silent and name in _OF_MEASUREMENTS)
    ]
    if silent:
        lines.append(
            "it sends nothing: an unplugged device is not noticed by itself; instead: the "
            "pressures are compared with the commands (pressure_implausible)"
        )
    return lines
