"""Reads what is sent to a mapped device: set points, enables, constants, counters, requests."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from cantools.database.can import Message, Signal

from pam_driver.boards.conversion import fits, read_conversion
from pam_driver.boards.mapped.dbc_lookup import DbcLookup, raw_value
from pam_driver.boards.mapped.device import CommandFrame, FrameChecksum, MappedOutput, RequestFrame
from pam_driver.boards.mapped.frame_checks import read_checksum, read_counter
from pam_driver.boards.mapped.signal_layout import SignalLayout, frame_length
from pam_driver.boards.protocol import MuscleWire, WiredBoard
from pam_driver.boards.units import PRESSURE, SHARE, Linear
from pam_model.rig.keys import Key, Section

_PERIOD: Final = Key("s", 0.001, 0.05)
Bits = tuple[int, int]
_Frame = tuple[str, int | None]
"""A message, and the value of its selector; None if it is not multiplexed."""


class Commands(NamedTuple):
    """What is sent to a device; see `Device`."""

    cyclic: tuple[CommandFrame, ...]
    vent: tuple[RequestFrame, ...]
    clear_faults: tuple[RequestFrame, ...]


@dataclass
class _Message:
    """The keys of one message under `commands`."""

    message: Message
    where: Section
    whole: bool
    counter: SignalLayout | None = None
    checksum: FrameChecksum | None = None
    period: float | None = None
    fixed: dict[str, int] = field(default_factory=dict)


class CommandReader:
    """Reads the commands of one device; problems are added to the section.

    Attributes
    ----------
    messages : dict of str to object
        The messages that are sent to the device.
    """

    def __init__(self, wired: WiredBoard, lookup: DbcLookup, top: Section) -> None:
        self.messages: dict[str, _Message] = {}
        self._wired = wired
        self._lookup = lookup
        self._top = top
        self._outputs: dict[_Frame, list[MappedOutput]] = {}
        self._enables: dict[_Frame, list[tuple[SignalLayout, int, int]]] = {}
        self._requests: dict[str, list[tuple[_Frame, dict[str, int]]]] = {}

    def read(self) -> None:
        """Read all keys that concern commands."""
        self._read_setpoints()
        self._read_enables()
        self._read_messages()
        for name in ("vent", "clear_faults"):
            self._requests[name] = self._read_requests(name)

    def commands(self) -> Commands:
        """The frames; call it after everything else was read, since it checks what is left."""
        if not all(entry.whole for entry in self.messages.values()):
            return Commands((), (), ())
        cyclic = dict.fromkeys([*self._outputs, *self._enables])
        for name, entry in self.messages.items():
            if entry.period is not None and not any(name == frame[0] for frame in cyclic):
                cyclic[(name, None)] = None
        frames = {frame: self._frame(frame) for frame in cyclic}
        requests = {}
        for kind, wanted in self._requests.items():
            requests[kind] = tuple(
                self._request(frames.get(frame) or self._frame(frame, values), values)
                for frame, values in wanted
            )
        return Commands(tuple(frames.values()), requests["vent"], requests["clear_faults"])

    def _place(self, where: Section) -> tuple[_Frame, Message, Signal] | None:
        found = self._lookup.named(where)
        if found is None or not self._lookup.claim(*found, where, "signal"):
            return None
        message, signal = found
        if not self._message(message).whole:
            return None
        return (message.name, _selector(signal)), message, signal

    def _message(self, message: Message) -> _Message:
        entry = self.messages.get(message.name)
        if entry is None:
            section = Section({}, f"{self._top.path}.commands.{message.name}", self._top.problems)
            whole = self._lookup.whole(message, self._top, "dbc")
            entry = self.messages[message.name] = _Message(message, section, whole)
        return entry

    def _read_setpoints(self) -> None:
        section = self._top.section("setpoints")
        wires = {str(wire.channel): wire for wire in self._wired.valves}
        given = {str(key): key for key in section.tree}
        for channel, wire in wires.items():
            if channel not in given:
                section.add(channel, f": missing; {wire.muscle.name} is wired to this channel")
        for channel, key in given.items():
            where = section.section(key)
            if channel not in wires:
                section.add(channel, ": no muscle of the rig is wired to this channel")
                continue
            placed = self._place(where)
            if placed is None:
                continue
            frame, message, signal = placed
            output = self._output(where, wires[channel], message, signal)
            if output is not None:
                where.finish()
                self._outputs.setdefault(frame, []).append(output)

    def _output(
        self, where: Section, wire: MuscleWire, message: Message, signal: Signal
    ) -> MappedOutput | None:
        valve = wire.muscle.valve
        regulator = valve.kind == "pressure_regulator"
        quantities = (PRESSURE, SHARE) if regulator else (SHARE,)
        converted = read_conversion(
            where, self._lookup.source(message, signal), quantities, self._wired.ambient_pressure
        )
        if converted is None:
            return None
        linear, quantity = converted
        full = (valve.full_scale or 0.0) if quantity == PRESSURE else 1.0
        # fraction -> device's value: (full * fraction - offset) / factor
        device = Linear(full / linear.factor, -linear.offset / linear.factor)
        layout = SignalLayout(message, signal)
        vented = 0.0 if regulator else -1.0
        unit = where.tree.get("unit") or signal.unit
        for name, fraction in (("vented", vented), ("at full scale", 1.0)):
            value = device.si(fraction)
            if not fits(value, layout.low, layout.high):
                of = f" (valve.full_scale = {full:g} Pa gauge)" if quantity == PRESSURE else ""
                where.add(
                    "signal",
                    f" = {message.name}.{signal.name}: takes {layout.low:g} to {layout.high:g} "
                    f"{unit}, but the set point of {wire.muscle.name} {name}{of} is {value:g} "
                    f"{unit}",
                )
                return None
        gain, bias = device.factor / layout.scale, (device.offset - layout.offset) / layout.scale
        if not Linear(gain, bias).is_usable:
            self._lookup.refuse_numbers(where, message, signal, gain, bias)
            return None
        return MappedOutput(wire.place, layout, gain, bias, vented)

    def _read_enables(self) -> None:
        section = self._top.section("enables")
        for key in section.tree:
            where = section.section(key)
            placed = self._place(where)
            given = [where.get("enabled"), where.get("disabled")]
            where.finish()
            if placed is None:
                continue
            frame, message, signal = placed
            raws = [
                raw_value(signal, default if value is None else value)
                for value, default in zip(given, (1, 0), strict=True)
            ]
            for name, raw in zip(("enabled", "disabled"), raws, strict=True):
                if isinstance(raw, str):
                    where.add(name, f": {raw}")
            if raws[0] == raws[1]:
                where.add("enabled", f" = {given[0]}: must differ from disabled")
            on, off = raws
            if isinstance(on, int) and isinstance(off, int):
                layout = SignalLayout(message, signal)
                self._enables.setdefault(frame, []).append((layout, on, off))

    def _read_messages(self) -> None:
        section = self._top.section("commands")
        for name in section.tree:
            where = section.section(name)
            message = self._lookup.message(name, section, str(name))
            if message is None:
                continue
            entry = self._message(message)
            if not entry.whole:
                continue
            entry.where = where
            entry.counter = read_counter(where, self._lookup, message)
            entry.checksum = read_checksum(where, self._lookup, message)
            entry.period = where.number("period", _PERIOD, optional=True)
            entry.fixed = self._values(where.section("fixed"), message, claim=True)
            where.finish()

    def _values(self, where: Section, message: Message, *, claim: bool) -> dict[str, int]:
        """Constant raw values by signal."""
        found = {}
        for name in where.tree:
            value = where.get(name)
            signal = self._lookup.signal(message, name, where, str(name))
            if signal is None:
                continue
            if claim and not self._lookup.claim(message, signal, where, str(name)):
                continue
            raw = raw_value(signal, value)
            if isinstance(raw, str):
                where.add(str(name), f" = {value}: {raw}")
                continue
            found[str(name)] = raw
        return found

    def _read_requests(self, kind: str) -> list[tuple[_Frame, dict[str, int]]]:
        """The messages of `vent` or `clear_faults`, each with its constant values."""
        section = self._top.section(kind)
        found = []
        for name in section.tree:
            where = section.section(name)
            message = self._lookup.message(name, section, str(name))
            if message is None:
                continue
            if not self._message(message).whole:
                continue
            values = self._values(where, message, claim=False)
            selectors = {_selector(message.get_signal_by_name(signal)) for signal in values} - {
                None
            }
            if len(selectors) > 1:
                section.add(str(name), ": the signals are in frames with different selectors")
                continue
            selector = selectors.pop() if selectors else None
            found.append(((message.name, selector), values))
        return found

    def _frame(self, key: _Frame, given: Mapping[str, int] | None = None) -> CommandFrame:
        """A frame; every signal in it must have a value from somewhere."""
        name, selector = key
        entry = self.messages[name]
        message = entry.message
        outputs, enables = self._outputs.get(key, []), self._enables.get(key, [])
        mapped = {output.layout.name for output in outputs} | {e[0].name for e in enables}
        mapped |= {layout.name for layout in (entry.counter,) if layout is not None}
        if entry.checksum is not None:
            mapped.add(entry.checksum.layout.name)
        base = (0, 0)
        for signal in message.signals:
            layout = SignalLayout(message, signal)
            if signal.is_multiplexer and selector is not None:
                base = _with(base, layout, selector)
            elif signal.name in mapped or _selector(signal) not in {None, selector}:
                continue
            elif signal.name in entry.fixed:
                base = _with(base, layout, entry.fixed[signal.name])
            elif signal.raw_initial is not None:
                base = _with(base, layout, int(signal.raw_initial))
            elif (name, signal.name) not in self._lookup.used and signal.name not in (given or {}):
                entry.where.section("fixed").add(
                    signal.name,
                    f": missing; {self._lookup.path.name} has no start value for "
                    f"{name}.{signal.name}, so the rig file must say what is sent",
                )
        enabled = disabled = (0, 0)
        for layout, on, off in enables:
            enabled, disabled = _with(enabled, layout, on), _with(disabled, layout, off)
        return CommandFrame(
            name,
            self._lookup.frame_id(message),
            frame_length(message),
            base,
            enabled,
            disabled,
            tuple(outputs),
            entry.counter,
            entry.checksum,
            entry.period or 0.0,
        )

    def _request(self, frame: CommandFrame, values: Mapping[str, int]) -> RequestFrame:
        message = self.messages[frame.name].message
        base = tuple(a | b for a, b in zip(frame.base, frame.disabled, strict=True))
        bits = (base[0], base[1])
        for name, raw in values.items():
            bits = _with(bits, SignalLayout(message, message.get_signal_by_name(name)), raw)
        return RequestFrame(frame, bits)


def _selector(signal: Signal) -> int | None:
    return signal.multiplexer_ids[0] if signal.multiplexer_ids else None


def _with(bits: Bits, layout: SignalLayout, raw: int) -> Bits:
    """The bits with one signal set to a raw value."""
    little, big = bits
    place = layout.mask << layout.shift
    if layout.big:
        return little, (big & ~place) | layout.bits_of_raw(raw)
    return (little & ~place) | layout.bits_of_raw(raw), big
