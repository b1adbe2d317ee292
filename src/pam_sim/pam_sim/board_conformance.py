"""What every kind of board and its simulated twin must keep to, whatever its bytes are.

`CHECKS` are run by tests/pam_driver/test_board_conformance.py on every registered kind. They use
the two protocols alone (`pam_driver.boards.protocol`, `pam_sim.boards.protocol`); what a kind does
not promise is not asked of it.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from typing import Final

import pytest

from pam_driver.boards.frame_errors import FrameError
from pam_driver.boards.protocol import Address, Condition
from pam_driver.boards.samples import ANGLE_INPUT, PRESSURE_INPUT
from pam_driver.boards.wiring import RigWiring, kind_name
from pam_model.rig import Rig
from pam_sim.boards.protocol import BoardSettings, BoardValve
from pam_sim.boards.register import twin_called

STEP: Final = 0.001  # s
TIMEOUT, SENSOR_TIMEOUT = 0.5, 0.05
SUPPLY: Final = 7e5  # Pa absolute
STAMPS_AHEAD: Final = 1000.0  # s, of the wall clock


class BoardBench:
    """The boards of a rig, their twins, and a bus that loses nothing unless told."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.wiring = RigWiring(rig)
        self.boards = self.wiring.make_boards()
        self.now = 50.0
        self.twins = {
            address: twin_called(kind_name(wired))({}).make(wired, BoardSettings(), self.now)
            for address, wired in self.wiring.boards.items()
        }
        self.pressures = [1e5 + 1e4 * index for index in range(len(rig.muscles))]
        self.angles = [0.25 - 0.5 * index for index in range(len(rig.joints))]
        self.heard_up: list[tuple[Address, int]] = []
        self.sent_down: list[tuple[Address, int]] = []
        self.errors: list[FrameError] = []
        self.up = self.down = True

    @property
    def fractions(self) -> tuple[float, ...]:
        """A set point for each muscle, all different."""
        return tuple(0.25 + 0.0625 * index for index in range(len(self.rig.muscles)))

    def run(self, seconds: float, setpoints: Sequence[float] | None, command: bool = True) -> None:
        """So many seconds at 1 kHz; commands in every second millisecond."""
        for tick in range(round(seconds / STEP)):
            self.now += STEP
            if command and tick % 2 == 0:
                for address in self.boards:
                    self.tell(address, self.boards[address].command(setpoints, self.now))
            for address, twin in self.twins.items():
                wired = self.wiring.boards[address]
                frames = twin.poll(
                    self.now,
                    [self.pressures[wire.place] for wire in wired.pressures],
                    [self.angles[wire.place] for wire in wired.angles],
                    SUPPLY,
                )
                for frame_id, data in frames:
                    self.heard_up.append((address, frame_id))
                    if self.up:
                        self.hear(frame_id, data)

    def tell(self, address: Address, frames) -> None:
        """Frames of a board to all twins."""
        for frame_id, data in frames:
            self.sent_down.append((address, frame_id))
            if self.down:
                for twin in self.twins.values():
                    twin.on_frame(frame_id, data, self.now)

    def hear(self, frame_id: int, data: bytes) -> None:
        """A frame to whoever listens to it, as the driver does it."""
        for board in self.boards.values():
            listener = board.listeners.get(frame_id)
            if listener is not None:
                try:
                    listener(data, self.now, self.now + STAMPS_AHEAD)
                except FrameError as error:
                    self.errors.append(error)

    def start(self) -> None:
        """Bring all valves to their set points."""
        self.run(0.2, None)
        self.run(0.1, self.fractions)
        assert self.obeyed()

    def valves(self) -> list[tuple[float, float, BoardValve]]:
        """Of each muscle on each board: set point, what its valve does, and the valve."""
        return [
            (self.fractions[wire.place], command, valve)
            for address, twin in self.twins.items()
            for wire, command, valve in zip(
                self.wiring.boards[address].valves, twin.valve_commands, twin.valves, strict=True
            )
        ]

    def obeyed(self) -> bool:
        """Whether every valve does what its set point says."""
        return all(
            command == pytest.approx(valve.command(fraction), abs=1e-3 * valve.full_scale)
            for fraction, command, valve in self.valves()
        )

    def vented(self) -> bool:
        """Whether every valve vents."""
        return all(command == valve.vented for _, command, valve in self.valves())

    def conditions(self, moving: bool = False) -> list[Condition]:
        """What all boards say is wrong."""
        return [
            found
            for board in self.boards.values()
            for found in board.conditions(self.now, TIMEOUT, SENSOR_TIMEOUT, moving)
        ]

    def promised(self, name: str) -> bool:
        """Whether every board promises something."""
        return all(getattr(board.promises, name) for board in self.boards.values())


