"""A CANopen device as the driver's core sees it: PDOs to values and back, states, faults."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final

from pam_driver.boards.canopen.boot import Boot, BootStage
from pam_driver.boards.canopen.device import (
    BOOT_UP,
    NMT,
    OPERATIONAL,
    READY,
    START,
    STATES,
    STOP,
    STOPPED,
    SYNC,
    CanopenDevice,
    Rpdo,
)
from pam_driver.boards.canopen.emergency import emergency_text
from pam_driver.boards.canopen.host import Host
from pam_driver.boards.canopen.measurements import PdoSamples
from pam_driver.boards.frame_errors import (
    ForeignCommandError,
    FrameError,
    FrameLengthError,
    FrameRangeError,
)
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

HEARTBEATS_MISSED: Final = 5
"""Number of missing heartbeats of a device that is a fault."""
_REFUSED_PDO: Final = frozenset({0x8210, 0x8220})  # EMCY, CiA 301: PDO not processed
# Another device's frame with an identifier of this one is a fault for this time [s].
_CLASH_MEMORY: Final = 1.0
WITHOUT: Final[Mapping[str, tuple[str, str]]] = {
    "latches": (
        "no latch of its own: it stays off until the driver starts it (NMT), which a new process "
        "of the driver does as well",
        "the driver latches its own faults and starts the device with set points that vent; leave "
        "activate_on_start false",
    ),
    "needs_arming": (
        "no arming: once started (NMT), it follows the first set point that it receives",
        "the driver sends set points that vent until it is activated",
    ),
}
"""Promises whose absence means less than for other kinds, see `weaker_promises`."""


class CanopenBoard:
    """A CANopen device; docs/your_valves.md describes the keys.

    Parameters
    ----------
    wired : WiredBoard
        Its muscles and joints.
    device : CanopenDevice
        The tables made from the rig file and the EDS file.
    host : Host
        Sends the heartbeat of the driver on this bus.
    """

    without = WITHOUT

    def __init__(self, wired: WiredBoard, device: CanopenDevice, host: Host) -> None:
        self.name = wired.name
        self.promises = device.promises
        self.boot = Boot(device)
        node = device.node
        self._heartbeat_id, self._emergency_id = 0x700 + node, 0x080 + node
        sdo = self.boot.sdo
        service = [NMT, sdo.request_id]
        service += [0x700 + device.host_node] if device.host_period is not None else []
        service += [SYNC] if device.sync else []
        self.identifiers = Identifiers(
            (
                *(pdo.frame_id for pdo in device.answers),
                self._heartbeat_id,
                self._emergency_id,
                sdo.answer_id,
            ),
            tuple(pdo.frame_id for pdo in device.commands),
            tuple(service),
        )
        self._measured = PdoSamples(wired, node, device.answers, self._heard_pdo)
        self.pressures, self.angles = self._measured.pressures, self._measured.angles
        self.availability = self._measured.availability
        self.host_fault = False
        self.round_trip = math.nan  # PDOs carry no counter
        self.inputs: Mapping[str, Sample] = {}
        self.restarts = 0
        self.listeners: Mapping[int, Hear] = {
            **self._measured.listeners,
            **{pdo.frame_id: self._foreign(pdo) for pdo in device.commands},
            self._heartbeat_id: self._hear_heartbeat,
            self._emergency_id: self._hear_emergency,
            sdo.answer_id: self._hear_sdo,
        }
        self._wired, self._device, self._host = wired, device, host
        host.serve(device)
        self._heartbeat_at = NEVER
        self._state: int | None = None
        self._left = ""
        self._emergencies: dict[int, str] = {}
        self._clash: tuple[float, str] = (NEVER, "")
        self._restarted = False
        self._opened = False
        self._venting = True
        self._stopped = False

    @property
    def supply_pressure(self) -> float:
        """The last measured supply pressure [Pa absolute]; NaN if it measures none."""
        return self._measured.supply_pressure

    @property
    def follows(self) -> bool:
        """Whether the device is operational and was last sent set points that do not vent."""
        running = self.boot.stage is BootStage.DONE and self._state == OPERATIONAL
        return running and not self._venting

    def command(self, setpoints: Sequence[float] | None, now: float) -> Iterable[Frame]:
        """The heartbeat of the driver, a step of the boot if it is not done, and the set points."""
        boot, device = self.boot, self._device
        if boot.stage is BootStage.IDLE:
            boot.begin()
        frames = self._host.frames(now)
        self._venting = setpoints is None
        if boot.stage is not BootStage.DONE:
            frames += boot.frames(now)
            return frames
        if self._takes_no_setpoints:  # not even those that vent
            if not self._stopped:
                self._stopped = True
                frames.append((NMT, bytes([STOP, device.node])))
            return frames
        if setpoints is not None:
            self._opened = True
            if self._stopped:
                frames.append((NMT, bytes([START, device.node])))
                self._stopped = False
        frames += [(pdo.frame_id, _payload(pdo, setpoints)) for pdo in device.commands]
        return frames

    def vent(self) -> Iterable[Frame]:
        """NMT stop if the rig file asks for it; `command` sends the set points that vent."""
        if not self._device.stops:
            return ()
        self._stopped = self.boot.stage is BootStage.DONE
        return ((NMT, bytes([STOP, self._device.node])),)

    def clear_faults(self) -> Iterable[Frame]:
        """Forget emergencies, and boot a device again that is not operational."""
        wrong = self._left or self._emergencies or self.boot.stage is BootStage.REFUSED
        self._left = ""
        self._emergencies.clear()
        self._opened = False
        if wrong and self.boot.stage is not BootStage.IDLE:
            self.boot.begin()
        return ()

    def latch_fault(self) -> Iterable[Frame]:
        """Nothing: CANopen has no object for a fault of the host."""
        return ()

    def acknowledge(self) -> None:
        """Discard a restart that was reported."""
        self._restarted = False

    def silent(self, now: float, timeout: float) -> list[str]:
        """The names of the regular frames that are missing."""
        missing: list[str] = []
        if self.boot.stage is BootStage.REFUSED:  # the reason is more exact
            return missing
        limit = min(timeout, max(HEARTBEATS_MISSED * self._device.heartbeat_period, 0.1))
        if now - self._heartbeat_at > limit:
            missing.append(f"heartbeat (0x{self._heartbeat_id:03X}) for {limit:g} s")
        if self._state in {OPERATIONAL, None} and self.boot.stage in {
            BootStage.DONE,
            BootStage.IDLE,
        }:
            missing += [
                f"{name} for {timeout:g} s" for name in self._measured.missing(now, timeout)
            ]
        return missing

    def conditions(
        self, now: float, timeout: float, sensor_timeout: float, moving: bool
    ) -> Iterator[Condition]:
        """What is wrong with the device, see `Board.conditions`."""
        silent, node = self.silent(now, timeout), self._device.node
        if silent:
            text = f"node {node}: no {', no '.join(silent)}"
            if self.boot.stage is BootStage.WAITING:
                text += f"; {self.boot.error}"
            yield Condition("board_lost", self.name, text)
        yield from self._measured.range_conditions(self.name, now, sensor_timeout)
        if self._restarted:
            yield Condition("board_restarted", self.name, f"node {node} has restarted (boot-up)")
        wrong = [*self._emergencies.values(), *self._measured.invalid_texts()]
        if self._left:
            wrong.append(self._left)
        if self.boot.stage is BootStage.REFUSED:
            wrong.append(self.boot.error)
        if now - self._clash[0] < _CLASH_MEMORY:
            wrong.append(self._clash[1])
        if wrong:
            yield Condition("board_fault", self.name, f"fault: {', '.join(wrong)}")
        elif self.boot.stage not in {BootStage.DONE, BootStage.IDLE}:
            if not silent:
                text = f"node {node} is not ready: {self.boot.progress}"
                yield Condition("board_not_active", self.name, text)
        elif moving and not self.follows and not silent:
            text = f"node {node} is {self._state_text()} although it was commanded to be active"
            yield Condition("board_not_active", self.name, text)

    def counts(self) -> Mapping[str, int]:
        """Counts of readings out of range, and of restarts."""
        return {"out_of_range": self._measured.out_of_range, "restarts": self.restarts}

    def report(self) -> BoardReport:
        """State, progress of the boot, emergencies and supply pressure."""
        values: dict[str, object] = dict(self.counts())
        values["node"] = self._device.node
        values["NMT state"] = self._state_text()
        values["boot"] = self.boot.progress
        values["emergencies"] = ", ".join(self._emergencies.values()) or "none"
        if self.boot.notes:
            values["refused at boot"] = "; ".join(self.boot.notes)
        if invalid := self._measured.invalid_texts():
            values["invalid"] = ", ".join(invalid)
        if self.promises.measures_supply:
            values["supply pressure [Pa absolute]"] = self.supply_pressure
        return BoardReport(self._state_text(), values)

    def traffic(self, rate: float) -> Sequence[Traffic]:
        """Its regular frames, and those that the driver sends to it."""
        device = self._device
        answers = rate if device.sync else 1.0 / device.period
        found = [
            Traffic(f"TPDO{pdo.number}", pdo.frame_id, pdo.length, answers)
            for pdo in device.answers
        ]
        found.append(Traffic("heartbeat", self._heartbeat_id, 1, 1.0 / device.heartbeat_period))
        found += [
            Traffic(f"RPDO{pdo.number}", pdo.frame_id, pdo.length, rate) for pdo in device.commands
        ]
        if device.host_period is not None:
            host = 0x700 + device.host_node
            found.append(Traffic("heartbeat of the host", host, 1, 1.0 / device.host_period))
        return found

    def wires(self) -> Mapping[tuple[str, Channel], str]:
        """The PDOs and objects of set points, pressures and angles."""
        channels = {wire.place: wire.channel for wire in self._wired.valves}
        found = {
            ("setpoint", channels[output.place]): f"RPDO{pdo.number}.{output.field.name}"
            for pdo in self._device.commands
            for output in pdo.outputs
        }
        for pdo in self._device.answers:
            for entry in pdo.inputs:
                found[entry.what, entry.channel] = f"TPDO{pdo.number}.{entry.field.name}"
        return found

    def invalid_values(self) -> Mapping[tuple[str, Channel], Mapping[int, str]]:
        """The raw values that count as no measurement, with their names."""
        return {
            (entry.what, entry.channel): entry.invalid
            for pdo in self._device.answers
            for entry in pdo.inputs
            if entry.invalid
        }

    def _state_text(self) -> str:
        if self._state is None:
            return "no heartbeat received"
        return STATES.get(self._state, str(self._state))

    @property
    def _takes_no_setpoints(self) -> bool:
        """Whether the device has refused PDOs with set points for their length."""
        return not _REFUSED_PDO.isdisjoint(self._emergencies)

    def _hear_heartbeat(self, data: bytes, time: float, stamp: float) -> None:
        name = f"heartbeat of node {self._device.node}"
        self._expect(self._heartbeat_id, name, 1, data, time)
        state = data[0]
        if state not in STATES:
            raise FrameRangeError(self._heartbeat_id, f"{name} has the unknown state {state}")
        known, self._state = self._state, state
        self._heartbeat_at = time
        stage = self.boot.stage
        if state == BOOT_UP:
            self._boot_up(known is not None)
        elif state == OPERATIONAL:
            self.boot.is_operational()
        elif stage is BootStage.DONE and not self._stopped and known in {OPERATIONAL, state}:
            self._leave(state)

    def _boot_up(self, again: bool) -> None:
        self._emergencies.clear()
        self._left = ""
        self._stopped = False
        if again:
            self.restarts += 1
            self._restarted = True
        if self.boot.stage is not BootStage.IDLE:
            self.boot.begin()

    def _leave(self, state: int) -> None:
        """The device is no longer operational, although the driver did not stop it.

        If no valve was opened since the last boot, nothing happened, and it is started again.
        """
        if not self._opened and state in {STOPPED, READY}:
            self.boot.begin()
            self._emergencies.clear()
        elif not self._left:
            self._left = f"node {self._device.node} left the state operational: {STATES[state]}"

    def _hear_emergency(self, data: bytes, time: float, stamp: float) -> None:
        self._expect(self._emergency_id, f"EMCY of node {self._device.node}", 8, data, time)
        code = int.from_bytes(data[:2], "little")
        if code >> 8 == 0:
            self._emergencies.clear()
        else:
            text = emergency_text(code, data[2], data[3:])
            self._emergencies[code] = f"node {self._device.node}: {text}"

    def _hear_sdo(self, data: bytes, time: float, stamp: float) -> None:
        self._expect(
            self.boot.sdo.answer_id, f"SDO answer of node {self._device.node}", 8, data, time
        )
        self.boot.sdo.hear(data)
        self._heartbeat_at = time  # a device that is not configured yet sends no heartbeat

    def _expect(self, frame_id: int, name: str, length: int, data: bytes, time: float) -> None:
        """Refuse a frame of another length: another device uses this identifier."""
        if len(data) != length:
            error = FrameLengthError(
                frame_id,
                f"{name} has {len(data)} bytes, expected {length}: another device may use this "
                "identifier",
            )
            self._clash = (time, str(error))
            raise error

    def _heard_pdo(self) -> None:
        """Only an operational device sends PDOs."""
        if self.boot.stage is BootStage.STARTING:
            self._state = OPERATIONAL
            self.boot.is_operational()

    def _foreign(self, pdo: Rpdo) -> Hear:
        def hear(data: bytes, time: float, stamp: float) -> None:
            error: FrameError = ForeignCommandError(pdo.frame_id, f"a command to {self.name}")
            if len(data) != pdo.length:
                error = FrameLengthError(
                    pdo.frame_id,
                    f"RPDO{pdo.number} of node {self._device.node} has {len(data)} bytes, "
                    f"expected {pdo.length}",
                )
            raise error

        return hear


def _payload(pdo: Rpdo, setpoints: Sequence[float] | None) -> bytes:
    word = 0
    for output in pdo.outputs:
        fraction = output.vented if setpoints is None else setpoints[output.place]
        word |= output.field.bits_of(output.raw(fraction))
    return word.to_bytes(pdo.length, "little")
