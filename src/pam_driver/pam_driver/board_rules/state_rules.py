"""Rules of the states: arming, watchdog, latched faults, vent, clear, latch of the host's fault.

The board becomes active with set points of 0: a flow valve stays closed, a regulator at 0 Pa.
"""

from __future__ import annotations

from typing import Final

from pam_driver.board_rules.rule import Rule
from pam_driver.board_rules.tester import (
    DISABLED,
    ENABLED,
    BoardTester,
    NotTriedError,
    RuleBrokenError,
)
from pam_driver.boards.pam_board.codec import (
    BoardCode,
    BoardFault,
    BoardState,
    Status,
    ValveCommand,
)

_EARLY: Final = 0.005  # s, by which a watchdog may act before its time
_LATE: Final = 0.010  # s, by which it may act after its time, see docs/safety.md
_CRC_FRAMES: Final = 10


def _try_to_move(tester: BoardTester) -> None:
    """What a host does that returns with old commands, and then with the sequence that arms."""
    tester.wait(0.05, ENABLED)
    tester.wait(0.05, DISABLED)
    tester.wait(0.05, ENABLED)
    tester.wait(tester.answer_time)


def _expect_never_active(tester: BoardTester, after: str) -> None:
    """No status since the last `forget` may say active."""
    states = {status.state for _, status in tester.messages(Status)}
    if BoardState.ACTIVE in states:
        raise RuleBrokenError(f"active {after}")


def _arming(tester: BoardTester) -> str:
    tester.rest()
    tester.wait(0.1, ENABLED)
    _expect_never_active(tester, "after a vent and commands with set enable bits alone")
    tester.activate()
    return "vented until a command with clear enable bits had arrived, then active"


def _vent_disarms(tester: BoardTester) -> str:
    tester.rest()
    tester.wait(0.02, DISABLED)
    tester.tell(BoardCode.VENT)
    tester.wait(0.1, ENABLED)
    _expect_never_active(tester, "after a vent, by a command with clear enable bits from before it")
    return "vented all the time"


def _vent(tester: BoardTester) -> str:
    tester.activate()
    tester.tell(BoardCode.VENT)
    sent = tester.line.now()
    if not tester.until(lambda: tester.is_in(BoardState.VENTED), tester.answer_time):
        raise RuleBrokenError(f"{1e3 * tester.answer_time:.0f} ms later: {tester.described()}")
    return f"vented, reported {1e3 * (tester.messages(Status)[-1][0] - sent):.1f} ms later"


def _clear_enables(tester: BoardTester) -> str:
    tester.activate()
    tester.command(DISABLED)
    tester.wait(tester.answer_time, DISABLED)
    tester.expect(BoardState.VENTED, after="after a command with both enable bits clear")
    return "vented"


def _clear_in_active(tester: BoardTester) -> str:
    tester.activate()
    tester.tell(BoardCode.CLEAR_FAULTS)
    tester.wait(0.06, ENABLED)
    tester.expect(BoardState.ACTIVE, after="after clear_faults in active")
    return "active, unchanged"


def _time_to_leave_active(tester: BoardTester, since: float) -> float:
    """The time from the last valid command until a status no longer says active [s]."""
    period = tester.codec.watchdog_timeout
    if not tester.until(lambda: not tester.is_in(BoardState.ACTIVE), 5.0 * period):
        raise RuleBrokenError(f"still active {5e3 * period:.0f} ms after the last valid command")
    times = [t for t, status in tester.messages(Status) if status.state is not BoardState.ACTIVE]
    return times[0] - since


def _watchdog_time(tester: BoardTester) -> str:
    tester.activate()
    tester.wait(0.2, ENABLED)
    after = _time_to_leave_active(tester, tester.sent_at)
    period = tester.codec.watchdog_timeout
    came = f"left active {1e3 * after:.1f} ms after the last command"
    low = period - _EARLY - tester.limits.tolerance
    high = period + _LATE + tester.limits.tolerance
    if not low <= after <= high:
        raise RuleBrokenError(f"{came}, expected {1e3 * low:.0f} to {1e3 * high:.0f} ms")
    return came


