"""Rules that move no air: regular frames, values, the echo, and frames that must be rejected."""

from __future__ import annotations

import itertools
import math
import statistics
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from pam_driver.board_rules.rule import Rule
from pam_driver.board_rules.tester import (
    DISABLED,
    ON,
    BoardTester,
    NotTriedError,
    RuleBrokenError,
)
from pam_driver.boards.pam_board.codec import (
    PROTOCOL_VERSION,
    BoardCode,
    BoardCommand,
    BoardMessage,
    Heartbeat,
    Measurement,
    Status,
    ValveCommand,
)

_VENTED_PRESSURE: Final = 20_000.0  # Pa
_PARTS: Final = 10  # of the time for which regular frames are listened to
_SUPPLY_RANGE: Final = (90_000.0, 1_300_000.0)  # Pa absolute


def _period_kept(tester: BoardTester, kind: type[BoardMessage], period: float, share: float) -> str:
    """The frames of one kind come with their period; listens for twenty periods, at least 1 s.

    A pause of this computer excuses the frames that are missing at that very time. It does not
    excuse a board that is late all the time: the median of the mean periods in ten parts of the
    listening shows that, whatever happens in a few of them.
    """
    tester.rest()
    seconds = max(1.0, 20.0 * period)
    tester.forget()
    tester.wait(seconds)
    times = [time for time, _ in tester.messages(kind)]
    came = f"{len(times)} frames in {seconds:g} s"
    allowed = _Allowed(period, share, seconds, 2.5 * period + 4.0 * tester.limits.tolerance)
    wrong = _wrong_times(times, allowed, ())
    if wrong and tester.pauses:
        paused = sum(end - begin for begin, end in tester.pauses)
        came += f" (this computer paused for {1e3 * paused:.0f} ms)"
        if paused > 0.5 * seconds:
            raise NotTriedError(f"{came}, {wrong}")
        wrong = _wrong_times(times, allowed, tester.pauses)
    if wrong:
        raise RuleBrokenError(f"{came}, {wrong}")
    longest = max(b - a for a, b in itertools.pairwise(times))
    return f"{came}, longest pause {1e3 * longest:.1f} ms"


class _Allowed(NamedTuple):
    """Period, its relative tolerance, how long was listened, and the longest pause [s]."""

    period: float
    share: float
    seconds: float
    longest: float


