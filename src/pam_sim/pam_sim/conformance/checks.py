"""The checks of a kind of board with its simulated twin.

They use the two protocols alone (`pam_driver.boards.protocol`, `pam_sim.boards.protocol`). What a
kind does not promise is not demanded of it. Each check takes a new bench and raises
ConformanceError.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from typing import Final

from pam_driver.boards.protocol import Board, Condition
from pam_driver.boards.samples import ANGLE_INPUT, PRESSURE_INPUT
from pam_driver.boards.wiring import kind_name
from pam_sim.conformance.bench import (
    SENSOR_TIMEOUT,
    STAMPS_AHEAD,
    SUPPLY,
    TIMEOUT,
    BoardBench,
    require,
)

LATEST: Final = 0.01  # s, age of a measurement while frames arrive


def every_setpoint_reaches_its_own_valve(bench: BoardBench) -> None:
    """The valves follow set points that are all different."""
    kinds = {kind_name(wired) for wired in bench.wiring.boards.values()}
    require(len(kinds) == 1, f"the rig must have boards of one kind, not of {sorted(kinds)}")
    require(len(bench.boards) > 1, "the rig must have two boards, to see whether frames mix up")
    bench.start()
    require(not bench.vented(), "all valves vent although they have set points")


def every_measurement_comes_back_with_its_times(bench: BoardBench) -> None:
    """Values, time stamps and ages of all samples are right; no error and no condition."""
    bench.run(0.2, None)
    for address, board in bench.boards.items():
        wired = bench.wiring.boards[address]
        for wire in wired.pressures:
            sample, true = board.pressures[wire.channel], bench.pressures[wire.place]
            where = f"{board.name}, pressure of channel {wire.channel}"
            _close(sample.value, true, 100.0, f"{where} [Pa]")
            _close(sample.stamp, sample.time + STAMPS_AHEAD, 1e-6, f"{where}, stamp [s]")
            _young(bench.now - sample.time, where)
        for angle in wired.angles:
            sample, true = board.angles[angle.channel], bench.angles[angle.place]
            where = f"{board.name}, angle of channel {angle.channel}"
            _close(sample.value, true, 1e-3, f"{where} [rad]")
            _young(bench.now - sample.time, where)
        if board.promises.measures_supply:
            _close(board.supply_pressure, SUPPLY, 1e-3 * SUPPLY, f"{board.name}, supply [Pa]")
        else:
            require(
                math.isnan(board.supply_pressure),
                f"{board.name}: has a supply pressure that it does not promise to measure",
            )
    require(not bench.errors, f"frames of the twin were refused: {bench.errors[:3]}")
    _no_conditions(bench)


def a_board_that_has_heard_nothing_vents(bench: BoardBench) -> None:
    """No valve opens before the first command, or while commands have no set points."""
    _vented(bench, "at power-on")
    bench.run(0.3, None, command=False)
    _vented(bench, "without any command")
    bench.run(0.3, None)
    _vented(bench, "while commands have no set points")


def a_board_that_needs_arming_opens_only_after_a_command_that_opens_nothing(
    bench: BoardBench,
) -> None:
    """Set points alone do not open a valve after power-on."""
    if not bench.promised("needs_arming"):
        return
    bench.run(0.2, None, command=False)
    bench.run(0.1, bench.fractions)
    _vented(bench, "before the board is armed")
    bench.start()


def vent_acts_with_the_next_frame(bench: BoardBench) -> None:
    """All valves vent as soon as the frames of `vent` have arrived, and stay so."""
    bench.start()
    for address, board in bench.boards.items():
        bench.tell(address, board.vent())
        bench.tell(address, board.command(None, bench.now))
    _vented(bench, "after the frames of vent()")
    bench.run(0.1, None)
    _vented(bench, "0.1 s after a vent")


def a_promised_watchdog_vents_in_time_and_not_before(bench: BoardBench) -> None:
    """Without commands the valves vent after the promised time; all boards promise alike."""
    watchdogs = [
        board.promises.watchdog
        for board in bench.boards.values()
        if board.promises.watchdog is not None
    ]
    if not watchdogs:
        return
    require(len(watchdogs) == len(bench.boards), "only some boards of the kind have a watchdog")
    bench.start()
    bench.run(min(watchdogs) - 0.01, None, command=False)
    require(bench.obeyed(), f"a watchdog of {min(watchdogs):g} s vents earlier")
    bench.run(max(watchdogs) - min(watchdogs) + 0.02, None, command=False)
    _vented(bench, f"after the watchdog's {max(watchdogs):g} s without a command")


def a_board_that_latches_opens_again_only_after_faults_are_cleared(bench: BoardBench) -> None:
    """After a watchdog time-out commands move nothing until the faults are cleared."""
    if not bench.promised("latches") or not bench.promised("watchdog"):
        return
    a_promised_watchdog_vents_in_time_and_not_before(bench)
    bench.run(0.1, bench.fractions)
    _vented(bench, "with a latched fault")
    bench.run(0.1, None)
    bench.run(0.1, bench.fractions)
    _vented(bench, "with a latched fault, after a command that opens nothing")
    if bench.promised("tells_faults"):
        _only_conditions(bench, "board_fault")
    for address, board in bench.boards.items():
        bench.tell(address, board.clear_faults())
    bench.run(0.1, bench.fractions)
    if bench.promised("needs_arming"):
        _vented(bench, "with cleared faults, before the board is armed")
    bench.run(0.1, None)
    _no_conditions(bench)
    bench.run(0.1, bench.fractions)
    require(bench.obeyed(), "the valves do not follow after the faults were cleared")


def a_fault_of_the_host_is_kept_until_faults_are_cleared(bench: BoardBench) -> None:
    """A board that promises it reports the fault and stays vented, whatever else arrives."""
    _host_fault(bench, expected=False)
    if not bench.promised("keeps_host_fault"):
        require(
            all(not tuple(board.latch_fault()) for board in bench.boards.values()),
            "latch_fault() has frames although the board keeps no fault of the host",
        )
        return
    bench.start()
    for address, board in bench.boards.items():
        bench.tell(address, board.latch_fault())
    _vented(bench, "after the frames of latch_fault()")
    bench.run(0.1, None)
    for address, board in bench.boards.items():
        bench.tell(address, board.vent())
    bench.run(0.1, bench.fractions)
    _vented(bench, "with a fault of the host")
    _host_fault(bench, expected=True)
    for address, board in bench.boards.items():
        bench.tell(address, board.clear_faults())
    bench.run(0.1, bench.fractions)
    _vented(bench, "with a cleared fault of the host, before the board is armed")
    _host_fault(bench, expected=False)
    bench.start()


def wrong_frames_are_refused_by_the_driver_and_change_nothing(bench: BoardBench) -> None:
    """A payload of a wrong length or content is a FrameError; no other exception is raised."""
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
                require(known() == before, f"0x{frame_id:X}: a refused frame changes a sample")
            else:
                taken += 1
        require(taken <= 1, f"0x{frame_id:X} accepts payloads of several lengths")
    require(
        all(str(error) and error.kind != "frame" for error in bench.errors),
        "a FrameError has no text, or no kind of its own",
    )
    for _ in range(2000):  # whatever else comes is a message or a FrameError
        bench.hear(draw.choice(frame_ids), draw.randbytes(draw.randint(0, 8)))
        bench.conditions()


def wrong_frames_are_refused_by_the_board_and_open_nothing(bench: BoardBench) -> None:
    """The twin counts commands of wrong length or checksum, and its valves stay as they are."""
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
            require(
                twin.rejected_frames == refused + 8,
                f"0x{frame_id:X}: the twin has not counted 8 commands of wrong length",
            )
            if board.promises.has_checksum:
                word = int.from_bytes(data, "big") ^ 1 << 17
                twin.on_frame(frame_id, word.to_bytes(len(data), "big"), bench.now)
                require(
                    twin.rejected_frames == refused + 9,
                    f"0x{frame_id:X}: the twin has not refused a command with a wrong checksum",
                )
    require(
        [twin.valve_commands for twin in bench.twins.values()] == before,
        "a refused command has moved a valve",
    )


def frames_have_the_identifiers_that_the_board_names(bench: BoardBench) -> None:
    """Every frame has an identifier of `identifiers`, and no two boards share one."""
    bench.start()
    for address, board in bench.boards.items():
        bench.tell(address, board.vent())
        bench.tell(address, board.clear_faults())
        bench.tell(address, board.latch_fault())
        answers, commands, service = board.identifiers
        heard = {i for a, i in bench.heard_up if a == address}
        sent = {i for a, i in bench.sent_down if a == address}
        require(bool(heard), f"{board.name}: its twin sends nothing")
        _named(board, heard - set(answers), "the twin sends", "identifiers.answers")
        _named(board, sent - {*commands, *service}, "the board sends", "identifiers")
        _named(board, set(answers) - set(board.listeners), "identifiers.answers", "listeners")
        _named(board, set(board.listeners) - {*answers, *commands}, "listeners has", "identifiers")
    ids = [i for b in bench.boards.values() for i in (*b.identifiers.answers, *b.identifiers[1])]
    twice = sorted({f"0x{i:X}" for i in ids if ids.count(i) > 1})
    require(not twice, f"boards share the identifiers {', '.join(twice)}")


def a_second_driver_is_told_by_its_commands(bench: BoardBench) -> None:
    """A command of somebody else, where the board listens to commands, is a foreign command."""
    bench.run(0.2, None)
    for board in bench.boards.values():
        for frame_id, data in board.command(None, bench.now):
            if frame_id in board.listeners:
                count = len(bench.errors)
                bench.hear(frame_id, data)
                require(
                    [error.kind for error in bench.errors[count:]] == ["foreign_command"],
                    f"{board.name}: a second driver's command 0x{frame_id:X} is not reported",
                )


def a_silent_board_is_named(bench: BoardBench) -> None:
    """A board is silent before its first frame, and lost when its frames stop."""
    _silent(bench, expected=True)
    bench.run(0.2, None)
    _silent(bench, expected=False)
    bench.up = False
    bench.run(TIMEOUT + 0.15, None)
    _silent(bench, expected=True)
    lost = [found for found in bench.conditions() if found.kind == "board_lost"]
    require(
        [found.subject for found in lost] == [board.name for board in bench.boards.values()],
        "conditions() does not name each board that is lost, in order",
    )
    require(all(found.text for found in lost), "a condition has no text")


def a_restart_is_told_once(bench: BoardBench) -> None:
    """A restarted board is a condition until it is acknowledged."""
    if not bench.promised("has_heartbeat"):
        return
    bench.run(0.5, None)
    for address, twin in bench.twins.items():
        bench.twins[address] = twin.restarted(bench.now)
    bench.run(0.3, None)
    _only_conditions(bench, "board_restarted")
    for board in bench.boards.values():
        board.acknowledge()
    _no_conditions(bench)


def a_frozen_counter_is_found(bench: BoardBench) -> None:
    """Frames that arrive with the same counter are no new measurements."""
    if not bench.promised("counts_samples"):
        return
    bench.run(0.2, None)
    for twin in bench.twins.values():
        twin.misbehave("counter_frozen", 0.0)
    bench.run(SENSOR_TIMEOUT + 0.02, None)
    require(
        "counter_frozen" in {found.kind for found in bench.conditions()},
        "a counter that stands still is not reported",
    )
    for twin in bench.twins.values():
        twin.misbehave("mended", 0.0)
    bench.run(0.1, None)
    _no_conditions(bench)


def a_board_that_does_not_hear_is_found(bench: BoardBench) -> None:
    """A board that echoes commands is reported when its echo is not what was sent."""
    if not bench.promised("echoes_commands"):
        return
    bench.start()
    bench.run(TIMEOUT, bench.fractions)
    _no_conditions(bench, moving=True)
    bench.down = False
    bench.run(TIMEOUT + 0.1, bench.fractions)
    require(
        len(bench.conditions(moving=True)) == len(bench.boards),
        "boards that receive no command are not reported, each by one condition",
    )


def a_lost_sensor_is_never_a_number(bench: BoardBench) -> None:
    """Without a value no sample is renewed, and none is NaN or invented."""
    bench.run(0.2, None)
    bench.pressures = [math.nan] * len(bench.pressures)
    bench.angles = [math.nan] * len(bench.angles)
    bench.run(SENSOR_TIMEOUT + 0.02, None)
    for board in bench.boards.values():
        for sample in (*board.pressures.values(), *board.angles.values()):
            require(
                not math.isnan(sample.value) or sample.time == -math.inf,
                f"{board.name}: a lost sensor makes a sample of NaN",
            )
            require(
                bench.now - sample.time > SENSOR_TIMEOUT,
                f"{board.name}: a lost sensor has a sample that is not too old",
            )
    if bench.promised("tells_faults"):
        _only_conditions(bench, "board_fault")


def a_measurement_that_is_missing_again_and_again_is_counted(bench: BoardBench) -> None:
    """Every second one is missing, so that the last value never becomes too old.

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
            require(
                0.3 < share < 0.7 or (share == 0.0 and not board.promises.counts_samples),
                f"{board.name}, {sensor}: half of the values are missing, counted are {share:.0%}",
            )
    bench.pressures, bench.angles = known
    bench.run(1.2, None)
    for board in bench.boards.values():
        require(
            not board.availability.missing_share(PRESSURE_INPUT, 0, bench.now),
            f"{board.name}: values that are there again are still counted as missing",
        )


