"""Finds messages and signals of a DBC file, and says in one line what is missing."""

from __future__ import annotations

import math
from collections.abc import Collection
from difflib import get_close_matches
from pathlib import Path
from typing import Final

from cantools.database.can import Message, Signal
from cantools.database.errors import Error

from pam_driver.boards.conversion import Source
from pam_driver.boards.dbc_file import load_dbc
from pam_driver.boards.mapped.device import Selected
from pam_driver.boards.mapped.signal_layout import SignalLayout
from pam_driver.can_bus.identifiers import EXTENDED, FD
from pam_model.rig.keys import Section

_MAX_DBC_BYTES: Final = 20_000_000
_LARGEST: Final = 2.0**64  # of a raw value
_MAX_ID: Final = {False: 0x7FF, True: 0x1FFF_FFFF}


class DbcLookup:
    """The messages of one DBC file, as one device uses them.

    Parameters
    ----------
    path : Path
        The DBC file.
    offset : int
        Added to every identifier, for several devices with one DBC file.

    Attributes
    ----------
    used : dict of (str, str) to str
        By message and signal, the key of the rig file that maps it.

    Raises
    ------
    DbcError
        If the file cannot be used at all.
    """

    def __init__(self, path: Path, offset: int) -> None:
        self.path = path
        self.used: dict[tuple[str, str], str] = {}
        self._offset = offset
        database = load_dbc(path, _MAX_DBC_BYTES, strict=False)
        self._messages = {message.name: message for message in database.messages}
        self._refused: set[str] = set()

    def message(self, name: object, where: Section, key: str) -> Message | None:
        """The message of this name; else None, and a problem is added to the key."""
        message = self._messages.get(name) if isinstance(name, str) else None
        shown_as = self._in_file(where, key)
        if message is None:
            if name not in self._refused:
                where.add(
                    key,
                    f"{shown_as}: the DBC file has no message {name}{_hint(name, self._messages)}",
                )
            self._refused.add(str(name))
            return None
        if name in self._refused:
            return None
        try:
            message.refresh(strict=True)
        except Error as error:
            where.add(key, f"{shown_as}: {' '.join(str(error).split())}")
            self._refused.add(message.name)
            return None
        for signal in message.signals:
            unusable = _unusable(signal)
            if unusable:
                where.add(key, f"{shown_as}: {message.name}.{signal.name} has {unusable}")
                self._refused.add(message.name)
                return None
        number = message.frame_id + self._offset
        if not 0 <= number <= _MAX_ID[message.is_extended_frame]:
            where.add(
                key,
                f"{shown_as}: identifier 0x{message.frame_id:X} of {message.name} plus "
                f"identifier_offset is 0x{number:X}, expected at most "
                f"0x{_MAX_ID[message.is_extended_frame]:X}",
            )
            self._refused.add(message.name)
            return None
        return message

    def frame_id(self, message: Message) -> int:
        """The identifier of a message on the bus, with the flags of `identifiers`."""
        number = message.frame_id + self._offset
        flags = EXTENDED if message.is_extended_frame else 0
        return number | flags | (FD if message.is_fd else 0)

    def named(self, where: Section) -> tuple[Message, Signal] | None:
        """The message and signal under the key `signal`; else None, and a problem is added."""
        text = where.get("signal")
        if text is None:
            where.add("signal", ": missing; MESSAGE.SIGNAL of the DBC file is needed")
            return None
        if not isinstance(text, str) or text.count(".") != 1:
            where.add("signal", f" = {text!r}: must be MESSAGE.SIGNAL of the DBC file")
            return None
        message_name, name = text.split(".")
        message = self.message(message_name, where, "signal")
        if message is None:
            return None
        signal = self.signal(message, name, where, "signal")
        return None if signal is None else (message, signal)

    def signal(self, message: Message, name: object, where: Section, key: str) -> Signal | None:
        """The signal of a message; else None, and a problem is added to the key."""
        signals = {signal.name: signal for signal in message.signals}
        signal = signals.get(name) if isinstance(name, str) else None
        shown_as = self._in_file(where, key)
        if signal is None:
            where.add(
                key,
                f"{shown_as}: message {message.name} has no signal {name}{_hint(name, signals)}",
            )
            return None
        if signal.multiplexer_ids is not None and len(signal.multiplexer_ids) != 1:
            where.add(
                key,
                f"{shown_as}: {message.name}.{name} appears with several values of its selector; "
                "one is expected",
            )
            return None
        selector = signals.get(signal.multiplexer_signal or "")
        if selector is not None and selector.multiplexer_ids is not None:
            where.add(
                key,
                f"{shown_as}: {message.name}.{name} is multiplexed in more than one level, which "
                "is not supported",
            )
            return None
        if signal.is_multiplexer:
            where.add(
                key,
                f"{shown_as}: {message.name}.{name} selects the other signals of the message and "
                "cannot be mapped",
            )
            return None
        return signal

    def claim(self, message: Message, signal: Signal, where: Section, key: str) -> bool:
        """Note that a key maps a signal; False, and a problem is added, if another key does."""
        mine = where.key(key)
        other = self.used.setdefault((message.name, signal.name), mine)
        if other != mine:
            where.add(key, f" = {message.name}.{signal.name}: {other} maps this signal as well")
        return other == mine

    @staticmethod
    def source(message: Message, signal: Signal) -> Source:
        """What the DBC file says about a signal."""
        return Source(f"{message.name}.{signal.name}", signal.unit or "", "DBC file")

    def selected(self, message: Message, signal: Signal) -> Selected:
        """The layout of a signal, with the selector value at which it is present."""
        layout = SignalLayout(message, signal)
        if not signal.multiplexer_ids:
            return Selected(layout)
        selector = message.get_signal_by_name(str(signal.multiplexer_signal))
        return Selected(layout, SignalLayout(message, selector), signal.multiplexer_ids[0])

    def _in_file(self, where: Section, key: str) -> str:
        value = where.tree.get(key)
        given = "" if value is None or isinstance(value, dict) else f" = {value}"
        return f"{given}: {self.path.name}"