def _wrong_times(
    times: Sequence[float], allowed: _Allowed, pauses: Sequence[tuple[float, float]]
) -> str:
    """What is wrong with the times of frames [s], apart from pauses of this computer."""
    period, share, seconds, limit = allowed
    wanted = seconds / period
    least = wanted - sum(end - begin for begin, end in pauses) / period
    if not (1.0 - share) * least - 1.0 <= len(times) <= (1.0 + share) * wanted + 1.0:
        return f"expected {wanted:.0f}: one every {1e3 * period:g} ms"
    many = max(1, len(times) // _PARTS)
    usual = statistics.median((b - a) / many for a, b in itertools.pairwise(times[::many]))
    if abs(usual - period) > share * period:
        return f"mostly one every {1e3 * usual:.2f} ms, expected {1e3 * period:g} ms"
    longest = max(
        (b - a for a, b in itertools.pairwise(times) if not _overlaps(pauses, a, b)), default=0.0
    )
    if longest > limit:
        return f"with a pause of {1e3 * longest:.0f} ms, at most {1e3 * limit:.0f} ms"
    return ""


def _overlaps(pauses: Sequence[tuple[float, float]], begin: float, end: float) -> bool:
    return any(first < end and last > begin for first, last in pauses)


def _heartbeat(tester: BoardTester) -> str:
    text = _period_kept(tester, Heartbeat, 0.1, 0.1)
    beats = tester.messages(Heartbeat)
    version = beats[-1][1].protocol_version
    if version != PROTOCOL_VERSION:
        raise RuleBrokenError(f"protocol version {version}, expected {PROTOCOL_VERSION}")
    elapsed = beats[-1][0] - beats[0][0]
    uptime = beats[-1][1].uptime - beats[0][1].uptime
    if abs(uptime - elapsed) > 0.02 * elapsed + 2.0 * tester.limits.tolerance:
        raise RuleBrokenError(f"{text}; the uptime grew by {uptime:.3f} s in {elapsed:.3f} s")
    return f"{text}; protocol version {version}, the uptime grows with time"


def _status_period(tester: BoardTester) -> str:
    return _period_kept(tester, Status, 0.02, 0.1)


def _measurement_period(tester: BoardTester) -> str:
    return _period_kept(tester, Measurement, 0.002, 0.05)


def _measurement_counter(tester: BoardTester) -> str:
    tester.rest()
    tester.wait(1.0)
    counters = [message.counter for _, message in tester.messages(Measurement)]
    if len(counters) < 10:
        raise RuleBrokenError(f"{len(counters)} measurements in a second")
    steps = [(b - a) & 0xFF for a, b in itertools.pairwise(counters)]
    wrong = [step for step in steps if step != 1]
    if len(set(counters)) == 1:
        raise RuleBrokenError(f"the counter stays at {counters[0]} in {len(counters)} measurements")
    if len(wrong) > 0.02 * len(steps):
        raise RuleBrokenError(f"{len(wrong)} of {len(steps)} steps are not 1, the first {wrong[0]}")
    return f"{len(steps)} steps, {len(wrong)} of them not 1 (lost frames)"


def _vented_pressure(tester: BoardTester) -> str:
    tester.rest()
    tester.until(lambda: bool(tester.messages(Measurement)), 0.5)

    def vented() -> bool:
        return all(abs(pressure) < _VENTED_PRESSURE for pressure in tester.pressures)

    held = tester.until(vented, 5.0)
    first, second = (1e-3 * pressure for pressure in tester.pressures)
    came = f"{first:.1f} and {second:.1f} kPa gauge"
    if math.isnan(first) or math.isnan(second):
        raise NotTriedError(f"{came}: a channel without pressure sensor is not available (65535)")
    if not held:
        raise RuleBrokenError(f"{came} after 5 s in vented, expected within 20 kPa of 0")
    return came


def _supply_pressure(tester: BoardTester) -> str:
    tester.wait(0.05)
    supply = tester.status.supply_pressure
    if math.isnan(supply):
        raise NotTriedError("the board measures no supply pressure (65535)")
    came = f"{1e-3 * supply:.0f} kPa absolute"
    low, high = _SUPPLY_RANGE
    if not low <= supply <= high:
        raise RuleBrokenError(f"{came}, expected {1e-3 * low:.0f} to {1e-3 * high:.0f} kPa")
    return f"{came}; compare it with the gauge of the supply (which shows about 100 kPa less)"


def _echo(tester: BoardTester) -> str:
    tester.rest()
    for counter in (10, 77, 200, 255, 0):
        tester.command(DISABLED, counter)
        tester.wait(tester.answer_time)
        echo = tester.status.command_counter
        if echo != counter:
            raise RuleBrokenError(
                f"CommandCounter is {echo} after a command with counter {counter}"
            )
    return "CommandCounter repeats each of the five counters"


def _rejected(tester: BoardTester, count: int, send: Callable[[], None], what: str) -> str:
    """`count` frames that the board must count and that must change nothing."""
    tester.rest()
    tester.command(DISABLED)
    tester.wait(2.0 * tester.answer_time)
    before = tester.status
    send()
    tester.wait(2.0 * tester.answer_time)
    after = tester.status
    if after.command_counter != before.command_counter:
        raise RuleBrokenError(
            f"a command with {what} was accepted: CommandCounter went from "
            f"{before.command_counter} to {after.command_counter}"
        )
    if after.state is not before.state or after.faults != before.faults:
        raise RuleBrokenError(f"frames with {what} changed the board: {tester.described()}")
    counted = (after.rejected_frames - before.rejected_frames) & 0xFFFF
    if counted != count:
        raise RuleBrokenError(f"RejectedFrames grew by {counted} after {count} frames with {what}")
    return f"all {count} counted in RejectedFrames, nothing changed"


def _valid(tester: BoardTester) -> tuple[int, bytes]:
    """A valid valve command with set enable bits and a counter that was not used yet."""
    counter = (tester.counter + 100) & 0xFF
    return tester.codec.encode(tester.number, ValveCommand((0.0, 0.0), ON, counter))


def _wrong_length(tester: BoardTester) -> str:
    vent = tester.codec.encode(tester.number, BoardCommand(BoardCode.LATCH_FAULT))

    def send() -> None:
        for frame_id, data in (_valid(tester), vent):
            for length in range(9):
                if length != len(data):
                    tester.raw(frame_id, (data + bytes(8))[:length])

    return _rejected(tester, 16, send, "a wrong length")


def _wrong_checksum(tester: BoardTester) -> str:
    def flipped(data: bytes, bit: int) -> bytes:
        return (int.from_bytes(data, "little") ^ 1 << bit).to_bytes(len(data), "little")

    def send() -> None:
        frame_id, data = _valid(tester)
        for bit in (3, 33, 40, 63):
            tester.raw(frame_id, flipped(data, bit))
        tester.raw(frame_id, bytes(8))
        tester.raw(frame_id, b"\xff" * 8)
        # valid for the next board, so that its checksum belongs to another identifier
        other = (tester.number + 1) % tester.codec.board_count
        tester.raw(frame_id, tester.codec.encode(other, ValveCommand((0.0, 0.0), ON, 55))[1])
        latch_id, latch = tester.codec.encode(tester.number, BoardCommand(BoardCode.LATCH_FAULT))
        tester.raw(latch_id, flipped(latch, 9))

    return _rejected(tester, 8, send, "a wrong checksum")


def _out_of_range(tester: BoardTester) -> str:
    codec = tester.codec

    def send() -> None:
        for name in ("Valve0", "Valve1"):
            values = {name: -32768, "Enable0": 1, "Enable1": 1, "Counter": tester.counter + 50}
            tester.raw(*codec.raw_frame(tester.number, ValveCommand, values))
        for code in (0, max(BoardCode) + 1, 255):
            tester.raw(*codec.raw_frame(tester.number, BoardCommand, {"Code": code}))

    return _rejected(tester, 5, send, "a value out of range")


RULES: Final = (
    Rule(
        "heartbeat",
        "Frames; 9 Boot",
        "A Heartbeat every 100 ms in every state, with the protocol version and an uptime in s.",
        "nothing, for 2 s",
        "Send it from a timer, not from the main loop; the uptime has a resolution of 1 ms.",
        _heartbeat,
        opens_valves=False,
    ),
    Rule(
        "status_period",
        "Frames",
        "A Status every 20 ms.",
        "nothing, for 1 s",
        "Without a regular status, the driver counts the board as lost.",
        _status_period,
        opens_valves=False,
    ),
    Rule(
        "measurement_period",
        "Frames",
        "A Measurement every 2 ms.",
        "nothing, for 1 s",
        "Check the priority of the sending task, the bitrate, and the load of the bus.",
        _measurement_period,
        opens_valves=False,
    ),
    Rule(
        "measurement_counter",
        "Frames",
        "The counter of Measurement grows by one with each sample, modulo 256.",
        "nothing, for 1 s",
        "Count where the sensors are sampled, so that a sampling that hangs is noticed.",
        _measurement_counter,
        opens_valves=False,
    ),
    Rule(
        "vented_pressure",
        "1 The vented state; Values",
        "Pressures are gauge pressures in steps of 20 Pa from -100 kPa: about 0 when vented.",
        "vent",
        "Raw value 5000 is 0 kPa gauge. A wrong scale, a wrong offset, swapped bytes or a sensor "
        "of absolute pressure show here; so does an exhaust that is blocked.",
        _vented_pressure,
        opens_valves=False,
    ),
    Rule(
        "supply_pressure",
        "Values",
        "The supply pressure is absolute, in steps of 20 Pa.",
        "nothing",
        "Raw value 5000 is 100 kPa absolute, which is a supply without pressure.",
        _supply_pressure,
        opens_valves=False,
    ),
    Rule(
        "echo",
        "Frames",
        "CommandCounter in Status is the counter of the last valid valve command.",
        "five valve commands with clear enable bits and the counters 10, 77, 200, 255, 0",
        "Store the counter of every valid command, also in vented and in fault.",
        _echo,
        opens_valves=False,
    ),
    Rule(
        "wrong_length",
        "2 Valid commands",
        "A frame of a wrong length changes nothing and is counted in RejectedFrames.",
        "valve commands of 0 to 7 bytes and board commands of 0 to 8 bytes except 4",
        "Compare the length with 8 or 4 before anything else is read.",
        _wrong_length,
        opens_valves=False,
    ),
    Rule(
        "wrong_checksum",
        "2 Valid commands; Checksum",
        "A frame whose checksum is wrong changes nothing and is counted in RejectedFrames.",
        "frames with one flipped bit, of zeros, of ones, and with the checksum of the next board",
        "CRC-8 SAE J1850 over the identifier (low byte first) and all bytes before the last; the "
        "final XOR with 0xFF is often forgotten, and so is the identifier.",
        _wrong_checksum,
        opens_valves=False,
    ),
    Rule(
        "out_of_range",
        "2 Valid commands; Values",
        "A value out of range changes nothing and is counted in RejectedFrames.",
        "valve commands with raw value -32768, and board commands with codes 0, 4 and 255",
        "-32768 means that no command is available; it is not full exhaust.",
        _out_of_range,
        opens_valves=False,
    ),
)