def _let_watchdog_act(tester: BoardTester) -> None:
    tester.activate()
    _time_to_leave_active(tester, tester.sent_at)
    tester.wait(tester.answer_time)


def _bring_to_fault(tester: BoardTester) -> None:
    _let_watchdog_act(tester)
    if not tester.is_in(BoardState.FAULT):
        raise NotTriedError("the watchdog does not lead to fault, see watchdog_latches")


def _watchdog_latches(tester: BoardTester) -> str:
    _let_watchdog_act(tester)
    tester.expect(BoardState.FAULT, BoardFault.WATCHDOG, "after the watchdog's time")
    tester.forget()
    _try_to_move(tester)
    _expect_never_active(tester, "again without clear_faults")
    tester.expect(BoardState.FAULT, BoardFault.WATCHDOG, "after commands that would arm")
    return "fault watchdog, which commands did not end"


def _repeated_counter(tester: BoardTester) -> str:
    tester.activate()
    rejected = tester.status.rejected_frames
    tester.command(ENABLED)
    since = tester.sent_at
    period = tester.codec.watchdog_timeout
    tester.wait(3.0 * period, ENABLED, counter=tester.counter)
    if tester.is_in(BoardState.ACTIVE):
        text = f"{3e3 * period:.0f} ms of commands with one counter kept the board active"
        raise RuleBrokenError(text)
    counted = (tester.status.rejected_frames - rejected) & 0xFFFF
    if counted:
        raise RuleBrokenError(f"RejectedFrames grew by {counted}: such a frame is merely old")
    times = [t for t, status in tester.messages(Status) if status.state is not BoardState.ACTIVE]
    return f"watchdog after {1e3 * (times[0] - since):.1f} ms, RejectedFrames unchanged"


def _vent_keeps_fault(tester: BoardTester) -> str:
    _bring_to_fault(tester)
    tester.tell(BoardCode.VENT)
    tester.wait(tester.answer_time)
    tester.expect(BoardState.FAULT, BoardFault.WATCHDOG, "after vent in fault")
    return "fault watchdog, unchanged"


def _clear_needs_arming(tester: BoardTester) -> str:
    _bring_to_fault(tester)
    tester.wait(0.02, DISABLED)
    tester.tell(BoardCode.CLEAR_FAULTS)
    tester.wait(tester.answer_time)
    tester.expect(BoardState.VENTED, after="after clear_faults")
    if tester.status.faults:
        raise RuleBrokenError(f"after clear_faults: {tester.described()}")
    tester.forget()
    tester.wait(0.1, ENABLED)
    _expect_never_active(tester, "after clear_faults and commands with set enable bits alone")
    return "vented without faults, and not armed"


def _checksum_storm(tester: BoardTester) -> str:
    tester.activate()
    command = ValveCommand(ENABLED.valves, ENABLED.enable, tester.counter)
    frame_id, data = tester.codec.encode(tester.number, command)
    for _ in range(_CRC_FRAMES - 1):
        tester.raw(frame_id, data[:-1] + bytes([data[-1] ^ 1]))
    tester.wait(tester.answer_time, ENABLED)
    tester.expect(BoardState.ACTIVE, after=f"after {_CRC_FRAMES - 1} frames with a wrong checksum")
    tester.raw(frame_id, data[:-1] + bytes([data[-1] ^ 1]))
    tester.wait(tester.answer_time, ENABLED)
    tester.expect(BoardState.FAULT, BoardFault.CRC, f"after {_CRC_FRAMES} of them within 1 s")
    return f"fault crc with the {_CRC_FRAMES}th"


