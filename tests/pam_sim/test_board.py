"""The simulated board keeps the rules of docs/can_protocol.md."""

from __future__ import annotations

import itertools
import math

import pytest

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
from pam_model.errors import PamError
from pam_sim.boards.pam_board_twin import SimulatedPamBoard
from pam_sim.boards.protocol import BoardSettings, BoardValve

VENTED = (-1.0, -1.0)


class Bench:
    """A board on a bench: a clock, a counter and a list of what it said."""

    def __init__(self, settings=None, number=3, **keys):
        self.codec = BoardCodec.from_dbc()
        self.board = SimulatedPamBoard(number, self.codec, settings, **keys)
        self.now, self.counter, self.heard = 0.0, 0, []
        self.pressures, self.position = (1e5, 1e5), 0.25
        self.wait(0.1)

    def wait(self, duration, feed=None):
        for _ in range(round(duration / 0.001)):
            self.now += 0.001
            if feed is not None:
                self.command(*feed)
            for frame in self.board.poll(self.now, self.pressures, (self.position,), 7e5):
                self.heard.append((self.now, *self.codec.decode(*frame)))

    def command(self, valves=(0.0, 0.0), enable=(True, True), counter=None):
        self.counter = (self.counter + 1) & 0xFF if counter is None else counter
        frame = self.codec.encode(self.board.number, ValveCommand(valves, enable, self.counter))
        self.board.on_frame(*frame, self.now)

    def tell(self, code):
        self.board.on_frame(*self.codec.encode(self.board.number, BoardCommand(code)), self.now)

    def arm(self, valves=(0.5, -0.25)):
        self.command(enable=(False, False))
        self.command(valves)
        assert self.board.state is BoardState.ACTIVE

    def last(self, kind):
        return [message for _, _, message in self.heard if isinstance(message, kind)][-1]


def test_arms_only_after_a_command_without_enables():
    bench = Bench()
    assert bench.board.state is BoardState.VENTED
    bench.command((0.5, 0.5))
    assert bench.board.state is BoardState.VENTED
    assert bench.board.valve_commands == VENTED
    bench.arm()
    assert bench.board.valve_commands == pytest.approx((0.5, -0.25), abs=1e-4)


def test_nothing_moves_while_booting():
    bench = Bench(BoardSettings(boot_time=1.0))
    assert bench.board.state is BoardState.BOOT
    bench.command(enable=(False, False))
    bench.command((1.0, 1.0))
    assert bench.board.valve_commands == VENTED
    assert bench.last(Status).state is BoardState.BOOT
    assert bench.last(Heartbeat).uptime > 0.0


@pytest.mark.parametrize("period", [0.02, 0.1])
def test_watchdog_vents_and_latches(period):
    bench = Bench(BoardSettings(watchdog_period=period))
    bench.arm()
    bench.wait(1.5 * period, feed=((0.5, 0.0),))
    assert bench.board.state is BoardState.ACTIVE
    bench.wait(period - 0.002)
    assert bench.board.state is BoardState.ACTIVE
    bench.wait(0.004)
    assert bench.board.state is BoardState.FAULT
    assert bench.board.faults == BoardFault.WATCHDOG
    assert bench.board.valve_commands == VENTED
    # Commands alone do not bring it back, nor does the sequence that arms.
    bench.wait(0.05, feed=((0.5, 0.0), (False, False)))
    bench.wait(0.05, feed=((0.5, 0.0),))
    assert bench.board.state is BoardState.FAULT
    assert bench.last(Status).faults == BoardFault.WATCHDOG
    bench.tell(BoardCode.CLEAR_FAULTS)
    bench.wait(0.05, feed=((0.5, 0.0),))
    assert bench.board.state is BoardState.VENTED
    bench.arm()


def test_default_watchdog_is_the_databases():
    bench = Bench()
    bench.arm()
    bench.wait(bench.codec.watchdog_timeout - 0.002)
    assert bench.board.state is BoardState.ACTIVE
    bench.wait(0.004)
    assert bench.board.state is BoardState.FAULT


