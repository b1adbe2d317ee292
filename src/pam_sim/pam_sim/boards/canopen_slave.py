"""A simulated CANopen slave: NMT states, SDO server, heartbeats, EMCY and PDOs. No plant.

The SDO server is that of the package `canopen`. PDOs are encoded and decoded from the values that
the master has written into the object dictionary, not from the driver's tables, so that a mistake
in those shows. Source: CiA 301 version 4.2.
"""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Mapping
from typing import Final

from canopen.objectdictionary import ObjectDictionary, ODVariable, datatypes
from canopen.sdo.exceptions import SdoAbortedError
from canopen.sdo.server import SdoServer

from pam_driver.boards.canopen.device import (
    BOOT_UP,
    NMT,
    OPERATIONAL,
    PRE_OPERATIONAL,
    READY,
    START,
    STATES,
    STOP,
    STOPPED,
    SYNC,
)
from pam_driver.boards.canopen.dictionary import ObjectName
from pam_driver.boards.protocol import Frame

_RESETS: Final = frozenset({129, 130})
_INVALID: Final = 0x8000_0000
# Below it are the parameters of communication, which are read in every turn and change rarely.
_APPLICATION: Final = 0x2000
_NOT_MAPPABLE, _TOO_LONG, _WRONG_STATE = 0x0604_0041, 0x0604_0042, 0x0800_0022
_NO_OBJECT, _NO_SUB, _READ_ONLY, _WRITE_ONLY = 0x0602_0000, 0x0609_0011, 0x0601_0002, 0x0601_0001
_WRONG_LENGTH, _TOO_HIGH, _TOO_LOW, _NO_VALUE = 0x0607_0010, 0x0609_0031, 0x0609_0032, 0x060A_0023
HEARTBEAT_LOST, PDO_TOO_SHORT, PDO_TOO_LONG = 0x8130, 0x8210, 0x8220
COMMUNICATION: Final = 0x10
"""Bit of the error register."""
_STATE_AFTER_ERROR: Final = {0: READY, 1: OPERATIONAL, 2: STOPPED}