def _host_fault(tester: BoardTester) -> str:
    for start in ("vented", "active"):
        if start == "active":
            tester.activate()
        else:
            tester.rest()
        tester.tell(BoardCode.LATCH_FAULT)
        tester.wait(tester.answer_time)
        tester.expect(BoardState.FAULT, BoardFault.HOST, f"after latch_fault in {start}")
        tester.forget()
        tester.tell(BoardCode.VENT)
        _try_to_move(tester)
        _expect_never_active(tester, "again without clear_faults")
        tester.expect(BoardState.FAULT, BoardFault.HOST, "after vent and commands that would arm")
        tester.tell(BoardCode.CLEAR_FAULTS)
        tester.wait(tester.answer_time)
        tester.expect(BoardState.VENTED, after="after clear_faults")
        if BoardFault.HOST in tester.status.faults:
            raise RuleBrokenError("FaultHost is still set after clear_faults")
    return "fault host from vented and from active; clear_faults alone ended it"


RULES: Final = (
    Rule(
        "arming",
        "3 Arming",
        "After a vent, set enable bits lead to active only after a command with both clear.",
        "vent, valve commands with set enable bits for 0.1 s; then the sequence that arms",
        "Reset the flag of arming with every vent and fault; otherwise old commands from a queue "
        "start the arm again.",
        _arming,
    ),
    Rule(
        "vent_disarms",
        "3 Arming",
        "A vent also discards an arming that has not led to active yet.",
        "commands with clear enable bits, vent, then commands with set enable bits for 0.1 s",
        "Reset the flag of arming with every vent, also when the board is vented already.",
        _vent_disarms,
    ),
    Rule(
        "vent",
        "7 BoardCommand vent",
        "vent leads from active to vented at once.",
        "vent while active",
        "Handle board commands in the receive interrupt or before valve commands.",
        _vent,
    ),
    Rule(
        "clear_enables",
        "4 Enable bits",
        "A command with both enable bits clear leads from active to vented.",
        "a valve command with both enable bits clear while active",
        "The state changes with the command and not only the outputs.",
        _clear_enables,
    ),
    Rule(
        "clear_in_active",
        "7 BoardCommand clear_faults",
        "clear_faults does nothing in a state other than fault.",
        "clear_faults while active",
        "Check the state before the faults are cleared.",
        _clear_in_active,
    ),
    Rule(
        "watchdog_time",
        "5 Watchdog",
        "Without a valid command for WatchdogTimeout, the board leaves active and vents.",
        "commands for 0.2 s, then silence",
        "Count the time since the last valid command with a timer of the board; a watchdog that is "
        "checked in a slow task acts late.",
        _watchdog_time,
    ),
    Rule(
        "watchdog_latches",
        "5 Watchdog",
        "The watchdog's fault is latched until clear_faults.",
        "silence while active; then set, clear and set enable bits again",
        "After a time-out the state is fault with FaultWatchdog, and not vented.",
        _watchdog_latches,
    ),
    Rule(
        "repeated_counter",
        "2 Valid commands",
        "A command with the counter of the last one does not feed the watchdog and is not counted.",
        "commands with one and the same counter while active",
        "Compare the counter before the watchdog is fed: a queue that repeats its last frame must "
        "not keep the board active.",
        _repeated_counter,
    ),
    Rule(
        "vent_keeps_fault",
        "7 BoardCommand vent",
        "vent does not end a fault.",
        "vent in fault",
        "Only clear_faults leads from fault to vented.",
        _vent_keeps_fault,
    ),
    Rule(
        "clear_needs_arming",
        "3 Arming; 7 BoardCommand clear_faults",
        "clear_faults leads from fault to vented, and the board has to be armed again.",
        "clear enable bits, clear_faults, then commands with set enable bits for 0.1 s",
        "A command with clear enable bits from before clear_faults does not arm.",
        _clear_needs_arming,
    ),
    Rule(
        "checksum_storm",
        "2 Valid commands",
        "Ten frames with a wrong checksum within 1 s, while active, are a latched fault.",
        "nine frames with a wrong checksum among valid commands, then one more",
        "A single wrong frame is no fault, but many show a bus that cannot be trusted.",
        _checksum_storm,
    ),
    Rule(
        "host_fault",
        "8 BoardCommand latch_fault",
        "latch_fault leads to fault with FaultHost in every state, until clear_faults.",
        "latch_fault in vented and in active; then vent, commands that would arm, clear_faults",
        "This fault lets a robot stay still after a crash of its computer.",
        _host_fault,
    ),
)
