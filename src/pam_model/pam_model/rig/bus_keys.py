"""The keys of buses and boards that do not depend on the kind of board."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from pam_model.rig.keys import NAME, Section, keys_of
from pam_model.rig.wiring import Bus


def read_buses(section: Section) -> dict[str, Bus]:
    """The named buses."""
    found: dict[str, Bus] = {}
    for name in section.tree:
        if not isinstance(name, str) or not NAME.fullmatch(name):
            section.add(str(name), ": is not a name (letters, digits and _, a letter first)")
            continue
        where = section.section(name)
        values: dict[str, Any] = {}
        for key, expected in (
            ("interface", "a text"),
            ("channel", "a text"),
            ("options", "a text"),
            ("fd", "true or false"),
            ("canopen", "true or false"),
        ):
            value = where.get(key)
            kind = bool if expected == "true or false" else str
            if value is not None and not isinstance(value, kind):
                where.add(key, f" = {value!r}: must be {expected}")
            elif value is not None:
                values[key] = value
        for key, bounds in keys_of(Bus).items():
            number = where.number(key, bounds)
            if number is not None:
                values[key] = int(number)
        where.finish()
        found[name] = Bus(**values)
    return found


def check_buses(
    buses: Mapping[str, Bus], boards: Mapping[str, Mapping[str, Any]], section: Section
) -> None:
    """Check that every board is on a bus of the file, and that no channel is opened twice."""
    opened: dict[tuple[str, str, int], str] = {}
    for name, bus in buses.items():
        port = bus.port if bus.interface == "udp_multicast" else 0
        other = opened.setdefault((bus.interface, bus.channel, port), name)
        if other != name:
            section.problems.add(
                f"buses.{name}.channel", f" = {bus.channel}: {other} is the same channel"
            )
    for name, board in boards.items():
        bus_name = board.get("bus")
        if buses and bus_name is not None and bus_name not in buses:
            close = get_close_matches(str(bus_name), buses, 1)
            hint = f"did you mean {close[0]}?" if close else f"there are {', '.join(buses)}"
            section.add(f"{name}.bus", f" = {bus_name}: buses has no section of this name; {hint}")


DEVICE_FILES = ("dbc", "eds")
"""The keys of a board's section that name a file of the device's maker."""


def beside_rig_file(section: dict[str, Any], folders: Sequence[Path]) -> dict[str, Any]:
    """A board's section with its relative `DEVICE_FILES` found in one of the folders."""
    result = dict(section)
    for key in DEVICE_FILES:
        name = section.get(key)
        if not isinstance(name, str) or not name or Path(name).is_absolute():
            continue
        found = [folder / name for folder in folders if (folder / name).is_file()]
        if found:
            result[key] = str(found[0].resolve())
    return result
