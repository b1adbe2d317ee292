"""Reads the keys `counter` and `checksum` of a message."""

from __future__ import annotations

from collections.abc import Sequence

from cantools.database.can import Message

from pam_driver.boards.mapped.checksum import ALGORITHMS
from pam_driver.boards.mapped.dbc_lookup import DbcLookup
from pam_driver.boards.mapped.device import FrameChecksum
from pam_driver.boards.mapped.signal_layout import SignalLayout, frame_length
from pam_model.rig.keys import Section


def read_counter(where: Section, lookup: DbcLookup, message: Message) -> SignalLayout | None:
    """The counter of a message, by the key `counter`; None if there is none."""
    name = where.get("counter")
    if name is None:
        return None
    signal = lookup.signal(message, name, where, "counter")
    if signal is None or not lookup.claim(message, signal, where, "counter"):
        return None
    layout = SignalLayout(message, signal)
    if layout.float_format or layout.sign or layout.values < 4 or signal.multiplexer_ids:
        where.add(
            "counter",
            f" = {name}: must be an unsigned whole number with at least 4 values in every frame "
            f"of {message.name}",
        )
        return None
    return layout


def read_checksum(where: Section, lookup: DbcLookup, message: Message) -> FrameChecksum | None:
    """The checksum of a message, by the key `checksum`; None if there is none."""
    if "checksum" not in where.tree:
        return None
    section = where.section("checksum")
    name, algorithm_name, prefix = (section.get(key) for key in ("signal", "algorithm", "prefix"))
    section.finish()
    if name is None:
        section.add("signal", f": missing; a signal of {message.name} is needed")
        return None
    signal = lookup.signal(message, name, section, "signal")
    algorithm = ALGORITHMS.get(str(algorithm_name))
    if algorithm is None:
        given = ": missing" if algorithm_name is None else f" = {algorithm_name}: unknown checksum"
        section.add("algorithm", f"{given}; known: {', '.join(ALGORITHMS)}")
    constant = _bytes(prefix)
    if constant is None:
        section.add("prefix", f" = {prefix!r}: must be a list of bytes from 0 to 255")
    if signal is None or algorithm is None or constant is None:
        return None
    if not lookup.claim(message, signal, section, "signal"):
        return None
    layout = SignalLayout(message, signal)
    length = frame_length(message)
    if layout.length != 8 * algorithm.length or layout.shift % 8 or signal.multiplexer_ids:
        section.add(
            "signal",
            f" = {message.name}.{signal.name}: {algorithm_name} needs {algorithm.length} whole "
            f"byte{'s' if algorithm.length > 1 else ''} of the frame, this signal has "
            f"{layout.length} bits",
        )
        return None
    first = length - (layout.shift + layout.length) // 8 if layout.big else layout.shift // 8
    return FrameChecksum(layout, algorithm, constant, first, first + algorithm.length)


def _bytes(values: object) -> bytes | None:
    if values is None:
        return b""
    if not isinstance(values, Sequence) or isinstance(values, str):
        return None
    for value in values:
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= 255:
            return None
    return bytes(values)
