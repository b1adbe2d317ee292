"""One valve board of this project as the driver's core sees it; only here frames become values."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from pam_driver.boards.echo_delay import EchoDelay
from pam_driver.boards.frame_errors import ForeignCommandError
from pam_driver.boards.pam_board.codec import (
    BoardCode,
    BoardCodec,
    BoardCommand,
    BoardFault,
    BoardState,
    Heartbeat,
    Measurement,
    Status,
    ValveCommand,
)
from pam_driver.boards.pam_board.monitor import BoardMonitor
from pam_driver.boards.protocol import (
    BoardReport,
    Channel,
    Frame,
    Hear,
    Identifiers,
    Promises,
    Traffic,
    WiredBoard,
)

_ANSWERS: Final = (Measurement, Status, Heartbeat)
_COMMANDS: Final = (ValveCommand, BoardCommand)
_NO_VALVES: Final = (0.0, 0.0)
_NO_ENABLE: Final = (False, False)


class PamBoard(BoardMonitor):
    """A board with a number; see docs/can_protocol.md for the rules it relies on."""

    def __init__(self, number: int, wired: WiredBoard, codec: BoardCodec) -> None:
        super().__init__(number)
        self.name = wired.name
        self.promises = promises(codec)
        self.identifiers = Identifiers(
            tuple(codec.frame_id(kind, number) for kind in _ANSWERS),
            tuple(codec.frame_id(kind, number) for kind in _COMMANDS),
        )
        self._measurement_id, self._status_id, self._heartbeat_id = self.identifiers.answers
        self.listeners: Mapping[int, Hear] = {
            self._measurement_id: self._hear_measurement,
            self._status_id: self._hear_status,
            self._heartbeat_id: self._hear_heartbeat,
            **{frame_id: self._foreign(frame_id) for frame_id in self.identifiers.commands},
        }
        self._codec = codec
        self._counter_sent = 0
        self._brake_delay = wired.brake_release_delay
        self._moves_since = math.inf
        self._echo_delay = EchoDelay()
        # by channel the muscle's place in the rig's order, -1 for a channel without a muscle
        places = {wire.channel: wire.place for wire in wired.valves}
        self._places = (places.get(0, -1), places.get(1, -1))
        self._enable = (0 in places, 1 in places)
        self._vent = (codec.encode(number, BoardCommand(BoardCode.VENT)),)
        self._clear = (codec.encode(number, BoardCommand(BoardCode.CLEAR_FAULTS)),)
        self._latch = (codec.encode(number, BoardCommand(BoardCode.LATCH_FAULT)),)

    @property
    def supply_pressure(self) -> float:
        """The supply pressure in the last status [Pa absolute], NaN before the first status."""
        return math.nan if self.status is None else self.status.supply_pressure

    @property
    def follows(self) -> bool:
        """Whether the last status reported that the valves are active."""
        return self.status is not None and self.status.state is BoardState.ACTIVE

    @property
    def round_trip(self) -> float:
        """From sending the command that the last status names until this status arrived [s]."""
        return self._echo_delay.value

    @property
    def host_fault(self) -> bool:
        """Whether the last status reported a latched fault of the host."""
        status = self.status
        return status is not None and bool(status.faults) and BoardFault.HOST in status.faults

    def command(self, setpoints: Sequence[float] | None, now: float) -> Iterable[Frame]:
        """One valve command; a channel without a muscle is never enabled."""
        self._counter_sent = (self._counter_sent + 1) & 0xFF
        self._echo_delay.sent(self._counter_sent, now)
        if setpoints is None:
            self._moves_since = math.inf
            message = ValveCommand(_NO_VALVES, _NO_ENABLE, self._counter_sent)
        else:
            first, second = self._places
            valves = (
                setpoints[first] if first >= 0 else 0.0,
                setpoints[second] if second >= 0 else 0.0,
            )
            # air may move: only now the dump valve is closed, and the brake is released, at once or
            # when the controller has had the time to build up the pressure that holds the joint
            self._moves_since = min(self._moves_since, now)
            release = now - self._moves_since >= self._brake_delay
            message = ValveCommand(valves, self._enable, self._counter_sent, release, True)
        return (self._codec.encode(self.number, message),)

    def vent(self) -> Iterable[Frame]:
        """The board command `vent`."""
        return self._vent

    def clear_faults(self) -> Iterable[Frame]:
        """The board command `clear_faults`."""
        return self._clear

    def latch_fault(self) -> Iterable[Frame]:
        """The board command `latch_fault`."""
        return self._latch

    def counts(self) -> Mapping[str, int]:
        """Counts of measurements lost, repeated and out of order, and of restarts."""
        return {
            "frames_lost": self.frames_lost,
            "frames_repeated": self.frames_repeated,
            "frames_reordered": self.frames_reordered,
            "restarts": self.restarts,
        }

    def traffic(self, rate: float) -> Sequence[Traffic]:
        """Its regular frames, by the cycle times of the DBC file; commands in every cycle."""
        return [
            Traffic(kind.__name__, self._codec.frame_id(kind, self.number), length, often or rate)
            for kind, length, often in self._codec.regular_frames()
        ]

    def wires(self) -> Mapping[tuple[str, Channel], str]:
        """The signals of its channels."""
        return {
            ("setpoint", 0): "ValveCommand.Valve0",
            ("setpoint", 1): "ValveCommand.Valve1",
            ("pressure", 0): "Measurement.Pressure0",
            ("pressure", 1): "Measurement.Pressure1",
            ("angle", 0): "Measurement.Position",
        }

    def report(self) -> BoardReport:
        """Counts, state, faults, supply and versions."""
        values: dict[str, object] = {
            "measurements lost": self.frames_lost,
            "measurements repeated": self.frames_repeated,
            "measurements out of order": self.frames_reordered,
            "restarts": self.restarts,
        }
        text = "no status received"
        if self.status is not None:
            text = self.status.state.name.lower()
            faults = ", ".join(str(fault.name).lower() for fault in self.status.faults)
            values |= {
                "state": text,
                "faults": faults or "none",
                "supply pressure [Pa absolute]": self.status.supply_pressure,
                "rejected frames": self.status.rejected_frames,
                "emergency stop permits": self.status.emergency_stop.name.lower(),
                "enabling switch permits": self.status.enabling_switch.name.lower(),
                "brake released": self.status.brake_released,
                "dump valve closed": self.status.dump_closed,
            }
        if self.heartbeat is not None:
            values |= {
                "uptime [s]": self.heartbeat.uptime,
                "firmware version": self.heartbeat.firmware_version,
            }
        return BoardReport(text, values)

    def _hear_measurement(self, data: bytes, time: float, stamp: float) -> None:
        _, message = self._codec.decode(self._measurement_id, data)
        assert isinstance(message, Measurement)  # as of every frame with this identifier
        self.hear_measurement(message, time, stamp)

    def _hear_status(self, data: bytes, time: float, stamp: float) -> None:
        _, message = self._codec.decode(self._status_id, data)
        assert isinstance(message, Status)
        self.hear_status(message, time)
        self._echo_delay.heard(message.command_counter, time)

    def _hear_heartbeat(self, data: bytes, time: float, stamp: float) -> None:
        _, message = self._codec.decode(self._heartbeat_id, data)
        assert isinstance(message, Heartbeat)
        self.hear_heartbeat(message, time)

    def _foreign(self, frame_id: int) -> Hear:
        def hear(data: bytes, time: float, stamp: float) -> None:
            self._codec.decode(frame_id, data)
            raise ForeignCommandError(frame_id, f"a command to {self.name}")

        return hear


def promises(codec: BoardCodec) -> Promises:
    """The promises of a board that uses this DBC."""
    return Promises(
        watchdog=codec.watchdog_timeout,
        latches=True,
        keeps_host_fault=True,
        needs_arming=True,
        tells_state=True,
        tells_faults=True,
        echoes_commands=True,
        counts_samples=True,
        has_heartbeat=True,
        has_checksum=True,
        measures_supply=True,
    )