class SimulatedSlave:
    """A CANopen slave.

    Parameters
    ----------
    node : int
        Node number.
    dictionary : ObjectDictionary
        Its objects with their values after power-up.
    preset : mapping of ObjectName to int
        Values that differ from those of the EDS file, such as the serial number.
    boot_time : float
        Duration of the self test after power-up or reset [s].
    now : float
        Time of power-up [s].

    Attributes
    ----------
    state : int
        NMT state, see `device.STATES`.
    failed : bool
        Whether it missed the heartbeats of the host since it was last started.
    rejected_frames : int
        Frames to this node that were not valid.
    refused : dict of int to int
        By index, the abort code with which SDO requests are refused, for tests.
    """

    def __init__(
        self,
        node: int,
        dictionary: ObjectDictionary,
        preset: Mapping[ObjectName, int],
        boot_time: float,
        now: float,
    ) -> None:
        self.node = node
        self.object_dictionary = dictionary
        self.state = BOOT_UP
        self.failed = False
        self.rejected_frames = 0
        self.refused: dict[int, int] = {}
        self.values: dict[ObjectName, bytes] = {}
        self._preset, self._boot_time = preset, boot_time
        self._out: list[Frame] = []
        self._numbers: dict[tuple[int, int], float] = {}
        self._heard_at: float | None = None
        self._lost = False
        self._sdo = SdoServer(0x600 + node, 0x580 + node, self)  # type: ignore[no-untyped-call]
        self._sdo.network = _Outbox(self._out)  # type: ignore[assignment]
        self._reset(now)

    def get_data(self, index: int, subindex: int, check_readable: bool = False) -> bytes:
        """The value of an object; called by the SDO server."""
        entry = self._entry(index, subindex)
        if check_readable and not entry.readable:
            raise SdoAbortedError(_WRITE_ONLY)
        if index in self.refused:
            raise SdoAbortedError(self.refused[index])
        known = self.values.get(ObjectName(index, subindex))
        if known is not None:
            return known
        value = entry.value if entry.value is not None else entry.default
        if value is None:
            raise SdoAbortedError(_NO_VALUE)
        return bytes(entry.encode_raw(value))

    def set_data(
        self, index: int, subindex: int, data: bytes, check_writable: bool = False
    ) -> None:
        """Write an object; called by the SDO server."""
        entry = self._entry(index, subindex)
        if check_writable and not entry.writable:
            raise SdoAbortedError(_READ_ONLY)
        if index in self.refused:
            raise SdoAbortedError(self.refused[index])
        if entry.data_type in datatypes.NUMBER_TYPES and 8 * len(data) != len(entry):
            raise SdoAbortedError(_WRONG_LENGTH)
        if entry.data_type in datatypes.INTEGER_TYPES:
            value = int(entry.decode_raw(bytes(data)))
            if entry.max is not None and value > entry.max:
                raise SdoAbortedError(_TOO_HIGH)
            if entry.min is not None and value < entry.min:
                raise SdoAbortedError(_TOO_LOW)
            self._check_mapping(index, subindex, value)
        self._numbers.clear()
        self.values[ObjectName(index, subindex)] = bytes(data)

    def number(self, index: int, sub: int = 0) -> float:
        """The value of a number object; 0 if the device does not have it."""
        known = self._numbers.get((index, sub))
        if known is not None:
            return known
        try:
            value = self._entry(index, sub).decode_raw(self.get_data(index, sub))
        except SdoAbortedError:
            value = 0
        number = value if isinstance(value, int | float) else 0
        if index < _APPLICATION:
            self._numbers[index, sub] = number
        return number

    def store(self, name: ObjectName, value: float) -> None:
        """Set the value of an object from inside the device."""
        if name.index < _APPLICATION:
            self._numbers.clear()
        self.values[name] = bytes(self._entry(*name).encode_raw(value))

    def emergency(self, code: int, register: int, data: bytes = b"") -> None:
        """Send an EMCY and keep it in the error register and the error field."""
        self.store(ObjectName(0x1001), register)
        if code:
            with contextlib.suppress(SdoAbortedError):
                self.store(ObjectName(0x1003, 1), code)
                self.store(ObjectName(0x1003, 0), 1)
        payload = struct.pack("<HB5s", code, register, data)
        if self.state != BOOT_UP:
            self._out.append((0x080 + self.node, payload))

    def on_frame(self, frame_id: int, data: bytes, now: float) -> Mapping[ObjectName, float]:
        """Receive a frame; returns the objects that an RPDO has set."""
        self._now = now
        if frame_id == NMT:
            self._command(data, now)
        elif frame_id == 0x600 + self.node:
            self._serve(data, now)
        elif frame_id == self._guarded_id():
            if len(data) == 1:
                self._heard_at = now
            else:
                self.rejected_frames += 1
        elif frame_id == SYNC and self.state == OPERATIONAL:
            self._synced = True
        elif frame_id in self._rpdos and self.state == OPERATIONAL:
            return self._take(self._rpdos[frame_id], data)
        return {}

    def poll(self, now: float) -> None:
        """Advance the times; frames wait for `frames`."""
        self._now = now
        if self.state == BOOT_UP:
            if now - self._started < self._boot_time:
                self._out.clear()
                return
            self.state = READY
            self._heartbeat_due = now
            self._out.append((0x700 + self.node, bytes([BOOT_UP])))
        limit = (int(self.number(0x1016, 1)) & 0xFFFF) / 1000.0
        heard = self._heard_at
        if limit and heard is not None and now - heard > limit and not self._lost:
            self._lost = True
            self._heard_at = None
            self.emergency(HEARTBEAT_LOST, int(self.number(0x1001)) | 1 | COMMUNICATION)
            if self.state == OPERATIONAL:
                self.failed = True
                self._enter(_STATE_AFTER_ERROR.get(int(self.number(0x1029, 1)), READY))
        period = self.number(0x1017) / 1000.0
        if period and now >= self._heartbeat_due - 1e-9:
            self._heartbeat_due = max(self._heartbeat_due + period, now)
            self._out.append((0x700 + self.node, bytes([self.state])))

    def tpdos(self, now: float) -> None:
        """Send the TPDOs that are due, with the values that are stored."""
        if self.state != OPERATIONAL:
            return
        for number, names in self._tpdos.items():
            kind = int(self.number(0x1800 + number, 2))
            period = self.number(0x1800 + number, 5) / 1000.0
            if kind <= 240:
                due = self._synced
            else:
                due = bool(period) and now >= self._pdo_due.get(number, now) - 1e-9
            if not due or any(name not in self.values for name in names):
                continue
            self._pdo_due[number] = max(self._pdo_due.get(number, now) + period, now)
            identifier = int(self.number(0x1800 + number, 1)) & 0x7FF
            self._out.append((identifier, b"".join(self.values[name] for name in names)))
        self._synced = False

    def frames(self) -> list[Frame]:
        """The frames that are to be sent."""
        waiting = list(self._out)
        self._out.clear()
        return waiting

    def _reset(self, now: float) -> None:
        self.state, self.failed = BOOT_UP, False
        self.values = {}
        self._numbers.clear()
        for name, value in self._preset.items():
            self.store(name, value)
        self._started = self._now = now
        self._heard_at, self._lost = None, False
        self._heartbeat_due = now
        self._synced = False
        self._pdo_due: dict[int, float] = {}
        self._rpdos: dict[int, int] = {}
        self._tpdos: dict[int, list[ObjectName]] = {}
        self._out.clear()

    def _entry(self, index: int, sub: int) -> ODVariable:
        found = self.object_dictionary.indices.get(index)
        if found is None:
            raise SdoAbortedError(_NO_OBJECT)
        if isinstance(found, ODVariable):
            if sub:
                raise SdoAbortedError(_NO_SUB)
            return found
        if sub not in found.subindices:
            raise SdoAbortedError(_NO_SUB)
        entry: ODVariable = found.subindices[sub]
        return entry

    def _guarded_id(self) -> int:
        return 0x700 + (int(self.number(0x1016, 1)) >> 16 & 0x7F) if self.state else -1

    def _command(self, data: bytes, now: float) -> None:
        if len(data) != 2:
            self.rejected_frames += 1
            return
        command, node = data
        if node not in (0, self.node) or self.state == BOOT_UP:
            return
        if command == START:
            self.failed = self._lost = False
            self.store(ObjectName(0x1001), 0)
            self._enter(OPERATIONAL)
        elif command == STOP:
            self._enter(STOPPED)
        elif command == PRE_OPERATIONAL:
            self._enter(READY)
        elif command in _RESETS:
            self._reset(now)

    def _enter(self, state: int) -> None:
        assert state in STATES
        if state == OPERATIONAL and self.state != OPERATIONAL:
            self._rpdos = {
                int(self.number(0x1400 + number, 1)) & 0x7FF: number
                for number in self._valid(0x1400)
            }
            self._tpdos = {n: self._mapping(0x1A00 + n) for n in self._valid(0x1800)}
            self._pdo_due, self._synced = {}, False
        self.state = state

    def _valid(self, first: int) -> list[int]:
        """The PDOs that are on, counted from 0."""
        indices = self.object_dictionary.indices
        known = [index - first for index in sorted(indices) if 0 <= index - first < 0x200]
        return [n for n in known if not int(self.number(first + n, 1)) & _INVALID]

    def _mapping(self, index: int) -> list[ObjectName]:
        entries = [int(self.number(index, sub)) for sub in range(1, int(self.number(index, 0)) + 1)]
        return [ObjectName(entry >> 16, entry >> 8 & 0xFF) for entry in entries]

    def _serve(self, data: bytes, now: float) -> None:
        if self.state in {BOOT_UP, STOPPED}:
            return
        if len(data) != 8:
            self.rejected_frames += 1
            return
        with contextlib.suppress(struct.error):  # a segment before any request
            self._sdo.on_request(0x600 + self.node, data, now)  # type: ignore[no-untyped-call]

    def _check_mapping(self, index: int, sub: int, value: int) -> None:
        """What CiA 301 demands of a change of PDOs."""
        if not 0x1600 <= index < 0x1800 and not 0x1A00 <= index < 0x1C00:
            return
        if not int(self.number(index - 0x200, 1)) & _INVALID or self.state == OPERATIONAL:
            raise SdoAbortedError(_WRONG_STATE)
        if sub:
            if value and not self._entry(value >> 16, value >> 8 & 0xFF).pdo_mappable:
                raise SdoAbortedError(_NOT_MAPPABLE)
        else:
            bits = sum(int(self.number(index, one)) & 0xFF for one in range(1, value + 1))
            if bits > 64:
                raise SdoAbortedError(_TOO_LONG)

    def _take(self, number: int, data: bytes) -> Mapping[ObjectName, float]:
        names = self._mapping(0x1600 + number)
        entries = [self._entry(*name) for name in names]
        length = sum(len(entry) for entry in entries) // 8
        if len(data) != length:
            self.rejected_frames += 1
            code = PDO_TOO_SHORT if len(data) < length else PDO_TOO_LONG
            self.emergency(code, int(self.number(0x1001)) | 1 | COMMUNICATION)
            return {}
        found: dict[ObjectName, float] = {}
        for name, entry in zip(names, entries, strict=True):
            size = len(entry) // 8
            part, data = data[:size], data[size:]
            self.values[name] = part
            value = entry.decode_raw(part)
            if isinstance(value, int | float):
                found[name] = value
        return found


class _Outbox:
    """The network that `canopen`'s SDO server sends to."""

    def __init__(self, out: list[Frame]) -> None:
        self._out = out

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        self._out.append((can_id, bytes(data)))