def every_setpoint_reaches_its_own_valve(bench: BoardBench) -> None:
    assert len({kind_name(wired) for wired in bench.wiring.boards.values()}) == 1
    assert len(bench.boards) > 1, "the example must have two boards, to see them mix up frames"
    bench.start()
    assert not bench.vented()


def every_measurement_comes_back_with_its_times(bench: BoardBench) -> None:
    bench.run(0.2, None)
    for address, board in bench.boards.items():
        wired = bench.wiring.boards[address]
        for wire in wired.pressures:
            sample = board.pressures[wire.channel]
            assert sample.value == pytest.approx(bench.pressures[wire.place], abs=100.0)
            assert sample.stamp == pytest.approx(sample.time + STAMPS_AHEAD, abs=1e-6)
            assert 0.0 <= bench.now - sample.time <= 0.01
        for angle in wired.angles:
            sample = board.angles[angle.channel]
            assert sample.value == pytest.approx(bench.angles[angle.place], abs=1e-3)
            assert 0.0 <= bench.now - sample.time <= 0.01
        if board.promises.measures_supply:
            assert board.supply_pressure == pytest.approx(SUPPLY, rel=1e-3)
        else:
            assert math.isnan(board.supply_pressure)
    assert bench.errors == [] and bench.conditions() == []


def a_board_that_has_heard_nothing_vents(bench: BoardBench) -> None:
    assert bench.vented()
    bench.run(0.3, None, command=False)
    assert bench.vented()
    bench.run(0.3, None)
    assert bench.vented()


def a_board_that_needs_arming_opens_only_after_a_command_that_opens_nothing(
    bench: BoardBench,
) -> None:
    if not bench.promised("needs_arming"):
        return
    bench.run(0.2, None, command=False)
    bench.run(0.1, bench.fractions)
    assert bench.vented()
    bench.start()


def vent_acts_with_the_next_frame(bench: BoardBench) -> None:
    bench.start()
    for address, board in bench.boards.items():
        bench.tell(address, board.vent())
        bench.tell(address, board.command(None, bench.now))
    assert bench.vented()
    bench.run(0.1, None)
    assert bench.vented()


def a_promised_watchdog_vents_in_time_and_not_before(bench: BoardBench) -> None:
    watchdogs = [board.promises.watchdog for board in bench.boards.values()]
    if None in watchdogs:
        assert all(watchdog is None for watchdog in watchdogs)
        return
    bench.start()
    bench.run(min(watchdogs) - 0.01, None, command=False)
    assert bench.obeyed()
    bench.run(max(watchdogs) - min(watchdogs) + 0.02, None, command=False)
    assert bench.vented()


def a_board_that_latches_opens_again_only_after_faults_are_cleared(bench: BoardBench) -> None:
    if not bench.promised("latches") or not bench.promised("watchdog"):
        return
    a_promised_watchdog_vents_in_time_and_not_before(bench)
    bench.run(0.1, bench.fractions)
    assert bench.vented()
    bench.run(0.1, None)
    bench.run(0.1, bench.fractions)
    assert bench.vented()
    if bench.promised("tells_faults"):
        assert {found.kind for found in bench.conditions()} == {"board_fault"}
    for address, board in bench.boards.items():
        bench.tell(address, board.clear_faults())
    bench.run(0.1, bench.fractions)
    assert bench.vented() or not bench.promised("needs_arming")
    bench.run(0.1, None)
    assert bench.conditions() == []
    bench.run(0.1, bench.fractions)
    assert bench.obeyed()


def a_fault_of_the_host_is_kept_until_faults_are_cleared(bench: BoardBench) -> None:
    assert not any(board.host_fault for board in bench.boards.values())
    if not bench.promised("keeps_host_fault"):
        assert all(not tuple(board.latch_fault()) for board in bench.boards.values())
        return
    bench.start()
    for address, board in bench.boards.items():
        bench.tell(address, board.latch_fault())
    assert bench.vented()
    bench.run(0.1, None)
    for address, board in bench.boards.items():
        bench.tell(address, board.vent())
    bench.run(0.1, bench.fractions)
    assert bench.vented()
    assert all(board.host_fault for board in bench.boards.values())
    for address, board in bench.boards.items():
        bench.tell(address, board.clear_faults())
    bench.run(0.1, bench.fractions)
    assert bench.vented()
    assert not any(board.host_fault for board in bench.boards.values())
    bench.start()


