"""The simulated twin of a mapped device: it does what the rig file states about the device.

Payloads are encoded and decoded by cantools from the DBC file, not by the driver's own tables, so
that a mistake in those tables shows in every test that uses the twin.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from cantools.database.can import Message
from cantools.database.errors import Error

from pam_driver.boards.dbc_file import read_dbc
from pam_driver.boards.mapped.device import (
    AnswerFrame,
    CommandFrame,
    MappedDevice,
    MappedInput,
    Selected,
)
from pam_driver.boards.mapped.kind import read_device
from pam_driver.boards.protocol import Channel, Frame, KindOptions, WiredBoard
from pam_sim.boards.protocol import BoardSettings, BoardValve, SimulatedBoard, readings_of

_MAX_DBC_BYTES = 20_000_000
_STATUS_PERIOD = 0.02  # s, of a message for which neither DBC nor rig file states a period


@dataclass
class _Sent:
    """A frame that the device sends regularly: one message, with one value of its selector."""

    frame: AnswerFrame
    message: Message
    selector: int | None
    period: float
    turns: int = 0
    count: int = 0


class SimulatedMappedBoard:
    """One mapped device.

    Parameters
    ----------
    wired : WiredBoard
        Its muscles and joints.
    device : MappedDevice
        The tables that the driver uses as well.
    messages : mapping of str to Message
        The messages of the DBC file.
    settings : BoardSettings
        Rates, boot time and watchdog.
    now : float
        Time of power-up [s].
    """

    def __init__(
        self,
        wired: WiredBoard,
        device: MappedDevice,
        messages: Mapping[str, Message],
        settings: BoardSettings,
        now: float,
    ) -> None:
        self.valves = tuple(BoardValve.of(wire.muscle) for wire in wired.valves)
        self._limits = {
            wire.place: valve.max_pressure
            for wire, valve in zip(wired.valves, self.valves, strict=True)
        }
        self.rejected_frames = 0
        self._wired, self._device, self._settings = wired, device, settings
        self._messages = messages
        self._promises = device.promises
        self._watchdog = (
            settings.watchdog_period or device.promises.watchdog
            if device.promises.watchdog is not None
            else None
        )
        self._commands: dict[int, list[CommandFrame]] = {}
        for frame in [*device.commands, *(one.frame for one in device.vent + device.clear_faults)]:
            self._commands.setdefault(frame.frame_id, []).append(frame)
        self._has_enable = any(frame.enabled != frame.disabled for frame in device.commands)
        self._fractions = {wire.place: 0.0 for wire in wired.valves}
        self._set = False  # whether any set point has arrived
        self._running = not self._has_enable
        self._faults: set[str] = set()
        self._armed = not device.promises.needs_arming
        self._started = self._accepted_at = now
        self._last_count: dict[str, int] = {}
        self._wanted: dict[tuple[int, int, int], dict[str, Any]] = {}
        self._echo = 0
        self._counter_step = 1
        self._other_dbc = ""
        self._sent = self._regular_frames()
        self._state_sent: object = None
        frames = device.answers
        self._state_raws = next((_state_raws(device, f.state) for f in frames if f.state), (0, 0))

    @property
    def active(self) -> bool:
        """Whether its valves follow set points."""
        return self._running and not self._faults

    @property
    def fault_names(self) -> tuple[str, ...]:
        """The names of its latched faults."""
        return tuple(sorted(self._faults))

    @property
    def valve_commands(self) -> tuple[float, ...]:
        """The valves' commands: spool -1..1 or gauge pressure [Pa]; vented unless active."""
        follows = self.active and self._set
        return tuple(
            valve.command(self._fractions[wire.place]) if follows else valve.vented
            for valve, wire in zip(self.valves, self._wired.valves, strict=True)
        )

    def restarted(self, now: float) -> SimulatedBoard:
        """The device after a power-up at `now` [s]."""
        return SimulatedMappedBoard(self._wired, self._device, self._messages, self._settings, now)

    def misbehave(self, fault: str, value: float) -> None:
        """Behave as a defective device, or one with another DBC file, until "mended".

        Counters of measurements jump or freeze ("counter_jump", "counter_frozen"); it reports a
        "fault" of its own; its measurements have the "other_byte_order" or an "other_checksum".
        """
        if fault == "counter_jump":
            for sent in self._sent:
                sent.count += round(value)
        elif fault == "counter_frozen":
            self._counter_step = 0
        elif fault == "fault":
            self._faults.add("SENSOR")
            self._stop()
        elif fault in {"other_byte_order", "other_checksum"}:
            self._other_dbc = fault
        elif fault == "mended":
            self._counter_step, self._other_dbc = 1, ""

    def on_frame(self, frame_id: int, data: bytes, now: float) -> None:
        """Receive a frame from the bus; a frame for another device is ignored."""
        known = self._commands.get(frame_id)
        if known is None:
            return
        first = known[0]
        values = self._decoded(first, data)
        if values is None:
            self.rejected_frames += 1
            return
        if first.counter is not None:
            count = int(values[first.counter.name])
            if not first.counter.in_range(count):
                self.rejected_frames += 1
                return
            if count == self._last_count.get(first.name):
                return
            self._last_count[first.name] = count
            self._echo = count
        self._accepted_at = now
        for request in self._device.clear_faults:
            if self._is_request(request.frame, request.base, values):
                self._faults.clear()
                self._stop()
                return
        for request in self._device.vent:
            if self._is_request(request.frame, request.base, values):
                self._stop()
                return
        for frame in known:
            self._take(frame, values)

    def poll(
        self,
        now: float,
        pressures: Sequence[float],
        angles: Sequence[float],
        supply_pressure: float,
    ) -> list[Frame]:
        """Check the sensors and the time; return the frames that are due."""
        self._check(now, pressures, angles)
        readings = readings_of(self._wired, pressures, angles, supply_pressure)
        news = (self._state(now), frozenset(self._faults))
        changed, self._state_sent = news != self._state_sent, news
        frames = []
        for sent in self._sent:
            tells = sent.frame.state is not None or sent.frame.faults
            if self._is_due(sent, now) or (changed and tells):
                data = self._encoded(sent, readings, now)
                if data is not None:
                    frames.append((sent.frame.frame_id, data))
        return frames

    def _regular_frames(self) -> list[_Sent]:
        found = []
        for frame in self._device.answers:
            message = self._messages[frame.name]
            measures = any(entry.what != "supply" for entry in frame.inputs)
            usual = 1.0 / self._settings.measurement_rate if measures else _STATUS_PERIOD
            signals = [entry.signal for entry in frame.inputs] + list(frame.faults.values())
            signals += [s for s in (frame.state, frame.echo, frame.uptime) if s is not None]
            selectors = {s.selected for s in signals if s.selector is not None}
            groups: list[int | None] = [*sorted(selectors)] or [None]
            for selector in groups:
                found.append(_Sent(frame, message, selector, frame.period or usual))
        return found

    def _is_due(self, sent: _Sent, now: float) -> bool:
        # counted and not summed up, so that rounding errors never cost a turn
        due = self._started + sent.turns * sent.period
        if now < due - 1e-9:
            return False
        sent.turns += math.floor(max(now - due, 0.0) / sent.period + 1e-9) + 1
        return True

    def _decoded(self, frame: CommandFrame, data: bytes) -> dict[str, Any] | None:
        """The raw values of a command by signal; None if it is not valid."""
        if len(data) != frame.length:
            return None
        message = self._messages[frame.name]
        try:
            values: dict[str, Any] = dict(
                message.decode(data, decode_choices=False, scaling=False)  # type: ignore[arg-type]
            )
        except (Error, ValueError, KeyError):
            return None
        checksum = frame.checksum
        if checksum is not None and values[checksum.layout.name] != checksum.value(data):
            return None
        for known in self._commands[frame.frame_id]:
            for output in known.outputs:
                value = values.get(output.layout.name, output.layout.raw_low)
                if not output.layout.in_range(value):
                    return None
        return values

    def _is_request(
        self, frame: CommandFrame, base: tuple[int, int], values: Mapping[str, Any]
    ) -> bool:
        """Whether a command has the constant values of a request."""
        key = (frame.frame_id, *base)
        wanted = self._wanted.get(key)
        if wanted is None:
            wanted = self._wanted[key] = self._constants(frame, base)
        return all(values.get(name) == value for name, value in wanted.items())

    def _constants(self, frame: CommandFrame, base: tuple[int, int]) -> dict[str, Any]:
        """The raw values of the signals of a frame that neither set points nor counters set."""
        names = {output.layout.name for output in frame.outputs}
        names |= {layout.name for layout in (frame.counter,) if layout is not None}
        names |= {frame.checksum.layout.name} if frame.checksum is not None else set()
        word = base[1] | int.from_bytes(base[0].to_bytes(frame.length, "little"), "big")
        constants: dict[str, Any] = dict(
            self._messages[frame.name].decode(  # type: ignore[arg-type]
                word.to_bytes(frame.length, "big"), decode_choices=False, scaling=False
            )
        )
        return {name: value for name, value in constants.items() if name not in names}

    def _take(self, frame: CommandFrame, values: Mapping[str, Any]) -> None:
        for output in frame.outputs:
            if output.layout.name in values:
                fraction = (values[output.layout.name] - output.bias) / output.gain
                self._fractions[output.place] = min(max(fraction, -1.0), 1.0)
                self._set = True
        if frame.enabled == frame.disabled:
            return
        both = (frame.base[0] | frame.enabled[0], frame.base[1] | frame.enabled[1])
        enabled = self._is_request(frame, both, values)
        if not enabled:
            self._running = False
            self._armed = True
        elif self._armed and not self._faults:
            self._running = True

    def _check(self, now: float, pressures: Sequence[float], angles: Sequence[float]) -> None:
        if now - self._started < self._settings.boot_time:
            self._stop()
            return
        if self._watchdog is not None and now - self._accepted_at > self._watchdog:
            if self._promises.latches and self._running and self._set:
                self._faults.add("WATCHDOG")
            self._stop()
        if not self._promises.tells_faults:
            return
        if any(math.isnan(value) for value in (*pressures, *angles)):
            self._faults.add("SENSOR")
            self._stop()
        limits = [self._limits.get(wire.place, math.inf) for wire in self._wired.pressures]
        if any(value > limit for value, limit in zip(pressures, limits, strict=True)):
            self._faults.add("OVER_PRESSURE")
            self._stop()

    def _stop(self) -> None:
        self._set = False
        if self._has_enable:
            self._running = False
        self._armed = not self._promises.needs_arming

    def _state(self, now: float) -> str:
        if self._faults:
            return "fault"
        return "active" if self.active and now - self._started >= self._settings.boot_time else ""

    def _encoded(
        self, sent: _Sent, readings: Mapping[tuple[str, Channel], float], now: float
    ) -> bytes | None:
        """The payload; None if a defective sensor cannot be represented."""
        frame, message = sent.frame, sent.message
        values: dict[str, float] = {signal.name: 0 for signal in message.signals}
        for signal in message.signals:
            if signal.is_multiplexer and sent.selector is not None:
                values[signal.name] = sent.selector
        for entry in frame.inputs:
            counts = _counts(entry, readings[entry.what, entry.channel])
            if counts is None:
                return None
            values[entry.signal.layout.name] = counts
        if frame.state is not None:
            rest, fault = self._state_raws
            state = self._state(now)
            values[frame.state.layout.name] = (
                min(self._device.active) if state == "active" else fault if state else rest
            )
        for name, signal_of in frame.faults.items():
            values[signal_of.layout.name] = int(name.upper() in self._faults)
        if frame.echo is not None:
            values[frame.echo.layout.name] = self._echo & frame.echo.layout.mask
        if frame.uptime is not None:
            layout = frame.uptime.layout
            values[layout.name] = round((now - self._started - layout.offset) / layout.scale)
        if frame.counter is not None:
            sent.count = frame.counter.after(sent.count) if self._counter_step else sent.count
            values[frame.counter.name] = sent.count
        data = message.encode(values, scaling=False, strict=False)
        data = (data + bytes(frame.length))[: frame.length]
        checksum = frame.checksum
        if frame.inputs and self._other_dbc == "other_byte_order":
            data = data[::-1]
        if checksum is not None:
            order: Literal["big", "little"] = "big" if checksum.layout.big else "little"
            value = checksum.value(data)
            if frame.inputs and self._other_dbc == "other_checksum":
                value ^= checksum.layout.mask
            own = value.to_bytes(checksum.end - checksum.start, order)
            data = data[: checksum.start] + own + data[checksum.end :]
        return data


class MappedTwins:
    """Makes the twins of the kind `mapped`."""

    def __init__(self, options: KindOptions) -> None:
        pass

    def make(self, wired: WiredBoard, settings: BoardSettings, now: float) -> SimulatedBoard:
        """The twin of one device, powered up at `now` [s]."""
        database = read_dbc(Path(wired.settings["dbc"]), _MAX_DBC_BYTES).database
        messages = {message.name: message for message in database.messages}
        return SimulatedMappedBoard(wired, read_device(wired), messages, settings, now)


def _counts(entry: MappedInput, value: float) -> float | None:
    """A reading in counts; None if a defective sensor cannot be represented."""
    layout = entry.signal.layout
    if math.isnan(value):
        if layout.float_format:
            return math.nan
        return min(entry.invalid, default=None)
    counts = min(max((value - entry.bias) / entry.gain, layout.raw_low), layout.raw_high)
    return counts if layout.float_format else round(counts)


def _state_raws(device: MappedDevice, state: Selected) -> tuple[int, int]:
    """Raw values of the state: at rest, and with a fault."""
    known = [*state.layout.labels, *range(state.layout.mask + 1)]
    rest = next(raw for raw in known if raw not in device.active | device.fault)
    return rest, min(device.fault, default=rest)
