"""A mapped device as the driver's core sees it: frames to values and back, by the tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final

from pam_driver.boards.frame_errors import (
    ForeignCommandError,
    FrameCrcError,
    FrameLengthError,
)
from pam_driver.boards.mapped.device import (
    AnswerFrame,
    CommandFrame,
    FrameChecksum,
    MappedDevice,
    RequestFrame,
)
from pam_driver.boards.mapped.sample_counter import SampleCounter
from pam_driver.boards.power_on_time import has_restarted
from pam_driver.boards.protocol import (
    NEVER,
    BoardReport,
    Channel,
    Condition,
    Frame,
    Hear,
    Identifiers,
    Sample,
    Traffic,
    WiredBoard,
)
from pam_driver.boards.samples import Samples

# A frame is due half a cycle early rather than nearly a cycle late [s].
_EARLY: Final = 0.0005


class MappedBoard:
    """A device that the rig file maps; docs/your_valves.md describes the keys.

    Parameters
    ----------
    wired : WiredBoard
        Its muscles and joints.
    device : MappedDevice
        The tables made from the rig file and the DBC file.
    """

    def __init__(self, wired: WiredBoard, device: MappedDevice) -> None:
        self.name = wired.name
        self.promises = device.promises
        requests = [*device.vent, *device.clear_faults]
        commands = {frame.frame_id: frame for frame in device.commands}
        commands |= {one.frame.frame_id: one.frame for one in requests}
        self.identifiers = Identifiers(
            tuple(frame.frame_id for frame in device.answers), tuple(commands)
        )
        self._samples = Samples(wired)
        self.pressures, self.angles = self._samples.pressures, self._samples.angles
        self.availability = self._samples.availability
        self.host_fault = False
        self.round_trip = math.nan  # what a device echoes need not be a counter
        self.inputs: Mapping[str, Sample] = {}
        self.restarts = 0
        self.listeners: Mapping[int, Hear] = {
            **{frame.frame_id: self._listener(frame) for frame in device.answers},
            **{frame.frame_id: self._foreign(frame) for frame in commands.values()},
        }
        self._wired = wired
        self._device = device
        self._counters = {
            frame.name: SampleCounter(int(frame.counter.values))
            for frame in device.answers
            if frame.counter is not None
        }
        self._heard_at = {frame.name: NEVER for frame in device.answers}
        self._state: int | None = None
        self._state_labels = next(
            (f.state.layout.labels for f in device.answers if f.state is not None), {}
        )
        self._faults: dict[str, bool] = {}
        self._echo: int | None = None
        self._echo_at = NEVER
        self._uptime = NEVER
        self._restarted = False
        self._count: dict[str, int] = dict.fromkeys((f.name for f in commands.values()), 0)
        self._due = [NEVER] * len(device.commands)
        self._venting = True

    @property
    def supply_pressure(self) -> float:
        """The last measured supply pressure [Pa absolute]; NaN if it measures none."""
        return self._samples.supply_pressure

    @property
    def follows(self) -> bool:
        """Whether the device reported that its valves follow; True if it does not report it."""
        return not self.promises.tells_state or self._state in self._device.active

    def command(self, setpoints: Sequence[float] | None, now: float) -> Iterable[Frame]:
        """The frames that are due; a vent is always sent at once."""
        vents = setpoints is None
        frames = []
        for index, frame in enumerate(self._device.commands):
            if now < self._due[index] - _EARLY and vents is self._venting:
                continue
            if now > self._due[index] + frame.period:
                self._due[index] = now
            self._due[index] += frame.period
            fixed = frame.disabled if setpoints is None else frame.enabled
            base = (frame.base[0] | fixed[0], frame.base[1] | fixed[1])
            frames.append(self._built(frame, base, setpoints))
        self._venting = vents
        return frames

    def vent(self) -> Iterable[Frame]:
        """The messages of `vent`; the set points that vent are sent by `command` at once."""
        self._due = [NEVER] * len(self._due)
        return [self._requested(one) for one in self._device.vent]

    def clear_faults(self) -> Iterable[Frame]:
        """The messages of `clear_faults`."""
        return [self._requested(one) for one in self._device.clear_faults]

    def latch_fault(self) -> Iterable[Frame]:
        """Nothing: a mapped device keeps no fault of the host."""
        return ()

    def acknowledge(self) -> None:
        """Discard a restart that was reported."""
        self._restarted = False

    def silent(self, now: float, timeout: float) -> list[str]:
        """The names of the messages that are missing."""
        return [name for name, time in self._heard_at.items() if now - time > timeout]

    def conditions(
        self, now: float, timeout: float, sensor_timeout: float, moving: bool
    ) -> Iterator[Condition]:
        """What is wrong with the device, see `Board.conditions`."""
        silent = self.silent(now, timeout)
        if silent:
            yield Condition("board_lost", self.name, f"no {', no '.join(silent)} for {timeout:g} s")
        for name, counter in self._counters.items():
            if counter.frozen(now, sensor_timeout):
                text = f"counter of {name} has not changed for {sensor_timeout:g} s"
                yield Condition("counter_frozen", self.name, text)
        yield from self._samples.range_conditions(self.name, now, sensor_timeout)
        if self._restarted:
            yield Condition("board_restarted", self.name, "has restarted")
        wrong = self._samples.invalid_texts()
        wrong += [name for name, present in self._faults.items() if present]
        if self._state in self._device.fault:
            wrong.append(f"state {self._state_text()}")
        if wrong:
            yield Condition("board_fault", self.name, f"fault: {', '.join(wrong)}")
        elif moving and not self.follows:
            text = f"is {self._state_text()} although it was commanded to be active"
            yield Condition("board_not_active", self.name, text)
        elif moving and self.promises.echoes_commands and now - self._echo_at > timeout:
            text = f"has accepted no command for {timeout:g} s"
            yield Condition("command_not_heard", self.name, text)

    def counts(self) -> Mapping[str, int]:
        """Counts of measurements lost, repeated, out of order and out of range, and restarts."""
        counters = self._counters.values()
        return {
            "frames_lost": sum(counter.lost for counter in counters),
            "frames_repeated": sum(counter.repeated for counter in counters),
            "frames_reordered": sum(counter.reordered for counter in counters),
            "out_of_range": self._samples.out_of_range,
            "restarts": self.restarts,
        }

    def report(self) -> BoardReport:
        """Counts, state, faults and supply pressure."""
        values: dict[str, object] = dict(self.counts())
        text = "state not reported by this device"
        if self.promises.tells_state:
            text = self._state_text()
            values["state"] = text
        if self.promises.tells_faults:
            named = [name for name, present in self._faults.items() if present]
            values["faults"] = ", ".join(named) or "none"
        if invalid := self._samples.invalid_texts():
            values["invalid"] = ", ".join(invalid)
        if self.promises.measures_supply:
            values["supply pressure [Pa absolute]"] = self.supply_pressure
        if self._uptime != NEVER:
            values["uptime"] = self._uptime
        return BoardReport(text, values)

    def traffic(self, rate: float) -> Sequence[Traffic]:
        """Its regular frames; a message without a stated period counts as one for each cycle."""
        frames: list[AnswerFrame | CommandFrame] = [*self._device.answers, *self._device.commands]
        return [
            Traffic(
                frame.name,
                frame.frame_id,
                frame.length,
                1.0 / frame.period if frame.period else rate,
            )
            for frame in frames
        ]

    def wires(self) -> Mapping[tuple[str, Channel], str]:
        """The signals of set points, pressures and angles."""
        channels = {wire.place: wire.channel for wire in self._wired.valves}
        found = {
            ("setpoint", channels[output.place]): f"{frame.name}.{output.layout.name}"
            for frame in self._device.commands
            for output in frame.outputs
        }
        for answer in self._device.answers:
            for entry in answer.inputs:
                found[entry.what, entry.channel] = f"{answer.name}.{entry.signal.layout.name}"
        return found

    def invalid_values(self) -> Mapping[tuple[str, Channel], Mapping[int, str]]:
        """The raw values that count as no measurement, with their names."""
        return {
            (entry.what, entry.channel): entry.invalid
            for answer in self._device.answers
            for entry in answer.inputs
            if entry.invalid
        }

    def _state_text(self) -> str:
        if self._state is None:
            return "no state received"
        return self._state_labels.get(self._state, str(self._state))

    def _built(
        self, frame: CommandFrame, base: tuple[int, int], setpoints: Sequence[float] | None
    ) -> Frame:
        little, big = base
        for place, layout, gain, bias, vented in frame.outputs:
            fraction = vented if setpoints is None else setpoints[place]
            bits = layout.bits_of_counts(gain * fraction + bias)
            if layout.big:
                big |= bits
            else:
                little |= bits
        if frame.counter is not None:
            self._count[frame.name] = frame.counter.after(self._count[frame.name])
            bits = frame.counter.bits_of_raw(self._count[frame.name])
            if frame.counter.big:
                big |= bits
            else:
                little |= bits
        data = (big | _swapped(little, frame.length)).to_bytes(frame.length, "big")
        if frame.checksum is not None:
            data = _with_checksum(frame.checksum, data)
        return frame.frame_id, data

    def _requested(self, request: RequestFrame) -> Frame:
        return self._built(request.frame, request.base, None)

    def _listener(self, frame: AnswerFrame) -> Hear:
        keeper, misser = self._samples.keeper, self._samples.misser
        readings = tuple(
            (
                entry,
                keeper(entry.what, entry.channel, wraps=entry.wraps),
                misser(entry.what, entry.channel),
            )
            for entry in frame.inputs
        )

        def hear(data: bytes, time: float, stamp: float) -> None:
            self._check(frame, data)
            little, big = int.from_bytes(data, "little"), int.from_bytes(data, "big")
            found, missed = [], []
            for entry, keep, miss in readings:
                if not entry.signal.present(little, big):
                    continue
                layout = entry.signal.layout
                raw = layout.raw(little, big)
                name, value = entry.invalid.get(raw, ""), layout.number(raw)
                if not name and value != value:  # noqa: PLR0124  (NaN)
                    name = "not a number"
                if not name and not layout.raw_low <= value <= layout.raw_high:
                    text = (
                        f"{frame.name}.{layout.name} is {layout.physical(raw):g}, outside the "
                        f"range {layout.low:g} to {layout.high:g} of the DBC file"
                    )
                    missed.append((miss, text))
                    continue
                found.append((keep, name, entry.gain * value + entry.bias))
            if frame.counter is not None and not self._counters[frame.name].fresh(
                frame.counter.raw(little, big), time
            ):
                return
            self._heard_at[frame.name] = time
            for keep, name, value in found:
                keep(name, value, time, stamp)
            for miss, text in missed:
                miss(text, time)
            self._hear_status(frame, little, big, time)

        return hear

    def _hear_status(self, frame: AnswerFrame, little: int, big: int, time: float) -> None:
        """The signals of a frame that are no measurements."""
        if frame.state is not None and frame.state.present(little, big):
            self._state = frame.state.layout.raw(little, big)
        for name, signal in frame.faults.items():
            if signal.present(little, big):
                self._faults[name] = signal.layout.raw(little, big) != 0
        if frame.echo is not None and frame.echo.present(little, big):
            echo = frame.echo.layout.raw(little, big)
            if echo != self._echo:
                self._echo, self._echo_at = echo, time
        if frame.uptime is not None and frame.uptime.present(little, big):
            layout = frame.uptime.layout
            uptime = layout.physical(layout.raw(little, big))
            if has_restarted(self._uptime, uptime, layout.low, layout.high):
                self.restarts += 1
                self._restarted = True
                for counter in self._counters.values():
                    counter.reset()
            self._uptime = uptime

    def _foreign(self, frame: CommandFrame) -> Hear:
        def hear(data: bytes, time: float, stamp: float) -> None:
            self._check(frame, data)
            raise ForeignCommandError(frame.frame_id, f"a command to {self.name}")

        return hear

    def _check(self, frame: AnswerFrame | CommandFrame, data: bytes) -> None:
        name = f"{frame.name} of {self.name}"
        if len(data) != frame.length:
            raise FrameLengthError(
                frame.frame_id, f"{name} has {len(data)} bytes, expected {frame.length}"
            )
        checksum = frame.checksum
        if checksum is not None:
            little, big = int.from_bytes(data, "little"), int.from_bytes(data, "big")
            if checksum.layout.raw(little, big) != checksum.value(data):
                raise FrameCrcError(frame.frame_id, f"{name} fails its checksum")


def _swapped(word: int, length: int) -> int:
    return int.from_bytes(word.to_bytes(length, "little"), "big") if word else 0


def _with_checksum(checksum: FrameChecksum, data: bytes) -> bytes:
    value = checksum.value(data)
    own = value.to_bytes(checksum.end - checksum.start, "big" if checksum.layout.big else "little")
    return data[: checksum.start] + own + data[checksum.end :]