def raw_value(signal: Signal, value: object) -> int | str:
    """The raw value of a label or a physical value; or what is wrong, as the end of a message."""
    labels = {str(name): int(raw) for raw, name in (signal.choices or {}).items()}
    if isinstance(value, str):
        if value in labels:
            return labels[value]
        return f"{signal.name} has no value called {value}{_hint(value, labels)}"
    if isinstance(value, bool):
        value = int(value)
    if not isinstance(value, int | float):
        return f"must be a number, or a label of {signal.name}"
    low, high = raw_limits(signal)
    if not abs(value) < _LARGEST:  # also "not a number"
        return f"must be a finite number, or a label of {signal.name}"
    raw = round((float(value) - signal.conversion.offset) / signal.conversion.scale)
    if not low <= raw <= high:
        return f"{signal.name} takes raw values from {low} to {high}"
    return int(raw)


def _unusable(signal: Signal) -> str:
    """What makes the numbers of a signal unusable, as the end of a message; empty if nothing."""
    scale, offset = float(signal.conversion.scale), float(signal.conversion.offset)
    if scale == 0.0 or not math.isfinite(scale) or not math.isfinite(offset):
        return f"the factor {scale:g} and the offset {offset:g}"
    ends = [end for end in (signal.minimum, signal.maximum) if end is not None]
    if not all(math.isfinite(end) for end in ends):
        return f"the range {' to '.join(f'{end:g}' for end in ends)}"
    return ""


def raw_limits(signal: Signal) -> tuple[int, int]:
    """The smallest and the largest raw value that fits into the bits of an integer signal."""
    if signal.is_signed:
        return -(1 << (signal.length - 1)), (1 << (signal.length - 1)) - 1
    return 0, (1 << signal.length) - 1


def _hint(name: object, known: Collection[str]) -> str:
    close = get_close_matches(str(name), known, 1)
    return f"; did you mean {close[0]}?" if close else f"; it has {', '.join(list(known)[:8])}"
