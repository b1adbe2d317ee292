"""Every fault vents in its time and stays latched, step by step on a bus inside this process."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from pam_driver.boards.pam_board.codec import (
    BoardFault,
    BoardState,
    Heartbeat,
    Measurement,
    Status,
    ValveCommand,
)
from pam_driver.can_bus.bus import BusState, CanPort, SendOutcome
from pam_driver.driver import ActivationError
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand
from pam_driver.snapshot import Snapshot
from support.commands import offer

from .driver_bench import NAMES, PERIOD, SETTINGS, Bench


def stop_board(bench: Bench) -> None:
    bench.board.silent = {Measurement, Status, Heartbeat}


def stop_heartbeat(bench: Bench) -> None:
    bench.board.silent = {Heartbeat}


def stop_measurement(bench: Bench) -> None:
    bench.board.silent = {Measurement}


def freeze_counter(bench: Bench) -> None:
    bench.board.counter_frozen = True


def lose_sensor(bench: Bench) -> None:
    bench.board.pressures[1] = math.nan


def lose_encoder(bench: Bench) -> None:
    bench.board.position = math.nan


def burst(bench: Bench) -> None:
    bench.board.pressures[0] = 610_000.0


def board_fault(bench: Bench) -> None:
    bench.board.state = BoardState.FAULT
    bench.board.faults = BoardFault.VALVE


def board_vents(bench: Bench) -> None:
    bench.board.state = BoardState.VENTED
    bench.board.armed = False


def restart(bench: Bench) -> None:
    bench.board.uptime = 0.0


def deafen(bench: Bench) -> None:
    # a board whose receiver hangs, with a watchdog that hangs as well
    bench.board.deaf = True
    bench.board.heard_at = math.inf


def other_protocol(bench: Bench) -> None:
    bench.board.protocol_version = 99


def bus_off(bench: Bench) -> None:
    bench.port._controller = BusState.BUS_OFF
    stop_board(bench)


def second_driver(bench: Bench) -> None:
    command = ValveCommand((0.0, 0.0), (False, False), 3)
    bench.board_port.send(*bench.codec.encode(0, command), bench.now)


CYCLE = 2 * PERIOD


FAULTS: dict[str, tuple[Callable[[Bench], None], set[str], float]] = {
    "board lost": (stop_board, {"stale_sensor"}, SETTINGS.sensor_timeout + CYCLE),
    "heartbeat lost": (stop_heartbeat, {"board_lost"}, SETTINGS.board_timeout + CYCLE),
    "measurement lost": (stop_measurement, {"stale_sensor"}, SETTINGS.sensor_timeout + CYCLE),
    "counter frozen": (freeze_counter, {"counter_frozen"}, SETTINGS.sensor_timeout + CYCLE),
    "sensor lost": (lose_sensor, {"stale_sensor"}, SETTINGS.sensor_timeout + CYCLE),
    "encoder lost": (lose_encoder, {"stale_sensor"}, SETTINGS.sensor_timeout + CYCLE),
    "over-pressure": (burst, {"over_pressure"}, CYCLE),
    "board fault": (board_fault, {"board_fault"}, 0.02 + CYCLE),
    "board vents": (board_vents, {"board_not_active"}, 0.02 + CYCLE),
    "board restarts": (restart, {"board_restarted"}, 0.1 + CYCLE),
    "board deaf": (deafen, {"loop_too_slow"}, 0.16 + CYCLE),
    "other protocol": (other_protocol, {"protocol_version"}, 0.1 + CYCLE),
    "bus-off": (bus_off, {"bus_off"}, CYCLE),
    "second driver": (second_driver, {"foreign_command"}, CYCLE),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_vents_in_time_and_stays(name: str, bench: Bench) -> None:
    inject, kinds, within = FAULTS[name]
    bench.start()
    inject(bench)
    began = bench.now
    while bench.driver.state is SafetyState.ACTIVE and bench.now - began < 2.0:
        bench.step(command=(0.25, 0.25))
    assert bench.now - began <= within + 1e-9
    assert kinds <= bench.kinds()
    heard = len(bench.board.commands)
    bench.step(0.2, (0.25, 0.25))
    assert bench.driver.state is SafetyState.FAULT
    if not bench.board.deaf:
        assert len(bench.board.commands) > heard
        assert not any(any(command.enable) for command in bench.board.commands[heard + 1 :])
        assert bench.board.air == (0.0, 0.0)
    with pytest.raises(ActivationError, match="clear_faults"):
        bench.driver.activate(bench.now)


def test_after_a_fault_clear_activate_and_command_move_again(bench: Bench) -> None:
    bench.start()
    burst(bench)
    bench.step(0.05)
    assert bench.kinds() == {"over_pressure"}
    bench.driver.clear_faults(bench.now)
    with pytest.raises(ActivationError, match=r"elbow_flexor: 610000 Pa"):
        bench.driver.activate(bench.now)
    bench.board.pressures[0] = 0.0
    bench.step(0.1, (0.5, 0.5))
    assert bench.board.air == (0.0, 0.0)
    bench.driver.activate(bench.now)
    bench.step(0.1)
    assert bench.board.air == (0.0, 0.0)
    bench.step(0.1, (0.5, 0.5))
    assert bench.board.air == pytest.approx((0.5, 0.5), abs=2e-5)


def test_clear_faults_reaches_the_board(bench: Bench) -> None:
    bench.step(0.1)
    bench.board.state, bench.board.faults = BoardState.FAULT, BoardFault.WATCHDOG
    bench.step(0.1)
    with pytest.raises(ActivationError, match="watchdog"):
        bench.driver.activate(bench.now)
    bench.driver.clear_faults(bench.now)
    bench.step(0.1)
    bench.driver.activate(bench.now)
    assert bench.driver.state is SafetyState.READY


class RefusingPort:
    """A port whose transmit queue is full, or whose interface is down."""

    def __init__(self, port: CanPort, outcome: SendOutcome) -> None:
        self.port = port
        self.outcome = outcome

    @property
    def state(self) -> BusState:
        down = self.outcome is SendOutcome.BUS_DOWN
        return BusState.DOWN if down else BusState.ERROR_ACTIVE

    def receive_all(self, now: float) -> list:
        return self.port.receive_all(now)

    def send(self, frame_id: int, data: bytes, now: float) -> SendOutcome:
        return self.outcome


@pytest.mark.parametrize(
    ("outcome", "kind"),
    [(SendOutcome.QUEUE_FULL, "send_blocked"), (SendOutcome.BUS_DOWN, "bus_down")],
)
def test_a_bus_that_takes_nothing_is_a_fault(outcome: SendOutcome, kind: str, bench: Bench) -> None:
    bench.start()
    bench.driver._boards.ports[""] = RefusingPort(bench.port, outcome)
    bench.step(SETTINGS.command_timeout + CYCLE, (0.1, 0.1))
    assert kind in bench.kinds()
    # the host could not say so: the board's own watchdog has vented
    bench.step(0.1)
    assert bench.board.state is BoardState.FAULT


def test_a_fault_of_the_cycle_is_stopped_whatever_its_controller_commands(bench: Bench) -> None:
    bench.start()

    def control(_: Snapshot) -> None:
        offer(bench.driver, NamedCommand(NAMES, (1.0, 1.0)), bench.now)

    bench.board.pressures = [1_000_000.0, 100_000.0]
    sent = []
    for _ in range(25):
        bench.now += PERIOD
        bench.board.step(bench.now)
        sent.append(bench.driver.cycle(bench.now, 0.0, control=control))
    stopped = [snapshot for snapshot in sent if snapshot.state is not SafetyState.ACTIVE]
    assert stopped
    assert sent[-len(stopped) :] == stopped
    assert all(snapshot.sent == (-1.0, -1.0) for snapshot in stopped)
