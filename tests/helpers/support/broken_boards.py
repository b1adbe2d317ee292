"""Valve boards whose firmware breaks one rule each, and a bus on a virtual clock to test them."""

from __future__ import annotations

from collections.abc import Sequence

from pam_driver.board_rules.air_rules import RESTART
from pam_driver.board_rules.line import HeardFrame
from pam_driver.board_rules.people_rules import HOLD_SWITCH, PRESS_STOP, RELEASE_STOP
from pam_driver.boards.pam_board.codec import (
    BoardCode,
    BoardCodec,
    BoardCommand,
    BoardFault,
    BoardState,
    FrameError,
    Heartbeat,
    Measurement,
    SafetyInput,
    ValveCommand,
)
from pam_driver.boards.protocol import Frame
from pam_model.rig import load_rig
from pam_sim.boards.pam_board_twin import SimulatedPamBoard
from pam_sim.boards.protocol import BoardValve
from pam_sim.boards.sensors import SensorQuality
from pam_sim.simulated_rig import SimulatedRig
from support.rigs import ELBOW

CODEC = BoardCodec.from_dbc()


class GoodBoard(SimulatedPamBoard):
    """The simulated board itself, with a limit that the supply can reach."""

    def __init__(self, now: float = 0.0) -> None:
        valves = (BoardValve(max_pressure=2e5), BoardValve(max_pressure=2e5))
        super().__init__(0, CODEC, valves=valves, now=now)
        self.emergency_stop = self.enabling_switch = SafetyInput.PERMIT

    def restarted(self, now: float) -> SimulatedPamBoard:
        return type(self)(now)


class WatchdogNotLatched(GoodBoard):
    def _fail(self, fault: BoardFault) -> None:
        if fault is BoardFault.WATCHDOG:
            self._disarm(BoardState.VENTED)
        else:
            super()._fail(fault)


class WatchdogLate(GoodBoard):
    def __init__(self, now: float = 0.0) -> None:
        super().__init__(now)
        self._watchdog = 0.15


class WatchdogEarly(GoodBoard):
    def __init__(self, now: float = 0.0) -> None:
        super().__init__(now)
        self._watchdog = 0.05


class ArmsOnStaleQueue(GoodBoard):
    def _take_valve_command(self, command: ValveCommand, now: float) -> None:
        self._armed = True
        super()._take_valve_command(command, now)


class VentKeepsItArmed(GoodBoard):
    def _take_board_command(self, command: BoardCommand) -> None:
        armed = self._armed and self.state is BoardState.VENTED
        super()._take_board_command(command)
        self._armed = armed


class IgnoresOneEnableBit(GoodBoard):
    def _take_valve_command(self, command: ValveCommand, now: float) -> None:
        super()._take_valve_command(command, now)
        self._enabled = (command.enable[0], any(command.enable))


class AcceptsWrongChecksum(GoodBoard):
    def on_frame(self, frame_id: int, data: bytes, now: float) -> None:
        if frame_id == self._valve_id and len(data) == 8:
            word = int.from_bytes(data, "little")
            signals = {"Valve0": 0, "Valve1": 0, "Enable0": word >> 40, "Enable1": word >> 41}
            signals = {name: value & 1 for name, value in signals.items()}
            raw = {"Valve0": word & 0xFFFF, "Valve1": word >> 16 & 0xFFFF}
            signals |= {**raw, "Counter": word >> 32 & 0xFF}
            data = CODEC.raw_frame(0, ValveCommand, signals)[1]
        super().on_frame(frame_id, data, now)


class AcceptsRepeatedCounter(GoodBoard):
    def _take_valve_command(self, command: ValveCommand, now: float) -> None:
        self._counter = None
        super()._take_valve_command(command, now)


class CountsRepeatedCounter(GoodBoard):
    def _take_valve_command(self, command: ValveCommand, now: float) -> None:
        self.rejected_frames += command.counter == self._counter
        super()._take_valve_command(command, now)


class VentClearsFaults(GoodBoard):
    def _take_board_command(self, command: BoardCommand) -> None:
        super()._take_board_command(command)
        if command.code is BoardCode.VENT and self.state is BoardState.FAULT:
            super()._take_board_command(BoardCommand(BoardCode.CLEAR_FAULTS))


