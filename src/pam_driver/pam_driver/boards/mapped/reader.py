"""Reads the section of a mapped device in the rig file, and checks it against its DBC file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from cantools.database.can import Message, Signal

from pam_driver.boards.conversion import fits, read_conversion
from pam_driver.boards.frame_errors import DbcError
from pam_driver.boards.mapped.command_reader import CommandReader, Commands
from pam_driver.boards.mapped.dbc_lookup import DbcLookup, raw_limits, raw_value
from pam_driver.boards.mapped.device import (
    AnswerFrame,
    FrameChecksum,
    MappedDevice,
    MappedInput,
    Selected,
)
from pam_driver.boards.mapped.doubts import Needed, doubt_labels, doubt_numbers, doubt_range
from pam_driver.boards.mapped.frame_checks import read_checksum, read_counter
from pam_driver.boards.mapped.signal_layout import frame_length
from pam_driver.boards.protocol import Channel, Promises, WiredBoard
from pam_driver.boards.samples import ANGLE_INPUT, PRESSURE_INPUT, SUPPLY_INPUT
from pam_driver.boards.units import ANGLE, PRESSURE, Linear
from pam_model.rig.keys import Key, Problems, Section

_OFFSET: Final = Key("-", -0x1FFF_FFFF, 0x1FFF_FFFF, 0.0)
_WATCHDOG: Final = Key("s", 0.005, 10.0)
_PERIOD: Final = Key("s", 0.0005, 10.0)


@dataclass
class _Answer:
    """An answer that is being read."""

    message: Message
    frame: AnswerFrame


class MappedDeviceReader:
    """Reads one device; `problems` has one line for everything that is wrong.

    Parameters
    ----------
    wired : WiredBoard
        The section of the rig file, and the muscles and joints of the device.

    Attributes
    ----------
    problems : list of str
        What is wrong; empty if `device` can be used.
    doubts : list of str
        What is odd although the device can be used, as a flaw elsewhere in the DBC file.
    device : MappedDevice or None
        The device, if nothing is wrong.
    """

    def __init__(self, wired: WiredBoard) -> None:
        collected = Problems("")
        self.problems, self.doubts = collected.lines, collected.doubts
        self.device: MappedDevice | None = None
        self._wired = wired
        self._top = Section(wired.settings, f"boards.{wired.address}", collected)
        self._answers: dict[str, _Answer] = {}
        for name in ("kind", "bus"):
            self._top.get(name)
        lookup = self._open()
        if lookup is None:
            return
        self._lookup = lookup
        device = self._read()
        self._top.finish()
        self.doubts += [f"{self._top.key('dbc')}: {doubt}" for doubt in lookup.doubts()]
        if not self.problems:
            self.device = device

    def _open(self) -> DbcLookup | None:
        path = self._top.get("dbc")
        offset = self._top.number("identifier_offset", _OFFSET)
        if not isinstance(path, str) or not path:
            given = ": missing" if path is None else f" = {path!r}"
            self._top.add("dbc", f"{given}; the path of the device's DBC file is needed")
            return None
        try:
            return DbcLookup(Path(path), int(offset or 0))
        except DbcError as error:
            self._top.add("dbc", f" = {error}")
            return None

    def _read(self) -> MappedDevice:
        top = self._top
        commands = CommandReader(self._wired, self._lookup, top)
        commands.read()
        self._read_inputs(PRESSURE_INPUT, "pressures", PRESSURE)
        self._read_inputs(ANGLE_INPUT, "angles", ANGLE)
        if "supply" in top.tree:
            self._read_input(top.section("supply"), SUPPLY_INPUT, "", PRESSURE)
        active, fault = self._read_state()
        self._read_faults()
        self._read_single("echo")
        self._read_single("uptime")
        self._read_answers()
        for name in self._answers:
            if name in commands.messages:
                top.problems.add(
                    f"{top.path}",
                    f": {name} is a command and an answer; a message has one sender",
                )
            self._lookup.used_fit(self._answers[name].message, top)
        made = commands.commands()
        answers = tuple(answer.frame for answer in self._answers.values())
        if not answers and not made.cyclic and not self.problems:
            top.problems.add(top.path, ": maps neither a set point nor a measurement")
        return MappedDevice(
            answers,
            made.cyclic,
            made.vent,
            made.clear_faults,
            active,
            fault,
            self._promises(answers, made),
        )

    def _promises(self, answers: Sequence[AnswerFrame], commands: Commands) -> Promises:
        top = self._top
        watchdog = top.number("watchdog", _WATCHDOG, optional=True)
        stated = {name: top.get(name) for name in ("latches", "needs_arming")}
        for name, value in stated.items():
            if value is not None and not isinstance(value, bool):
                top.add(name, f" = {value!r}: must be true or false")
        if stated["latches"] and not top.tree.get("clear_faults"):
            top.add("latches", ": clear_faults is missing, the message that clears the latch")
        measuring = [frame for frame in answers if frame.inputs]
        return Promises(
            watchdog=watchdog,
            latches=stated["latches"] is True,
            keeps_host_fault=False,
            needs_arming=stated["needs_arming"] is True,
            tells_state=any(frame.state is not None for frame in answers),
            tells_faults=any(frame.faults for frame in answers)
            or bool(isinstance(top.tree.get("state"), Mapping) and top.tree["state"].get("fault")),
            echoes_commands=any(frame.echo is not None for frame in answers),
            counts_samples=bool(measuring)
            and all(frame.counter is not None for frame in measuring),
            has_heartbeat=any(frame.uptime is not None for frame in answers),
            has_checksum=bool(commands.cyclic)
            and all(frame.checksum is not None for frame in commands.cyclic),
            measures_supply=any(
                entry.what == SUPPLY_INPUT for frame in answers for entry in frame.inputs
            ),
        )

    def _answer(self, message: Message) -> _Answer:
        answer = self._answers.get(message.name)
        if answer is None:
            period = message.cycle_time / 1000.0 if message.cycle_time else None
            frame = AnswerFrame(
                message.name, self._lookup.frame_id(message), frame_length(message), period=period
            )
            answer = self._answers[message.name] = _Answer(message, frame)
        return answer

    def _claimed(self, where: Section) -> tuple[Message, Signal] | None:
        found = self._lookup.named(where)
        if found is None or not self._lookup.claim(*found, where, "signal"):
            return None
        return found

    def _read_inputs(self, what: str, name: str, quantity: str) -> None:
        """The pressures or angles: every wired channel needs one, and no other is expected."""
        section = self._top.section(name)
        of: dict[str, tuple[Channel, str]] = {}
        if what == PRESSURE_INPUT:
            for wire in self._wired.pressures:
                of[str(wire.channel)] = (wire.channel, wire.muscle.name)
        else:
            for angle in self._wired.angles:
                of[str(angle.channel)] = (angle.channel, angle.joint.name)
        for channel, (_, owner) in of.items():
            if channel not in {str(key) for key in section.tree}:
                section.add(channel, f": missing; {owner} is wired to this channel")
        for key in section.tree:
            section.get(key)
            if str(key) not in of:
                section.add(str(key), f": no {what} of the rig is wired to this channel")
                continue
            self._read_input(section.section(key), what, of[str(key)][0], quantity)

    def _read_input(self, where: Section, what: str, channel: Channel, quantity: str) -> None:
        found = self._claimed(where)
        if found is None:
            return
        message, signal = found
        converted = read_conversion(
            where,
            self._lookup.source(message, signal),
            (quantity,),
            self._wired.ambient_pressure,
            absolute=what == SUPPLY_INPUT,
        )
        invalid = self._invalid(where, signal)
        wraps = where.get("wraps") if what == ANGLE_INPUT else None
        if wraps is not None and not isinstance(wraps, bool):
            where.add("wraps", f" = {wraps!r}: must be true or false")
        if converted is None:
            return
        where.finish()
        linear, _ = converted
        selected = self._lookup.selected(message, signal)
        layout = selected.layout
        gain = linear.factor * layout.scale
        bias = linear.factor * layout.offset + linear.offset
        if not Linear(gain, bias).is_usable:
            self._lookup.refuse_numbers(where, message, signal, gain, bias)
            return
        entry = MappedInput(
            what,
            channel,
            selected,
            gain=gain,
            bias=bias,
            invalid=invalid,
            wraps=wraps is True,
        )
        answer = self._answer(message)
        answer.frame = replace(answer.frame, inputs=(*answer.frame.inputs, entry))
        self._check_range(where, what, channel, entry, message)
        needed = self._needed(what, channel)
        if needed is not None:
            line = self._lookup.place(message.name, signal.name)
            doubt_range(where, entry, f"{message.name}.{signal.name}", line, needed)
            doubt_labels(where, entry, needed)
            doubt_numbers(where, entry, signal, line, needed)

    def _needed(self, what: str, channel: Channel) -> Needed | None:
        """What a signal must be able to show; None for the supply pressure."""
        if what == PRESSURE_INPUT:
            for wire in self._wired.pressures:
                if wire.channel == channel:
                    most = wire.muscle.max_pressure
                    return Needed(0.0, most, max(most, self._wired.ambient_pressure), "Pa gauge")
        if what == ANGLE_INPUT:
            for angle in self._wired.angles:
                if angle.channel == channel:
                    low, high = angle.joint.position_limits
                    return Needed(low, high, high - low, "rad")
        return None

    def _check_range(
        self, where: Section, what: str, channel: Channel, entry: MappedInput, message: Message
    ) -> None:
        """Refuse a signal that cannot show the pressures or angles that the rig file allows."""
        layout = entry.signal.layout
        ends = [layout.raw_low * entry.gain + entry.bias, layout.raw_high * entry.gain + entry.bias]
        low, high = min(ends), max(ends)
        place = f"{message.name}.{layout.name}"
        for wire in self._wired.pressures if what == PRESSURE_INPUT else ():
            if wire.channel == channel and not (
                fits(0.0, low, high) and fits(wire.muscle.max_pressure, low, high)
            ):
                where.add(
                    "signal",
                    f" = {place}: shows {low:.6g} to {high:.6g} Pa gauge, but {wire.muscle.name} "
                    f"needs 0 to max_pressure = {wire.muscle.max_pressure:g} Pa gauge",
                )
        if what != ANGLE_INPUT or entry.wraps:
            return
        for angle in self._wired.angles:
            limits = angle.joint.position_limits
            if angle.channel == channel and not all(fits(end, low, high) for end in limits):
                where.add(
                    "signal",
                    f" = {place}: shows {low:.6g} to {high:.6g} rad, but position_limits of "
                    f"{angle.joint.name} are {limits[0]:g} to {limits[1]:g} rad",
                )

    def _invalid(self, where: Section, signal: Signal) -> dict[int, str]:
        """Raw values that are no measurement: those with a label in the DBC, and `invalid`.

        A label under the key `valid` is a measurement.
        """
        found = {int(raw): str(name) for raw, name in (signal.choices or {}).items()}
        valid = where.get("valid")
        if valid is not None and (isinstance(valid, str) or not isinstance(valid, list | tuple)):
            where.add("valid", f" = {valid!r}: must be a list of labels of {signal.name}")
            valid = None
        for label in valid or ():
            raw = raw_value(signal, label)
            if isinstance(raw, str):
                where.add("valid", f": {raw}")
            else:
                found.pop(raw, None)
        section = where.section("invalid")
        low, high = raw_limits(signal)
        for name in section.tree:
            raw = section.get(name)
            if isinstance(raw, bool) or not isinstance(raw, int):
                section.add(str(name), f" = {raw!r}: must be a raw value of {signal.name}")
                continue
            if signal.is_signed and high < raw <= high - low:
                raw -= high - low + 1  # the same bits, written without a sign
            if not low <= raw <= high:
                section.add(str(name), f" = {raw}: {signal.name} takes raw values {low} to {high}")
                continue
            found[raw] = str(name)
        return found

    def _read_state(self) -> tuple[frozenset[int], frozenset[int]]:
        nothing: frozenset[int] = frozenset()
        if "state" not in self._top.tree:
            return nothing, nothing
        where = self._top.section("state")
        found = self._claimed(where)
        values = {name: where.get(name) for name in ("active", "fault")}
        where.finish()
        if found is None:
            return nothing, nothing
        message, signal = found
        sets: dict[str, frozenset[int]] = {}
        for name, given in values.items():
            if given is None and name == "fault":
                sets[name] = nothing
                continue
            if not isinstance(given, list | tuple) or not given:
                shown = ": missing" if given is None else f" = {given!r}"
                where.add(name, f"{shown}; must be a list of values of {signal.name}")
                continue
            raws = [raw_value(signal, value) for value in given]
            for raw in raws:
                if isinstance(raw, str):
                    where.add(name, f": {raw}")
            sets[name] = frozenset(raw for raw in raws if isinstance(raw, int))
        answer = self._answer(message)
        answer.frame = replace(answer.frame, state=self._lookup.selected(message, signal))
        return sets.get("active", nothing), sets.get("fault", nothing)

    def _read_faults(self) -> None:
        section = self._top.section("faults")
        for name in section.tree:
            where = section.section(name)
            found = self._claimed(where)
            where.finish()
            if found is None:
                continue
            answer = self._answer(found[0])
            faults = {**answer.frame.faults, str(name): self._lookup.selected(*found)}
            answer.frame = replace(answer.frame, faults=faults)

    def _read_single(self, name: str) -> None:
        if name not in self._top.tree:
            return
        where = self._top.section(name)
        found = self._claimed(where)
        where.finish()
        if found is None:
            return
        selected: Selected = self._lookup.selected(*found)
        answer = self._answer(found[0])
        if name == "echo":
            answer.frame = replace(answer.frame, echo=selected)
        else:
            answer.frame = replace(answer.frame, uptime=selected)

    def _read_answers(self) -> None:
        """Counter, checksum and period of the answers."""
        section = self._top.section("answers")
        for name in section.tree:
            where = section.section(name)
            message = self._lookup.message(name, section, str(name))
            if message is None:
                continue
            counter = read_counter(where, self._lookup, message)
            checksum: FrameChecksum | None = read_checksum(where, self._lookup, message)
            period = where.number("period", _PERIOD, optional=True)
            where.finish()
            answer = self._answer(message)
            answer.frame = replace(
                answer.frame,
                counter=counter,
                checksum=checksum,
                period=answer.frame.period if period is None else period,
            )
