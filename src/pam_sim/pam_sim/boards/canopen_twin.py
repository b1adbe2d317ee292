"""The simulated twins of CANopen devices: I/O modules, transmitters, encoders and regulators.

A twin has the objects of the device's EDS file and does with its outputs what its profile says when
it is stopped or misses the host: after CiA 401 the objects 0x6443 and 0x6444 decide, and another
device turns its outputs off if the rig file says that its manual says so (`outputs_off_on_error`);
else it keeps the last set point.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from pam_driver.boards.canopen.device import (
    OPERATIONAL,
    READY,
    STOPPED,
    CanopenDevice,
    CanopenInput,
    CanopenOutput,
    Check,
)
from pam_driver.boards.canopen.dictionary import Dictionary, ObjectName
from pam_driver.boards.canopen.reader import read_device
from pam_driver.boards.protocol import Frame, KindOptions, WiredBoard
from pam_sim.boards.canopen_slave import SimulatedSlave
from pam_sim.boards.protocol import BoardSettings, BoardValve, SimulatedBoard, readings_of

_DEVICE_HARDWARE: Final = 0x5000
_GENERIC: Final = 0x01
_CANNOT_STORE: Final = 0x0800_0020
"""Abort code: data cannot be transferred or stored to the application."""
_PROFILE_BITS: Final = 0xFFFF
"""The bits of 0x1000 with the number of the device profile."""


class SimulatedCanopenDevice:
    """One CANopen device.

    Parameters
    ----------
    wired : WiredBoard
        Its muscles and joints.
    device : CanopenDevice
        What the driver expects of it; gives the meaning of raw values, the identity and the units.
    dictionary : Dictionary
        Its objects.
    settings : BoardSettings
        The boot time; rates are those that the driver configures.
    now : float
        Time of power-up [s].
    """

    def __init__(
        self,
        wired: WiredBoard,
        device: CanopenDevice,
        dictionary: Dictionary,
        settings: BoardSettings,
        now: float,
    ) -> None:
        self.valves = tuple(BoardValve.of(wire.muscle) for wire in wired.valves)
        self._wired, self._device = wired, device
        self._dictionary, self._settings = dictionary, settings
        preset = {
            step.name: step.expected & step.mask
            for step in device.steps
            if isinstance(step, Check)
            and not 0x1400 <= step.name.index < 0x1C00
            and ((dictionary.default(step.name) or 0) ^ step.expected) & step.mask
        }
        self.slave = SimulatedSlave(
            device.node, dictionary.as_canopen(), preset, settings.boot_time, now
        )
        self._outputs = {output.place: output for pdo in device.commands for output in pdo.outputs}
        self._inputs = [entry for pdo in device.answers for entry in pdo.inputs]
        self._raw = dict.fromkeys(self._outputs, 0.0)
        self._broken = False

    @property
    def active(self) -> bool:
        """Whether its valves follow set points."""
        return self.slave.state == OPERATIONAL

    @property
    def fault_names(self) -> tuple[str, ...]:
        """The names of its faults."""
        found = (("HEARTBEAT_LOST", self.slave.failed), ("SENSOR", self._broken))
        return tuple(name for name, present in found if present)

    @property
    def rejected_frames(self) -> int:
        """The number of frames to this device that were not valid."""
        return self.slave.rejected_frames

    @property
    def valve_commands(self) -> tuple[float, ...]:
        """The valves' commands: spool -1..1 or gauge pressure [Pa]."""
        return tuple(
            self._command(self._outputs[wire.place], valve)
            for valve, wire in zip(self.valves, self._wired.valves, strict=True)
        )

    def on_frame(self, frame_id: int, data: bytes, now: float) -> None:
        """Receive a frame from the bus; a frame for another device is ignored."""
        new = self.slave.on_frame(frame_id, data, now)
        for place, output in self._outputs.items():
            if output.field.name in new:
                self._raw[place] = new[output.field.name]
        self._obey_state()

    def poll(
        self,
        now: float,
        pressures: Sequence[float],
        angles: Sequence[float],
        supply_pressure: float,
    ) -> list[Frame]:
        """Read the sensors, advance the times; return the frames that are due."""
        slave = self.slave
        slave.poll(now)
        self._obey_state()
        readings = readings_of(self._wired, pressures, angles, supply_pressure)
        broken = any(math.isnan(value) for value in (*pressures, *angles))
        if broken is not self._broken and slave.state in {OPERATIONAL, READY, STOPPED}:
            self._broken = broken
            slave.emergency(_DEVICE_HARDWARE if broken else 0, _GENERIC if broken else 0)
        for entry in self._inputs:
            raw = _raw_of(entry, readings[entry.what, entry.channel])
            if raw is None:
                slave.values.pop(entry.field.name, None)
            else:
                slave.store(entry.field.name, raw)
        slave.tpdos(now)
        return slave.frames()

    def restarted(self, now: float) -> SimulatedBoard:
        """The device after a power-up at `now` [s]."""
        return SimulatedCanopenDevice(
            self._wired, self._device, self._dictionary, self._settings, now
        )

    def misbehave(self, fault: str, value: float) -> None:
        """Behave as a defective device would, until the next call with "mended".

        "emergency" sends an EMCY with the code `value`, "sdo_abort" refuses SDO requests to the
        index `value`, "refuse_configuration" those to an object that every boot writes, "leave"
        stops the device by itself, and "other_device" turns it into one with another profile.
        """
        if fault == "emergency":
            self.slave.emergency(int(value), _GENERIC)
        elif fault == "sdo_abort":
            self.slave.refused[int(value)] = _CANNOT_STORE
        elif fault == "refuse_configuration":
            self.slave.refused[0x1017] = _CANNOT_STORE
        elif fault == "other_device":
            own = int(self.slave.number(0x1000))
            self.slave.store(ObjectName(0x1000), own ^ _PROFILE_BITS)
        elif fault == "leave":
            self.slave.state = STOPPED
        elif fault == "mended":
            self.slave.refused.clear()
            self.slave.values.pop(ObjectName(0x1000), None)

    def _obey_state(self) -> None:
        """What the outputs do when the device is stopped or has missed the host."""
        slave = self.slave
        if slave.state == OPERATIONAL:
            return
        for place, output in self._outputs.items():
            _, sub = output.field.name
            if self._device.off_on_error:
                self._raw[place] = output.raw(output.vented)
                continue
            failed = slave.failed or slave.state == STOPPED
            known = ObjectName(0x6443, sub) in self._dictionary
            if failed and known and slave.number(0x6443, sub):
                self._raw[place] = slave.number(0x6444, sub)

    def _command(self, output: CanopenOutput, valve: BoardValve) -> float:
        raw = self._raw[output.place]
        if abs(raw - output.raw(output.vented)) <= 0.5 and not output.field.kind.is_float:
            return valve.vented
        return valve.command(min(max((raw - output.bias) / output.gain, -1.0), 1.0))


class CanopenTwins:
    """Makes the twins of the kind `canopen`."""

    def __init__(self, options: KindOptions) -> None:
        pass

    def make(self, wired: WiredBoard, settings: BoardSettings, now: float) -> SimulatedBoard:
        """The twin of one device, powered up at `now` [s]."""
        device, dictionary = read_device(wired)
        return SimulatedCanopenDevice(wired, device, dictionary, settings, now)


def _raw_of(entry: CanopenInput, value: float) -> float | None:
    """A reading as a raw value; None if a defective sensor cannot be represented."""
    is_float = entry.field.kind.is_float
    if math.isnan(value):
        return math.nan if is_float else min(entry.invalid, default=None)
    raw = min(max((value - entry.bias) / entry.gain, entry.low), entry.high)
    return raw if is_float else round(raw)