class ClearActsInEveryState(GoodBoard):
    def _take_board_command(self, command: BoardCommand) -> None:
        super()._take_board_command(command)
        if command.code is BoardCode.CLEAR_FAULTS:
            self._disarm(BoardState.VENTED)


class StaysArmedOverRestart(GoodBoard):
    def restarted(self, now: float) -> SimulatedPamBoard:
        new = type(self)(now)
        new.state, new._armed = self.state, True
        return new


class CounterFrozen(GoodBoard):
    def __init__(self, now: float = 0.0) -> None:
        super().__init__(now)
        self._counter_step = 0


class NoHeartbeat(GoodBoard):
    def _is_due(self, kind: type, now: float) -> bool:
        return super()._is_due(kind, now) and kind is not Heartbeat


class WrongScale(GoodBoard):
    """Steps of 10 Pa."""

    def poll(
        self, now: float, pressures: Sequence[float], angles: Sequence[float], supply: float
    ) -> list[Frame]:
        frames = super().poll(now, pressures, angles, supply)
        told = []
        for frame in frames:
            sent = frame
            _, message = CODEC.decode(*frame)
            if isinstance(message, Measurement):
                first, second = (2.0 * (pressure + 1e5) - 1e5 for pressure in message.pressures)
                sent = CODEC.encode(0, message._replace(pressures=(first, second)))
            told.append(sent)
        return told


class SlowMeasurements(GoodBoard):
    def __init__(self, now: float = 0.0) -> None:
        super().__init__(now)
        self._periods[Measurement] = 0.004


class ChannelsExchanged(GoodBoard):
    @property
    def valve_commands(self) -> tuple[float, ...]:
        return super().valve_commands[::-1]


class IgnoresLatchFault(GoodBoard):
    def _take_board_command(self, command: BoardCommand) -> None:
        if command.code is not BoardCode.LATCH_FAULT:
            super()._take_board_command(command)


class CountsNothing(GoodBoard):
    """Refuses wrong frames without counting them."""

    def on_frame(self, frame_id: int, data: bytes, now: float) -> None:
        try:
            CODEC.decode(frame_id, data)
        except FrameError:
            return
        super().on_frame(frame_id, data, now)


class EmergencyStopOnlyTold(GoodBoard):
    """Leaves the emergency stop to the host."""

    def _fail(self, fault: BoardFault) -> None:
        if fault is not BoardFault.EMERGENCY_STOP:
            super()._fail(fault)


class EnablingSwitchOnlyTold(GoodBoard):
    @property
    def _is_enabled(self) -> bool:
        return True


class BrakeReleasedByItsBit(GoodBoard):
    """Whatever the state is."""

    @property
    def brake_released(self) -> bool:
        return self._outputs[0]


class NoOverPressure(GoodBoard):
    def _check(self, now: float, pressures: Sequence[float], position: float) -> None:
        super()._check(now, [0.0 for _ in pressures], position)


class VirtualLine:
    """A simulated elbow with one board, on a clock that only the test moves."""

    STEP = 0.001

    def __init__(self, board: SimulatedPamBoard) -> None:
        self.sim = SimulatedRig(load_rig(ELBOW), quality=SensorQuality(0.0, 0.0, 0.0, 0.0))
        self.sim._boards[0] = board
        self._now = 0.0

    def now(self) -> float:
        return self._now

    def send(self, frame_id: int, data: bytes) -> bool:
        self.sim.on_frame(frame_id, data, self._now)
        return True

    def receive(self, until: float) -> list[HeardFrame]:
        heard = []
        while self._now < until - 1e-9:
            self._now = round((self._now + self.STEP) / self.STEP) * self.STEP
            heard += [HeardFrame(self._now, *frame) for frame in self.sim.advance(self._now)]
        return heard

    def person(self, text: str) -> bool:
        """What a person does who is asked by the test."""
        board = self.sim.boards[0]
        if text == RESTART:
            self.sim.restart_board(0, self._now)
        else:
            stop = text in {PRESS_STOP, RELEASE_STOP}
            permits = text in {RELEASE_STOP, HOLD_SWITCH}
            board.misbehave("emergency_stop" if stop else "enabling_switch", float(permits))
        return True