def wrong_frames_are_refused_by_the_driver_and_change_nothing(bench: BoardBench) -> None:
    bench.run(0.2, None)
    draw = random.Random(7)
    frame_ids = [frame_id for board in bench.boards.values() for frame_id in board.listeners]

    def known() -> list[object]:
        return [(dict(board.pressures), dict(board.angles)) for board in bench.boards.values()]

    for frame_id in frame_ids:
        taken = 0
        for length in range(9):
            before, count = known(), len(bench.errors)
            bench.hear(frame_id, b"\xff" * length)
            if len(bench.errors) > count:
                assert known() == before
            else:
                taken += 1
        assert taken <= 1, f"0x{frame_id:X} takes payloads of several lengths"
    assert all(str(error) and error.kind != "frame" for error in bench.errors)
    for _ in range(2000):  # whatever else comes is a message or a FrameError
        bench.hear(draw.choice(frame_ids), draw.randbytes(draw.randint(0, 8)))
        bench.conditions()
    assert bench.boards.keys() == bench.twins.keys()


def wrong_frames_are_refused_by_the_board_and_open_nothing(bench: BoardBench) -> None:
    bench.start()
    before = [twin.valve_commands for twin in bench.twins.values()]
    for address, board in bench.boards.items():
        twin = bench.twins[address]
        commands = list(board.command(bench.fractions, bench.now))
        for frame_id, data in commands:
            refused = twin.rejected_frames
            for length in range(9):
                if length != len(data):
                    twin.on_frame(frame_id, (data + bytes(8))[:length], bench.now)
            assert twin.rejected_frames == refused + 8
            if board.promises.has_checksum:
                word = int.from_bytes(data, "big") ^ 1 << 17
                twin.on_frame(frame_id, word.to_bytes(len(data), "big"), bench.now)
                assert twin.rejected_frames == refused + 9
    assert [twin.valve_commands for twin in bench.twins.values()] == before


def frames_have_the_identifiers_that_the_board_names(bench: BoardBench) -> None:
    bench.start()
    for address, board in bench.boards.items():
        bench.tell(address, board.vent())
        bench.tell(address, board.clear_faults())
        bench.tell(address, board.latch_fault())
        answers, commands, service = board.identifiers
        heard = {i for a, i in bench.heard_up if a == address}
        assert heard and heard <= set(answers)
        assert {i for a, i in bench.sent_down if a == address} <= {*commands, *service}
        assert set(answers) <= set(board.listeners) <= {*answers, *commands}
    ids = [i for b in bench.boards.values() for i in (*b.identifiers.answers, *b.identifiers[1])]
    assert len(ids) == len(set(ids))


def a_second_driver_is_told_by_its_commands(bench: BoardBench) -> None:
    bench.run(0.2, None)
    for board in bench.boards.values():
        for frame_id, data in board.command(None, bench.now):
            if frame_id in board.listeners:
                bench.hear(frame_id, data)
                assert bench.errors.pop().kind == "foreign_command"


def a_silent_board_is_named(bench: BoardBench) -> None:
    assert all(board.silent(bench.now, TIMEOUT) for board in bench.boards.values())
    bench.run(0.2, None)
    assert not any(board.silent(bench.now, TIMEOUT) for board in bench.boards.values())
    bench.up = False
    bench.run(TIMEOUT + 0.15, None)
    assert all(board.silent(bench.now, TIMEOUT) for board in bench.boards.values())
    lost = [found for found in bench.conditions() if found.kind == "board_lost"]
    assert [found.subject for found in lost] == [board.name for board in bench.boards.values()]
    assert all(found.text for found in lost)


def a_restart_is_told_once(bench: BoardBench) -> None:
    if not bench.promised("has_heartbeat"):
        return
    bench.run(0.5, None)
    for address, twin in bench.twins.items():
        bench.twins[address] = twin.restarted(bench.now)
    bench.run(0.3, None)
    assert {found.kind for found in bench.conditions()} == {"board_restarted"}
    for board in bench.boards.values():
        board.acknowledge()
    assert bench.conditions() == []


