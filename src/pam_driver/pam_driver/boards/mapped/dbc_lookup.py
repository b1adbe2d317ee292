"""Finds messages and signals of a DBC file, and says in one line what is missing."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Final

from cantools.database.can import Message, Signal
from cantools.database.errors import Error

from pam_driver.boards.conversion import Source
from pam_driver.boards.dbc_file import read_dbc
from pam_driver.boards.dbc_flaws import DbcFlaw
from pam_driver.boards.mapped.device import Selected
from pam_driver.boards.mapped.signal_layout import FLOAT_BITS, SignalLayout
from pam_driver.boards.units import Linear
from pam_driver.can_bus.identifiers import EXTENDED, FD
from pam_model.rig.keys import Section

_MAX_DBC_BYTES: Final = 20_000_000
_MOST: Final = 8  # lines of a file that are reported one by one
_LARGEST: Final = 2.0**64  # of a raw value
_MAX_ID: Final = {False: 0x7FF, True: 0x1FFF_FFFF}


class DbcLookup:
    """The messages of one DBC file, as one device uses them.

    Parameters
    ----------
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
        content = read_dbc(path, _MAX_DBC_BYTES)
        self._messages = {message.name: message for message in content.database.messages}
        self._lines, self._flaws = content.lines, content.flaws
        self._told: set[DbcFlaw] = set()
        self._refused: set[str] = set()

    def place(self, message: str, signal: str = "") -> str:
        """The file and the line in which a message or signal is described."""
        line = self._lines.get((message, signal))
        return f"{self.path.name}, line {line}" if line else self.path.name

    def doubts(self) -> list[str]:
        """What is wrong in the file with what nothing in the rig file uses."""
        left = [f"{self.path.name}: {flaw}" for flaw in self._flaws if flaw not in self._told]
        more = len(left) - _MOST
        return left if more <= 0 else [*left[:_MOST], f"{self.path.name}: {more} more such lines"]

    def _lost(self, might_be: Callable[[DbcFlaw], bool]) -> str:
        """The end of a message about a name that is missing: a line that might have been it."""
        lost = [flaw for flaw in self._flaws if flaw.begins and might_be(flaw)]
        self._told.update(lost)
        return "".join(f"; {flaw}" for flaw in lost[:_MOST])

    def _has_flaw(self, message: object, signal: object, where: Section, key: str) -> bool:
        """Whether a message or signal has a flaw in the file; the flaw is then reported once."""
        found = [flaw for flaw in self._flaws if flaw.concerns(message, signal)]
        for flaw in found:
            if flaw not in self._told:
                where.add(key, f"{self._in_file(where, key)}: {flaw}")
            self._told.add(flaw)
        return bool(found)

    def message(self, name: object, where: Section, key: str) -> Message | None:
        """The message of this name; else None, and a problem is added to the key."""
        message = self._messages.get(name) if isinstance(name, str) else None
        shown_as = self._in_file(where, key)
        if message is None:
            if not self._has_flaw(name, "", where, key) and name not in self._refused:
                where.add(
                    key,
                    f"{shown_as}: the DBC file has no message {name}{_hint(name, self._messages)}"
                    f"{self._lost(lambda flaw: not flaw.signal)}",
                )
            self._refused.add(str(name))
            return None
        if name in self._refused:
            return None
        if self._has_flaw(message.name, "", where, key):
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

    def whole(self, message: Message, where: Section, key: str) -> bool:
        """Whether all signals of a message can be used, as one that is sent needs.

        If not, a problem is added to the key.
        """
        names = {"", *(one.name for one in message.signals)}
        told = [
            self._has_flaw(message.name, flaw.signal, where, key)
            for flaw in self._flaws
            if message.name in flaw.messages and (flaw.begins or flaw.signal in names)
        ]
        numbers = [self._is_unusable(message, one, where, key) for one in message.signals]
        return not (any(told) or any(numbers)) and self.fits(message, message.signals, where, key)

    def fits(self, message: Message, signals: Sequence[Signal], where: Section, key: str) -> bool:
        """Whether signals fit into their message and do not overlap; else a problem is added."""
        try:
            Message(
                frame_id=message.frame_id,
                name=message.name,
                length=message.length,
                signals=list(signals),
                is_extended_frame=message.is_extended_frame,
                strict=True,
            )
        except Error as error:
            text = " ".join(str(error).split())
            where.add(key, f"{self._in_file(where, key)}: {text} ({self.place(message.name)})")
            self._refused.add(message.name)
            return False
        return True

    def used_fit(self, message: Message, where: Section) -> bool:
        """Whether the signals of an answer that the rig file uses fit and do not overlap."""
        used = {name for owner, name in self.used if owner == message.name}
        signals = [signal for signal in message.signals if signal.name in used]
        used |= {str(signal.multiplexer_signal) for signal in signals if signal.multiplexer_ids}
        signals = [signal for signal in message.signals if signal.name in used]
        return self.fits(message, signals, where, "dbc")

    def _is_unusable(self, message: Message, signal: Signal, where: Section, key: str) -> bool:
        unusable = _unusable(signal)
        if unusable:
            place = f"{self.place(message.name, signal.name)}: {message.name}.{signal.name}"
            given = self._in_file(where, key).removesuffix(self.path.name)
            where.add(key, f"{given}{place} has {unusable}")
        return bool(unusable)

    def signal(self, message: Message, name: object, where: Section, key: str) -> Signal | None:
        """The signal of a message; else None, and a problem is added to the key."""
        signals = {signal.name: signal for signal in message.signals}
        signal = signals.get(name) if isinstance(name, str) else None
        selector = signals.get(signal.multiplexer_signal or "") if signal is not None else None
        used = [one for one in (signal, selector) if one is not None]
        flawed = self._has_flaw(message.name, name, where, key)
        if selector is not None:
            flawed |= self._has_flaw(message.name, selector.name, where, key)
        if flawed:
            return None
        if signal is None:
            lost = self._lost(lambda flaw: message.name in flaw.messages)
            problem = f"message {message.name} has no signal {name}{_hint(name, signals)}{lost}"
        elif signal.multiplexer_ids is not None and len(signal.multiplexer_ids) != 1:
            problem = (
                f"{message.name}.{name} appears with several values of its selector; one is "
                "expected"
            )
        elif selector is not None and selector.multiplexer_ids is not None:
            problem = (
                f"{message.name}.{name} is multiplexed in more than one level, which is not "
                "supported"
            )
        elif signal.is_multiplexer:
            problem = (
                f"{message.name}.{name} selects the other signals of the message and cannot be "
                "mapped"
            )
        else:
            unusable = [self._is_unusable(message, one, where, key) for one in used]
            return None if any(unusable) else signal
        where.add(key, f"{self._in_file(where, key)}: {problem}")
        return None

    def refuse_numbers(
        self, where: Section, message: Message, signal: Signal, gain: float, bias: float
    ) -> None:
        """Add the problem that a conversion between counts and SI is not finite."""
        place = f"{self.place(message.name, signal.name)}: {message.name}.{signal.name}"
        where.add("signal", f" = {place} gives the conversion {gain:g} x + {bias:g}")

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
    scale, offset = _float(signal.conversion.scale), _float(signal.conversion.offset)
    if not Linear(scale, offset).is_usable:
        return f"the factor {scale:g} and the offset {offset:g}"
    ends = [_float(end) for end in (signal.minimum, signal.maximum) if end is not None]
    if not all(math.isfinite((end - offset) / scale) for end in ends):
        return f"the range {' to '.join(f'{end:g}' for end in ends)}"
    if signal.conversion.is_float:
        if signal.length not in FLOAT_BITS:
            return f"{signal.length} bits, which no float has"
    elif not all(math.isfinite(raw * scale + offset) for raw in raw_limits(signal)):
        return f"the factor {scale:g} and the offset {offset:g}"
    return ""


def _float(number: float) -> float:
    """A number of a DBC file, which may have more digits than a float can hold."""
    try:
        return float(number)
    except OverflowError:
        return math.inf


def raw_limits(signal: Signal) -> tuple[int, int]:
    """The smallest and the largest raw value that fits into the bits of an integer signal."""
    if signal.is_signed:
        return -(1 << (signal.length - 1)), (1 << (signal.length - 1)) - 1
    return 0, (1 << signal.length) - 1


def _hint(name: object, known: Collection[str]) -> str:
    close = get_close_matches(str(name), known, 1)
    return (
        f"; did you mean {close[0]}?"
        if close
        else f"; it has {', '.join(list(known)[:8]) or 'none'}"
    )
