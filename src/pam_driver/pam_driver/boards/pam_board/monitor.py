"""The latest messages of one valve board, their age, and what is wrong with the board."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from pam_driver.boards.availability import Availability
from pam_driver.boards.pam_board.codec import (
    CHANNELS,
    PROTOCOL_VERSION,
    BoardState,
    Heartbeat,
    Measurement,
    SafetyInput,
    Status,
)
from pam_driver.boards.power_on_time import has_restarted
from pam_driver.boards.protocol import (
    EMERGENCY_STOP,
    ENABLING_SWITCH,
    NEVER,
    Channel,
    Condition,
    Sample,
)
from pam_driver.boards.samples import ANGLE_INPUT, PRESSURE_INPUT

# A counter that is behind by less means frames out of order; otherwise the counter was reset.
_REORDER_WINDOW: Final = 16
_LONGEST_UPTIME: Final = 2**32 * 1e-3  # s, 32 bits of milliseconds
# Two boards report their uptimes in turns: it gains on the time of this host [s], or it falls and
# is yet longer than the time since the last heartbeat [s], which no restart explains. That is
# remembered for a while.
_GAINED: Final = 2.0
_LONGER: Final = 1.0
_NUMBER_MEMORY: Final = 1.0


class BoardMonitor:
    """Keeps the latest messages of one board and judges them.

    Attributes
    ----------
    pressures, angles : dict of int to Sample
        By channel the last available value [Pa gauge], [rad].
    availability : Availability
        How often a measurement has not the one or the other.
    inputs : dict of str to Sample
        The inputs for people that the board has, see `boards.protocol.Board.inputs`.
    status, heartbeat : message or None
        The last received message.
    frames_lost, frames_repeated, frames_reordered, restarts : int
        Counted from the measurement counter and the uptime.
    """

    def __init__(self, number: int) -> None:
        self.number = number
        self.name = f"board {number}"
        self.pressures: dict[Channel, Sample] = {channel: Sample() for channel in range(CHANNELS)}
        self.angles: dict[Channel, Sample] = {0: Sample()}
        self.inputs: dict[str, Sample] = {}
        self.availability = Availability()
        self.status: Status | None = None
        self.heartbeat: Heartbeat | None = None
        self.frames_lost = 0
        self.frames_repeated = 0
        self.frames_reordered = 0
        self.restarts = 0
        self._counter: int | None = None
        self._reordered_in_a_row = 0
        self._repeated_in_a_row = 0
        self._measured_at = NEVER
        self._status_at = NEVER
        self._heartbeat_at = NEVER
        self._echo_at = NEVER
        self._two_boards_at = NEVER
        self._restarted = False

    @property
    def position(self) -> Sample:
        """The angle of the only encoder [rad]."""
        return self.angles[0]

    def hear_measurement(self, message: Measurement, time: float, stamp: float) -> None:
        """Store a measurement unless it is a repetition or older than the last."""
        hear = self.availability.hear
        for channel, pressure in enumerate(message.pressures):
            hear(PRESSURE_INPUT, channel, not math.isnan(pressure), time)
        hear(ANGLE_INPUT, 0, not math.isnan(message.position), time)
        if self._counter is not None:
            step = (message.counter - self._counter) & 0xFF
            if step == 0:
                self.frames_repeated += 1
                self._repeated_in_a_row += 1
                return
            if step > 256 - _REORDER_WINDOW and self._reordered_in_a_row < _REORDER_WINDOW:
                self.frames_reordered += 1
                self._reordered_in_a_row += 1
                return
            self.frames_lost += step - 1
        self._counter = message.counter
        self._reordered_in_a_row = self._repeated_in_a_row = 0
        self._measured_at = time
        for channel, pressure in enumerate(message.pressures):
            if not math.isnan(pressure):
                self.pressures[channel] = Sample(pressure, time, stamp)
        if not math.isnan(message.position):
            self.angles[0] = Sample(message.position, time, stamp)

    def hear_status(self, message: Status, time: float) -> None:
        """Store a status."""
        if self.status is None or message.command_counter != self.status.command_counter:
            self._echo_at = time
        self.status = message
        self._status_at = time
        for name, state in (
            (EMERGENCY_STOP, message.emergency_stop),
            (ENABLING_SWITCH, message.enabling_switch),
        ):
            if state is not SafetyInput.NOT_AVAILABLE:
                self.inputs[name] = Sample(float(state is SafetyInput.PERMIT), time)
            elif name in self.inputs:  # what it permitted before must not hold for ever
                self.inputs[name] = Sample(math.nan, time)

    def hear_heartbeat(self, message: Heartbeat, time: float) -> None:
        """Store a heartbeat; a smaller uptime than before means a restart."""
        if self.heartbeat is not None:
            before, elapsed = self.heartbeat.uptime, time - self._heartbeat_at
            restarted = has_restarted(before, message.uptime, 0.0, _LONGEST_UPTIME)
            other = elapsed + _LONGER if restarted else before + elapsed + _GAINED
            if message.uptime > other:
                self._two_boards_at = time
            if restarted:
                self.restarts += 1
                self._restarted = True
                self._counter = None
        self.heartbeat = message
        self._heartbeat_at = time

    def acknowledge(self) -> None:
        """Discard a restart that was reported."""
        self._restarted = False

    def silent(self, now: float, timeout: float) -> list[str]:
        """The kinds of frame that are missing."""
        times = (
            ("measurement", self._measured_at),
            ("status", self._status_at),
            ("heartbeat", self._heartbeat_at),
        )
        return [kind for kind, time in times if now - time > timeout]

    def conditions(
        self, now: float, timeout: float, sensor_timeout: float, moving: bool
    ) -> Iterator[Condition]:
        """What is wrong with the board.

        Parameters
        ----------
        now : float
            Monotonic time [s].
        timeout : float
            A frame older than this is missing [s].
        sensor_timeout : float
            A counter that does not change for longer is frozen [s].
        moving : bool
            Whether the board has been commanded to let air move for at least `timeout`.
        """
        silent = self.silent(now, timeout)
        if silent:
            text = f"no {', no '.join(silent)} for {timeout:g} s"
            yield Condition("board_lost", self.name, text)
        if self._repeated_in_a_row > 1 and now - self._measured_at > sensor_timeout:
            text = f"measurement counter has not changed for {sensor_timeout:g} s"
            yield Condition("counter_frozen", self.name, text)
        if now - self._two_boards_at <= _NUMBER_MEMORY:
            text = "reports two times since power-up in turns: two boards have this number"
            yield Condition("board_number", self.name, text)
        elif self._restarted:
            yield Condition("board_restarted", self.name, "has restarted")
        if self.heartbeat and self.heartbeat.protocol_version != PROTOCOL_VERSION:
            version = self.heartbeat.protocol_version
            text = f"uses protocol version {version}, expected {PROTOCOL_VERSION}"
            yield Condition("protocol_version", self.name, text)
        status = self.status
        if status is None:
            return
        if status.state is BoardState.FAULT or status.faults:
            names = ", ".join(str(fault.name).lower() for fault in status.faults) or "unnamed"
            yield Condition("board_fault", self.name, f"fault: {names}")
        elif moving and status.state is not BoardState.ACTIVE:
            text = f"is {status.state.name.lower()} although it was commanded to be active"
            yield Condition("board_not_active", self.name, text)
        elif moving and now - self._echo_at > timeout:
            text = f"has accepted no command for {timeout:g} s"
            yield Condition("command_not_heard", self.name, text)
