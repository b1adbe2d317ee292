"""A kind of board as a vendor would make it, and its twin: the least that the protocol carries.

It stands outside the suite's packages and is found by its entry points. One node has one pressure
regulator and one shaft encoder; it speaks big-endian with 29 bit identifiers, in mbar and degrees,
and has no enable, counter, checksum, status, heartbeat or watchdog.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final

from pam_driver.boards.availability import Availability
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
    KindOptions,
    Promises,
    Sample,
    WiredBoard,
)
from pam_driver.boards.samples import ANGLE_INPUT, PRESSURE_INPUT
from pam_driver.can_bus.identifiers import EXTENDED
from pam_sim.boards.protocol import BoardSettings, BoardValve, SimulatedBoard

MBAR: Final = 100.0  # Pa
NO_PRESSURE: Final = -0x8000
NODES: Final = 16
BASE: Final = EXTENDED | 0x18FE_0000
WEAKEST: Final = Promises(
    watchdog=None,
    latches=False,
    keeps_host_fault=False,
    needs_arming=False,
    tells_state=False,
    tells_faults=False,
    echoes_commands=False,
    counts_samples=False,
    has_heartbeat=False,
    has_checksum=False,
    measures_supply=False,
)


def identifiers(node: int) -> tuple[int, int, int]:
    """Of set point, pressure and angle."""
    return BASE + 16 * node, BASE + 16 * node + 1, BASE + 16 * node + 2


class VendorBoard:
    """One node as the driver sees it."""

    promises = WEAKEST
    supply_pressure = math.nan
    follows = True
    host_fault = False
    round_trip = math.nan
    inputs: Mapping[str, Sample] = {}

    def __init__(self, wired: WiredBoard) -> None:
        self.name = wired.name
        setpoint, pressure, angle = identifiers(int(wired.settings["node"]))
        self.identifiers = Identifiers((pressure, angle), (setpoint,))
        self.listeners: Mapping[int, Hear] = {
            pressure: self._hear_pressure,
            angle: self._hear_angle,
            setpoint: self._hear_setpoint,
        }
        self.pressures: dict[Channel, Sample] = {"valve": Sample()}
        self.angles: dict[Channel, Sample] = {"shaft": Sample()}
        self.availability = Availability()
        self._wired = wired
        self._heard_at = {"pressure": NEVER, "angle": NEVER}

    def command(self, setpoints: Sequence[float] | None, now: float) -> Iterable[Frame]:
        frames = []
        for wire in self._wired.valves:
            fraction = 0.0 if setpoints is None else max(setpoints[wire.place], 0.0)
            pressure = fraction * (wire.muscle.valve.full_scale or 0.0)
            data = struct.pack(">H", round(pressure / MBAR))
            frames.append((self.identifiers.commands[0], data))
        return frames

    def vent(self) -> Iterable[Frame]:
        return self.command(None, 0.0)

    def clear_faults(self) -> Iterable[Frame]:
        return ()

    def latch_fault(self) -> Iterable[Frame]:
        return ()

    def acknowledge(self) -> None:
        pass

    def silent(self, now: float, timeout: float) -> list[str]:
        wanted = ["pressure"] if self._wired.pressures else []
        wanted += ["angle"] if self._wired.angles else []
        return [kind for kind in wanted if now - self._heard_at[kind] > timeout]

    def conditions(
        self, now: float, timeout: float, sensor_timeout: float, moving: bool
    ) -> Iterator[Condition]:
        silent = self.silent(now, timeout)
        if silent:
            yield Condition("board_lost", self.name, f"no {', no '.join(silent)} for {timeout:g} s")

    def counts(self) -> Mapping[str, int]:
        return {}

    def report(self) -> BoardReport:
        return BoardReport("tells no state", {})

    def _hear_pressure(self, data: bytes, time: float, stamp: float) -> None:
        frame_id = self.identifiers.answers[0]
        if len(data) != 2:
            raise FrameLengthError(frame_id, f"{len(data)} bytes, expected 2")
        self._heard_at["pressure"] = time
        (raw,) = struct.unpack(">h", data)
        self.availability.hear(PRESSURE_INPUT, "valve", raw != NO_PRESSURE, time)
        if raw != NO_PRESSURE:
            self.pressures["valve"] = Sample(raw * MBAR, time, stamp)

    def _hear_angle(self, data: bytes, time: float, stamp: float) -> None:
        frame_id = self.identifiers.answers[1]
        if len(data) != 4:
            raise FrameLengthError(frame_id, f"{len(data)} bytes, expected 4")
        (degrees,) = struct.unpack(">f", data)
        if not abs(degrees) <= 720.0 and not math.isnan(degrees):
            raise FrameRangeError(frame_id, f"{degrees:g} deg, expected -720 to 720")
        self._heard_at["angle"] = time
        self.availability.hear(ANGLE_INPUT, "shaft", not math.isnan(degrees), time)
        if not math.isnan(degrees):
            self.angles["shaft"] = Sample(math.radians(degrees), time, stamp)

    def _hear_setpoint(self, data: bytes, time: float, stamp: float) -> None:
        raise ForeignCommandError(self.identifiers.commands[0], f"a command to {self.name}")


class VendorKind:
    """What the entry point of the group `pam_driver.board_kinds` names."""

    def __init__(self, options: KindOptions) -> None:
        pass

    def problems(self, wired: Sequence[WiredBoard]) -> list[str]:
        found = []
        for board in wired:
            where = f"boards.{board.address}"
            for key in sorted(set(board.settings) - {"kind", "bus", "node"}):
                found.append(f"{where}.{key}: unknown key of a vendor node")
            if board.settings.get("node") not in range(NODES):
                found.append(f"{where}.node: expected 0 to {NODES - 1}")
            for wire in board.valves:
                if wire.channel != "valve" or wire.muscle.valve.kind != "pressure_regulator":
                    found.append(f"{wire.muscle.name}: expected channel valve, and a regulator")
            for angle in board.angles:
                if angle.channel != "shaft":
                    found.append(f"{angle.joint.name}.encoder: expected channel shaft")
        return found

    def make(self, wired: WiredBoard) -> VendorBoard:
        return VendorBoard(wired)

    def stranger(self, frame_id: int, data: bytes) -> FrameError | None:
        return None


class SimulatedVendorBoard:
    """The node itself: the valve follows the last set point for ever."""

    active = True
    fault_names: tuple[str, ...] = ()

    def __init__(self, wired: WiredBoard, settings: BoardSettings, now: float) -> None:
        self.valves = tuple(BoardValve.of(wire.muscle) for wire in wired.valves)
        self.rejected_frames = 0
        self._wired, self._settings = wired, settings
        self._ids = identifiers(int(wired.settings["node"]))
        self._pressure = 0.0
        self._next = now

    @property
    def valve_commands(self) -> tuple[float, ...]:
        return tuple(self._pressure for _ in self.valves)

    def on_frame(self, frame_id: int, data: bytes, now: float) -> None:
        if frame_id != self._ids[0]:
            return
        if len(data) != 2:
            self.rejected_frames += 1
            return
        (raw,) = struct.unpack(">H", data)
        self._pressure = raw * MBAR

    def poll(
        self,
        now: float,
        pressures: Sequence[float],
        angles: Sequence[float],
        supply_pressure: float,
    ) -> list[Frame]:
        if now < self._next - 1e-9:
            return []
        self._next += 1.0 / self._settings.measurement_rate
        frames = []
        for pressure in pressures:
            lost = math.isnan(pressure)
            raw = NO_PRESSURE if lost else max(min(round(pressure / MBAR), 0x7FFF), -1000)
            frames.append((self._ids[1], struct.pack(">h", raw)))
        frames += [(self._ids[2], struct.pack(">f", math.degrees(angle))) for angle in angles]
        return frames

    def restarted(self, now: float) -> SimulatedBoard:
        return SimulatedVendorBoard(self._wired, self._settings, now)

    def misbehave(self, fault: str, value: float) -> None:
        pass


class VendorTwins:
    """What the entry point of the group `pam_sim.board_twins` names."""

    def __init__(self, options: KindOptions) -> None:
        pass

    def make(self, wired: WiredBoard, settings: BoardSettings, now: float) -> SimulatedBoard:
        return SimulatedVendorBoard(wired, settings, now)
