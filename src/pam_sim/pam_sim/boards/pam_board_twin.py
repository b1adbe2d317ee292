"""The simulated twin of a `pam_board`, with its own clock and its own latched faults.

It obeys the rules of docs/can_protocol.md. The caller provides the monotonic time in seconds. The
default of the watchdog is the DBC's 100 ms, which is fifty cycles at 500 Hz: neither one lost frame
nor a host that is busy for a moment vents the arm, while a muscle whose valve is commanded to hold
its pressure drifts only a little in that time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from pam_driver.boards.pam_board.codec import (
    CHANNELS,
    PROTOCOL_VERSION,
    BoardCode,
    BoardCodec,
    BoardCommand,
    BoardFault,
    BoardMessage,
    BoardState,
    FrameCrcError,
    FrameError,
    Heartbeat,
    Measurement,
    SafetyInput,
    Status,
    ValveCommand,
)
from pam_driver.boards.pam_board.kind import WITH_CANOPEN, PamBoardKind, number_of
from pam_driver.boards.protocol import Frame, KindOptions, WiredBoard
from pam_sim.boards.firmware_twin import FirmwareBoard
from pam_sim.boards.protocol import BoardSettings, BoardValve, SimulatedBoard

FIRMWARE_VERSION = 1
CRC_LIMIT = 10  # frames with a wrong CRC within CRC_WINDOW, while active
CRC_WINDOW = 1.0  # s
# The range of the board's converters; readings saturate at its ends.
PRESSURE_RANGE = (-1e5, 1.2e6)
POSITION_RANGE = (-8.38, 8.38)
SUPPLY_RANGE = (0.0, 1.3e6)


class SimulatedPamBoard:
    """One valve board.

    Parameters
    ----------
    number : int
        Its number on the bus.
    codec : BoardCodec
        Encodes and decodes the frames.
    settings : BoardSettings, optional
        Rates and watchdog.
    valves : sequence of BoardValve, optional
        The valves on its channels.
    now : float, optional
        Time of power-up [s].
    sensors : sequence of int, optional
        The channel of each pressure sensor; by default those of the valves.

    Attributes
    ----------
    emergency_stop, enabling_switch : SafetyInput
        Inputs for people; a person or a test sets them.
    """

    def __init__(
        self,
        number: int,
        codec: BoardCodec,
        settings: BoardSettings | None = None,
        valves: Sequence[BoardValve] = (BoardValve(), BoardValve()),
        channels: Sequence[int] = (0, 1),
        now: float = 0.0,
        sensors: Sequence[int] | None = None,
    ) -> None:
        self.number = number
        self.settings = settings or BoardSettings()
        self.state = BoardState.BOOT
        self.faults = BoardFault(0)
        self.rejected_frames = 0
        self._codec = codec
        self.valves = tuple(valves)
        self._channels = tuple(channels)
        self._sensors = self._channels if sensors is None else tuple(sensors)
        self._limits = {
            channel: valve.max_pressure
            for channel, valve in zip(self._channels, self.valves, strict=True)
        }
        self._watchdog = self.settings.watchdog_period or codec.watchdog_timeout
        self._valve_id = codec.frame_id(ValveCommand, number)
        self._own_ids = {self._valve_id, codec.frame_id(BoardCommand, number)}
        self._started = now
        self._last_counted = now
        self._counter: int | None = None
        self._armed = False
        self._fractions = (0.0, 0.0)
        self._enabled = (False, False)
        self._crc_errors: list[float] = []
        self._over_pressure = False
        self._sensor_lost = False
        self._outputs = (False, False)
        self.emergency_stop = SafetyInput.NOT_AVAILABLE
        self.enabling_switch = SafetyInput.NOT_AVAILABLE
        self._samples = 0
        self._counter_step = 1
        self._loose = False
        self._told: object = None
        self._grid = now
        self._turns: dict[type[BoardMessage], int] = {Measurement: 0, Status: 0, Heartbeat: 0}
        self._periods = {
            Measurement: 1.0 / self.settings.measurement_rate,
            Status: 1.0 / self.settings.status_rate,
            Heartbeat: 1.0 / self.settings.heartbeat_rate,
        }

    @property
    def active(self) -> bool:
        """Whether its valves follow set points."""
        return self.state is BoardState.ACTIVE

    @property
    def brake_released(self) -> bool:
        """Whether the output of the brake has current."""
        return self.active and self._outputs[0]

    @property
    def dump_closed(self) -> bool:
        """Whether the output of the dump valve has current."""
        return self.active and self._outputs[1]

    @property
    def fault_names(self) -> tuple[str, ...]:
        """The names of its latched faults."""
        return tuple(str(fault.name) for fault in self.faults)

    @property
    def valve_commands(self) -> tuple[float, ...]:
        """The valves' commands: spool -1..1 or gauge pressure [Pa]; vented unless active."""
        active = self.state is BoardState.ACTIVE
        return tuple(
            valve.command(self._fractions[channel])
            if active and self._enabled[channel]
            else valve.vented
            for valve, channel in zip(self.valves, self._channels, strict=True)
        )

    def restarted(self, now: float) -> SimulatedBoard:
        """The board after a power-up at `now` [s]."""
        board = SimulatedPamBoard(
            self.number,
            self._codec,
            self.settings,
            self.valves,
            self._channels,
            now,
            self._sensors,
        )
        board.emergency_stop, board.enabling_switch = self.emergency_stop, self.enabling_switch
        return board

    def misbehave(self, fault: str, value: float) -> None:
        """Let the counter jump or freeze, as faulty firmware would, or act as a person does.

        After "not_available_between", a second device sends under the identifier of this board that
        it has no measurement, each time after this one.

        A person presses the emergency stop or releases the enabling switch with the value 0, and
        permits motion with 1.
        """
        if fault == "counter_jump":
            self._samples = (self._samples + round(value)) & 0xFF
        elif fault == "counter_frozen":
            self._counter_step = 0
        elif fault == "not_available_between":
            self._loose = True
        elif fault == "emergency_stop":
            self.emergency_stop = SafetyInput(round(value))
        elif fault == "enabling_switch":
            self.enabling_switch = SafetyInput(round(value))
        elif fault == "mended":
            self._counter_step, self._loose = 1, False

    def on_frame(self, frame_id: int, data: bytes, now: float) -> None:
        """Receive a frame from the bus; a frame for another board is ignored."""
        if frame_id not in self._own_ids:
            return
        try:
            _, message = self._codec.decode(frame_id, data)
        except FrameError as error:
            self.rejected_frames = (self.rejected_frames + 1) & 0xFFFF
            if isinstance(error, FrameCrcError):
                self._count_crc_error(now)
            return
        if isinstance(message, ValveCommand):
            self._take_valve_command(message, now)
        elif isinstance(message, BoardCommand):
            self._take_board_command(message)

    def poll(
        self,
        now: float,
        pressures: Sequence[float],
        angles: Sequence[float],
        supply_pressure: float,
    ) -> list[Frame]:
        """Check the sensors and the time; return the frames that are due.

        Parameters
        ----------
        now : float
            Time [s], which never decreases.
        pressures : sequence of float
            Readings of the pressure sensors [Pa gauge]; NaN for a defective one.
        angles : sequence of float
            Reading of the encoder [rad], empty without encoder; NaN for a defective one.
        supply_pressure : float
            [Pa absolute].
        """
        position = angles[0] if angles else 0.0
        self._check(now, pressures, position)
        messages: list[BoardMessage] = []
        if self._is_due(Measurement, now):
            self._samples = (self._samples + self._counter_step) & 0xFF
            shown = [0.0] * CHANNELS
            for channel, pressure in zip(self._sensors, pressures, strict=True):
                shown[channel] = _within(pressure, PRESSURE_RANGE)
            angle = _within(position, POSITION_RANGE)
            messages.append(Measurement((shown[0], shown[1]), angle, self._samples))
            if self._loose:
                messages.append(Measurement((math.nan, math.nan), math.nan, self._samples))
        news = (self.state, self.faults, self.emergency_stop, self.enabling_switch)
        if self._is_due(Status, now) or news != self._told:
            self._told = news
            supply = _within(supply_pressure, SUPPLY_RANGE)
            counter = self._counter or 0
            messages.append(
                Status(
                    self.state,
                    self.faults,
                    counter,
                    supply,
                    self.rejected_frames,
                    self.emergency_stop,
                    self.enabling_switch,
                    self.brake_released,
                    self.dump_closed,
                )
            )
        if self._is_due(Heartbeat, now):
            messages.append(Heartbeat(now - self._started, PROTOCOL_VERSION, FIRMWARE_VERSION))
        return [self._codec.encode(self.number, message) for message in messages]

    def _is_due(self, kind: type[BoardMessage], now: float) -> bool:
        # The periods are counted and not summed up: after an hour, the rounding errors of a sum
        # would shift the grid so far that a turn is lost.
        period = self._periods[kind]
        due = self._grid + self._turns[kind] * period
        if now < due - 1e-9:
            return False
        # A late caller gets one frame and not a burst; the grid does not change. A caller whose
        # clock is early by a rounding error must not get the same frame again in its next turn.
        self._turns[kind] += math.floor(max(now - due, 0.0) / period + 1e-9) + 1
        return True

    def _take_valve_command(self, command: ValveCommand, now: float) -> None:
        if command.counter == self._counter:
            return
        self._counter = command.counter
        self._last_counted = now
        self._fractions, self._enabled = command.valves, command.enable
        self._outputs = (command.release_brake, command.close_dump)
        if not any(command.enable):
            self._armed = True
            if self.state is BoardState.ACTIVE:
                self.state = BoardState.VENTED
        elif self.state is BoardState.VENTED and self._armed and self._is_enabled:
            self.state = BoardState.ACTIVE
            self._crc_errors.clear()

    def _take_board_command(self, command: BoardCommand) -> None:
        if command.code is BoardCode.VENT:
            if self.state is BoardState.ACTIVE:
                self._disarm(BoardState.VENTED)
            self._armed = False
        elif (
            command.code is BoardCode.CLEAR_FAULTS
            and self.state is BoardState.FAULT
            and not self._over_pressure
            and not self._sensor_lost
            and self.emergency_stop is not SafetyInput.STOP
        ):
            self.faults = BoardFault(0)
            self._disarm(BoardState.VENTED)
        elif command.code is BoardCode.LATCH_FAULT:
            if self.state is BoardState.BOOT:
                self.faults |= BoardFault.HOST
            else:
                self._fail(BoardFault.HOST)

    def _count_crc_error(self, now: float) -> None:
        if self.state is not BoardState.ACTIVE:
            return
        self._crc_errors = [t for t in self._crc_errors if t > now - CRC_WINDOW] + [now]
        if len(self._crc_errors) >= CRC_LIMIT:
            self._fail(BoardFault.CRC)

    def _check(self, now: float, pressures: Sequence[float], position: float) -> None:
        if self.state is BoardState.BOOT:
            if now - self._started < self.settings.boot_time:
                return
            # a host may send its fault before the self test has passed
            self.state = BoardState.FAULT if self.faults else BoardState.VENTED
        if self.state is BoardState.ACTIVE and now - self._last_counted > self._watchdog:
            self._fail(BoardFault.WATCHDOG)
        self._over_pressure = any(
            pressure > self._limits.get(channel, math.inf)
            for channel, pressure in zip(self._sensors, pressures, strict=True)
        )
        self._sensor_lost = any(math.isnan(value) for value in (*pressures, position))
        if self._over_pressure:
            self._fail(BoardFault.OVER_PRESSURE)
        if self._sensor_lost:
            self._fail(BoardFault.SENSOR)
        if self.emergency_stop is SafetyInput.STOP:
            self._fail(BoardFault.EMERGENCY_STOP)
        if not self._is_enabled and self.state is BoardState.ACTIVE:
            self._disarm(BoardState.VENTED)

    @property
    def _is_enabled(self) -> bool:
        """Whether the enabling switch permits motion, or there is none."""
        return self.enabling_switch is not SafetyInput.STOP

    def _fail(self, fault: BoardFault) -> None:
        self.faults |= fault
        self._disarm(BoardState.FAULT)

    def _disarm(self, state: BoardState) -> None:
        self.state = state
        self._armed = False
        self._enabled = (False, False)