def what_it_reports_can_be_shown(bench: BoardBench) -> None:
    """Report and counts have names and one line of text; `follows` is true once it follows."""
    for seconds in (0.0, 0.3):
        bench.run(seconds, None)
        for board in bench.boards.values():
            text, values = board.report()
            require(bool(text) and "\n" not in text, f"{board.name}: report() is not one line")
            require(all(str(name) for name in values), f"{board.name}: a value has no name")
            require(
                all(isinstance(count, int) for count in board.counts().values()),
                f"{board.name}: a count is no integer",
            )
            require(
                board.follows is not board.promises.tells_state,
                f"{board.name}: `follows` is {board.follows} before it follows commands",
            )
    bench.start()
    require(all(board.follows for board in bench.boards.values()), "`follows` does not become true")


def strangers_are_named_or_nobodys(bench: BoardBench) -> None:
    """A frame that belongs to no board of the rig is a FrameError of the kind, or None."""
    draw = random.Random(3)
    for kind in bench.wiring.kinds.values():
        for _ in range(2000):
            frame_id = draw.randrange(0x800)
            error = kind.stranger(frame_id, draw.randbytes(draw.randint(0, 8)))
            require(
                error is None or bool(error.kind and str(error)),
                f"stranger(0x{frame_id:X}) returns an error without kind or text",
            )