def a_frozen_counter_is_found(bench: BoardBench) -> None:
    if not bench.promised("counts_samples"):
        return
    bench.run(0.2, None)
    for twin in bench.twins.values():
        twin.misbehave("counter_frozen", 0.0)
    bench.run(SENSOR_TIMEOUT + 0.02, None)
    assert "counter_frozen" in {found.kind for found in bench.conditions()}
    for twin in bench.twins.values():
        twin.misbehave("mended", 0.0)
    bench.run(0.1, None)
    assert bench.conditions() == []


def a_board_that_does_not_hear_is_found(bench: BoardBench) -> None:
    if not bench.promised("echoes_commands"):
        return
    bench.start()
    bench.run(TIMEOUT, bench.fractions)
    assert bench.conditions(moving=True) == []
    bench.down = False
    bench.run(TIMEOUT + 0.1, bench.fractions)
    assert len(bench.conditions(moving=True)) == len(bench.boards)


def a_lost_sensor_is_never_a_number(bench: BoardBench) -> None:
    bench.run(0.2, None)
    bench.pressures = [math.nan] * len(bench.pressures)
    bench.angles = [math.nan] * len(bench.angles)
    bench.run(SENSOR_TIMEOUT + 0.02, None)
    for board in bench.boards.values():
        for sample in (*board.pressures.values(), *board.angles.values()):
            assert not math.isnan(sample.value) or sample.time == -math.inf
            assert bench.now - sample.time > SENSOR_TIMEOUT
    if bench.promised("tells_faults"):
        assert {found.kind for found in bench.conditions()} == {"board_fault"}


def a_measurement_that_is_missing_again_and_again_is_counted(bench: BoardBench) -> None:
    """Every second one, so that the last value never becomes too old.

    A device that cannot say that it has no value sends none.
    """
    known = bench.pressures, bench.angles
    nothing = [math.nan] * len(known[0]), [math.nan] * len(known[1])
    for number in range(120):
        bench.pressures, bench.angles = nothing if number % 2 else known
        bench.run(0.005, None)
    for address, board in bench.boards.items():
        wired = bench.wiring.boards[address]
        sensors = [(PRESSURE_INPUT, wire.channel) for wire in wired.pressures]
        sensors += [(ANGLE_INPUT, wire.channel) for wire in wired.angles]
        for sensor in sensors:
            share = board.availability.missing_share(*sensor, bench.now)
            assert 0.3 < share < 0.7 or (share == 0.0 and not board.promises.counts_samples)
    bench.pressures, bench.angles = known
    bench.run(1.2, None)
    for board in bench.boards.values():
        assert not board.availability.missing_share(PRESSURE_INPUT, 0, bench.now)


def what_it_reports_can_be_shown(bench: BoardBench) -> None:
    for seconds in (0.0, 0.3):
        bench.run(seconds, None)
        for board in bench.boards.values():
            text, values = board.report()
            assert text and "\n" not in text and all(str(name) for name in values)
            assert all(isinstance(count, int) for count in board.counts().values())
            follows = not board.promises.tells_state or seconds < 0.0
            assert board.follows is follows
    bench.start()
    assert all(board.follows for board in bench.boards.values())


def strangers_are_named_or_nobodys(bench: BoardBench) -> None:
    draw = random.Random(3)
    for kind in bench.wiring.kinds.values():
        for _ in range(2000):
            frame_id = draw.randrange(0x800)
            error = kind.stranger(frame_id, draw.randbytes(draw.randint(0, 8)))
            assert error is None or (error.kind and str(error))


CHECKS: Final[Sequence[Callable[[BoardBench], None]]] = (
    every_setpoint_reaches_its_own_valve,
    every_measurement_comes_back_with_its_times,
    a_board_that_has_heard_nothing_vents,
    a_board_that_needs_arming_opens_only_after_a_command_that_opens_nothing,
    vent_acts_with_the_next_frame,
    a_promised_watchdog_vents_in_time_and_not_before,
    a_board_that_latches_opens_again_only_after_faults_are_cleared,
    a_fault_of_the_host_is_kept_until_faults_are_cleared,
    wrong_frames_are_refused_by_the_driver_and_change_nothing,
    wrong_frames_are_refused_by_the_board_and_open_nothing,
    frames_have_the_identifiers_that_the_board_names,
    a_second_driver_is_told_by_its_commands,
    a_silent_board_is_named,
    a_restart_is_told_once,
    a_frozen_counter_is_found,
    a_board_that_does_not_hear_is_found,
    a_lost_sensor_is_never_a_number,
    a_measurement_that_is_missing_again_and_again_is_counted,
    what_it_reports_can_be_shown,
    strangers_are_named_or_nobodys,
)