def test_a_repeated_counter_does_not_feed_the_watchdog():
    bench = Bench(BoardSettings(watchdog_period=0.02))
    bench.arm()
    bench.wait(0.03, feed=((0.9, 0.9), (True, True), bench.counter))
    assert bench.board.state is BoardState.FAULT
    assert bench.board.rejected_frames == 0


def test_bad_frames_are_counted_and_change_nothing():
    bench = Bench()
    bench.arm()
    before = bench.board.valve_commands
    frame_id, data = bench.codec.encode(3, ValveCommand((1.0, 1.0), (True, True), 77))
    bench.board.on_frame(frame_id, data[:-1] + bytes([data[-1] ^ 1]), bench.now)
    bench.board.on_frame(frame_id, data[:5], bench.now)
    bench.board.on_frame(frame_id, bytes(8), bench.now)
    assert bench.board.rejected_frames == 3
    assert bench.board.valve_commands == before
    other = bench.codec.encode(4, ValveCommand((1.0, 1.0), (True, True), 78))
    bench.board.on_frame(*other, bench.now)
    bench.board.on_frame(0x7FF, b"", bench.now)
    assert bench.board.rejected_frames == 3
    assert bench.board.valve_commands == before


def test_a_command_that_is_not_available_is_rejected():
    bench = Bench()
    bench.arm()
    before = bench.board.valve_commands
    raw = {"Valve0": -32768, "Enable0": 1, "Enable1": 1, "Counter": 99}
    bench.board.on_frame(*bench.codec.raw_frame(3, ValveCommand, raw), bench.now)
    assert bench.board.rejected_frames == 1
    assert bench.board.valve_commands == before


def test_a_storm_of_bad_checksums_is_a_fault():
    bench = Bench()
    bench.arm()
    frame_id, data = bench.codec.encode(3, ValveCommand((1.0, 1.0), (True, True), 77))
    for _ in range(9):
        bench.board.on_frame(frame_id, data[:-1] + bytes([data[-1] ^ 1]), bench.now)
    assert bench.board.state is BoardState.ACTIVE
    bench.board.on_frame(frame_id, data[:-1] + bytes([data[-1] ^ 1]), bench.now)
    assert bench.board.faults == BoardFault.CRC
    assert bench.board.valve_commands == VENTED


def test_a_clear_enable_vents_its_channel():
    bench = Bench()
    bench.arm()
    bench.command((0.5, 0.5), (True, False))
    assert bench.board.valve_commands == pytest.approx((0.5, -1.0), abs=1e-4)
    bench.command((0.5, 0.5), (False, False))
    assert bench.board.state is BoardState.VENTED
    assert bench.board.valve_commands == VENTED
    bench.command((0.5, 0.5))
    assert bench.board.state is BoardState.ACTIVE


def test_vent_command_needs_arming_again():
    bench = Bench()
    bench.arm()
    bench.tell(BoardCode.VENT)
    assert bench.board.state is BoardState.VENTED
    bench.wait(0.05, feed=((0.5, 0.5),))
    assert bench.board.state is BoardState.VENTED
    bench.arm()


def test_over_pressure_latches_until_it_is_gone():
    bench = Bench(valves=(BoardValve(max_pressure=6e5), BoardValve(max_pressure=6e5)))
    bench.arm()
    bench.pressures = (1e5, 6.1e5)
    bench.wait(0.002)
    assert bench.board.faults == BoardFault.OVER_PRESSURE
    bench.tell(BoardCode.CLEAR_FAULTS)
    bench.wait(0.002)
    assert bench.board.state is BoardState.FAULT
    bench.pressures = (1e5, 5e5)
    bench.wait(0.002)
    assert bench.board.state is BoardState.FAULT
    bench.tell(BoardCode.CLEAR_FAULTS)
    assert bench.board.state is BoardState.VENTED