def _close(value: float, expected: float, tolerance: float, what: str) -> None:
    require(
        abs(value - expected) <= tolerance,
        f"{what}: {value:g} instead of {expected:g} (tolerance {tolerance:g})",
    )


def _young(age: float, what: str) -> None:
    require(0.0 <= age <= LATEST, f"{what}: {age:g} s old, expected 0 to {LATEST:g} s")


def _vented(bench: BoardBench, when: str) -> None:
    require(bench.vented(), f"a valve is open {when}")


def _no_conditions(bench: BoardBench, moving: bool = False) -> None:
    found = bench.conditions(moving)
    require(not found, f"a healthy board reports {_kinds(found)}")


def _only_conditions(bench: BoardBench, kind: str) -> None:
    found = bench.conditions()
    require({one.kind for one in found} == {kind}, f"expected {kind}, reported {_kinds(found)}")


def _kinds(found: Sequence[Condition]) -> str:
    return ", ".join(sorted({one.kind for one in found})) or "nothing"


def _host_fault(bench: BoardBench, expected: bool) -> None:
    for board in bench.boards.values():
        require(
            bool(board.host_fault) is expected,
            f"{board.name}: host_fault is {board.host_fault}, expected {expected}",
        )


def _silent(bench: BoardBench, expected: bool) -> None:
    for board in bench.boards.values():
        silent = board.silent(bench.now, TIMEOUT)
        require(
            bool(silent) is expected,
            f"{board.name}: silent() names {', '.join(silent) or 'nothing'} "
            f"{'without any frame' if expected else 'although frames arrive'}",
        )


def _named(board: Board, unknown: set[int], who: str, where: str) -> None:
    ids = ", ".join(f"0x{frame_id:X}" for frame_id in sorted(unknown))
    require(not unknown, f"{board.name}: {who} {ids}, not in {where}")


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