class PamBoardTwins:
    """Makes the twins of the kind `pam_board`.

    Parameters
    ----------
    options : mapping of str to str
        Those of the kind, and `firmware`: the host build of the firmware, which then runs in a
        process of its own in place of the simulated board.
    """

    def __init__(self, options: KindOptions) -> None:
        self._kind = PamBoardKind(options)
        self._firmware = options.get("firmware", "")

    def make(self, wired: WiredBoard, settings: BoardSettings, now: float) -> SimulatedBoard:
        """The twin of one board, powered up at `now` [s]."""
        number, codec = number_of(wired), self._kind.codec_of(wired)
        shares = wired.settings.get("identifiers") == WITH_CANOPEN
        valves = [BoardValve.of(wire.muscle) for wire in wired.valves]
        channels = [int(wire.channel) for wire in wired.valves]
        sensors = [int(wire.channel) for wire in wired.pressures]
        if self._firmware:
            program = Path(self._firmware)
            return FirmwareBoard(program, number, settings, valves, channels, sensors, now, shares)
        return SimulatedPamBoard(number, codec, settings, valves, channels, now, sensors)


def _within(value: float, bounds: tuple[float, float]) -> float:
    """The value limited to a converter's range; NaN remains, for "not available"."""
    return value if math.isnan(value) else min(max(value, bounds[0]), bounds[1])