@pytest.mark.parametrize("armed", [True, False])
def test_a_fault_of_the_host_is_kept_until_faults_are_cleared(armed):
    bench = Bench()
    if armed:
        bench.arm()
    bench.tell(BoardCode.LATCH_FAULT)
    assert bench.board.valve_commands == VENTED
    for code in (BoardCode.VENT, BoardCode.LATCH_FAULT):
        bench.tell(code)
        bench.wait(0.05, feed=((0.5, 0.0), (False, False)))
        bench.wait(0.05, feed=((0.5, 0.0),))
        assert bench.last(Status).state is BoardState.FAULT
        assert bench.last(Status).faults == BoardFault.HOST
    bench.tell(BoardCode.CLEAR_FAULTS)
    assert bench.board.faults == 0
    bench.wait(0.05, feed=((0.5, 0.0),))
    assert bench.board.state is BoardState.VENTED
    bench.arm()


def test_a_fault_of_the_host_during_boot_follows_the_self_test():
    bench = Bench(BoardSettings(boot_time=0.2))
    bench.tell(BoardCode.LATCH_FAULT)
    bench.wait(0.05)
    assert bench.last(Status).state is BoardState.BOOT
    assert bench.last(Status).faults == BoardFault.HOST
    bench.wait(0.1)
    assert bench.board.state is BoardState.FAULT


def test_a_lost_sensor_is_told_and_vents():
    bench = Bench()
    bench.arm()
    bench.pressures = (math.nan, 1e5)
    bench.wait(0.01)
    assert bench.board.faults == BoardFault.SENSOR
    assert math.isnan(bench.last(Measurement).pressures[0])
    assert bench.board.valve_commands == VENTED


def test_rates_counters_and_news_at_once():
    bench = Bench()
    bench.heard.clear()
    bench.wait(1.0)
    counts = {
        kind: sum(isinstance(message, kind) for _, _, message in bench.heard)
        for kind in (Measurement, Status, Heartbeat)
    }
    assert counts == {Measurement: 500, Status: 50, Heartbeat: 10}
    counters = [m.counter for _, _, m in bench.heard if isinstance(m, Measurement)]
    assert all((b - a) % 256 == 1 for a, b in itertools.pairwise(counters))
    bench.command(enable=(False, False))
    bench.command()
    at = bench.now
    bench.wait(0.001)
    when, _, status = bench.heard[-1]
    assert isinstance(status, Status)
    assert status.state is BoardState.ACTIVE
    assert status.command_counter == bench.counter
    assert when - at < 0.0015


def test_a_late_caller_gets_no_burst():
    bench = Bench()
    frames = bench.board.poll(bench.now + 0.5, (1e5, 1e5), (0.0,), 7e5)
    assert len(frames) == 3


def test_regulator_full_scale_and_vent():
    valves = (BoardValve(True, 6e5), BoardValve(True, 4e5))
    bench = Bench(valves=valves)
    assert bench.board.valve_commands == (0.0, 0.0)
    bench.arm((0.5, -0.5))
    assert bench.board.valve_commands == pytest.approx((3e5, 0.0), rel=1e-4)


def test_readings_beyond_the_converters_saturate():
    bench = Bench()
    bench.pressures, bench.position = (5e6, -5e6), 100.0
    bench.wait(0.01)
    assert bench.last(Measurement).pressures == pytest.approx((1.2e6, -1e5))


@pytest.mark.parametrize(
    "settings",
    [{"measurement_rate": 0.0}, {"status_rate": -1.0}, {"watchdog_period": 0.0}],
)
def test_bad_settings_are_named(settings):
    with pytest.raises(PamError, match=next(iter(settings))):
        BoardSettings(**settings)


def test_every_turn_has_its_measurement_however_long_it_runs():
    """Sums of periods drift by rounding, after an hour far enough to miss a turn."""
    codec, start = BoardCodec.from_dbc(), 2.0e6
    board = SimulatedPamBoard(3, codec, BoardSettings(measurement_rate=500.0), now=start)
    for turn in range(20_000):
        frames = board.poll(start + turn * 0.002, (1e5, 1e5), (0.25,), 7e5)
        told = [codec.decode(*frame)[-1] for frame in frames]
        assert sum(isinstance(one, Measurement) for one in told) == 1, turn
