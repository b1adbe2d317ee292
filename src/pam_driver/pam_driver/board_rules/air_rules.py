"""Rules that let air into the muscles, or need a person: enable bits, limit, restart."""

from __future__ import annotations

from typing import Final

from pam_driver.board_rules.rule import Rule
from pam_driver.board_rules.tester import (
    DISABLED,
    ENABLED,
    ON,
    BoardTester,
    NotTriedError,
    RuleBrokenError,
    ValveFeed,
)
from pam_driver.boards.pam_board.codec import (
    BoardCode,
    BoardFault,
    BoardState,
    Heartbeat,
    Status,
)

RESTART: Final = "Switch the board's electric supply off and on again"
_FILLED: Final = 40_000.0  # Pa gauge
_FILL_TIME: Final = 5.0  # s
_VENT_TIME: Final = 5.0  # s
_RESTART_TIME: Final = 30.0  # s
_RESTART_WATCH: Final = 0.5  # s


def _pair(channel: int, value: float, other: float) -> tuple[float, float]:
    """A value for a channel, and one for the other channel."""
    return (value, other) if channel == 0 else (other, value)


def _check_guard(tester: BoardTester, most: float) -> None:
    """Vent at once where a pressure is higher than this test may make it."""
    if max(tester.pressures) > most:
        highest = max(tester.pressures)
        tester.tell(BoardCode.VENT)
        text = f"{1e-3 * highest:.0f} kPa, above the test's limit of {1e-3 * most:.0f} kPa"
        raise RuleBrokenError(f"the pressure rose to {text}")


def _fill(tester: BoardTester, feed: ValveFeed, channels: tuple[int, ...]) -> None:
    """Fill channels to `_FILLED`; NotTriedError without a pressure that rises."""
    tester.activate(feed)

    def filled() -> bool:
        _check_guard(tester, tester.limits.max_pressure)
        return all(tester.pressures[channel] > _FILLED for channel in channels)

    tester.until(filled, _FILL_TIME, feed)


def _own_channel(tester: BoardTester) -> str:
    came = []
    for channel in (0, 1):
        tester.rest()
        tester.until(lambda: max(tester.pressures) < 0.25 * _FILLED, _VENT_TIME)
        before = tester.pressures
        # the other channel's valve is at its exhaust
        _fill(tester, ValveFeed(_pair(channel, tester.limits.opening, -1.0), ON), (channel,))
        rises = [after - start for after, start in zip(tester.pressures, before, strict=True)]
        told = f"Valve{channel}: Pressure0 {1e-3 * rises[0]:+.0f} kPa, "
        told += f"Pressure1 {1e-3 * rises[1]:+.0f} kPa"
        if max(rises) < 0.25 * _FILLED:
            raise NotTriedError(
                f"no pressure rises ({told}): is the supply on, are the muscles connected?"
            )
        if rises[1 - channel] > 0.5 * rises[channel]:
            raise RuleBrokenError(f"{told}: the channels of valves or sensors are exchanged")
        came.append(told)
    tester.rest()
    return "; ".join(came)


def _enable_bits(tester: BoardTester) -> str:
    came = []
    opening = tester.limits.opening
    for channel in (0, 1):
        feed = ValveFeed((opening, opening), ON)
        _fill(tester, feed, (0, 1))
        start = tester.pressures[channel]
        if start < 0.5 * _FILLED:
            raise NotTriedError(f"channel {channel} reaches {1e-3 * start:.0f} kPa only")
        one = ValveFeed(
            _pair(channel, opening, 0.0), (channel != 0, channel != 1)
        )  # the command would fill, the enable bit must win

        def fell(place: int = channel, from_pressure: float = start) -> bool:
            _check_guard(tester, tester.limits.max_pressure)
            return tester.pressures[place] < 0.5 * from_pressure

        fallen = tester.until(fell, _VENT_TIME, one)
        now = tester.pressures[channel]
        told = f"Enable{channel} clear: {1e-3 * start:.0f} kPa became {1e-3 * now:.0f} kPa"
        if not fallen:
            raise RuleBrokenError(f"{told} in {_VENT_TIME:g} s, although its command fills")
        if not tester.is_in(BoardState.ACTIVE):
            raise RuleBrokenError(f"one clear enable bit: {tester.described()}, expected active")
        came.append(told)
    tester.rest()
    return "; ".join(came)


def _over_pressure(tester: BoardTester) -> str:
    limit = tester.limits.over_pressure
    if limit is None:
        raise NotTriedError(
            "give the board's own limit with --over-pressure, if the muscles withstand 10 % more"
        )
    feed = ValveFeed((tester.limits.opening, -1.0), ON)
    tester.activate(feed)
    highest = 0.0

    def stopped() -> bool:
        nonlocal highest
        highest = max(highest, tester.pressures[0])
        _check_guard(tester, 1.1 * limit)
        return not tester.is_in(BoardState.ACTIVE)

    came = f"up to {1e-3 * limit:.0f} kPa asked"
    if not tester.until(stopped, 2.0 * _FILL_TIME, feed):
        raise NotTriedError(f"{came}, but the pressure stays at {1e-3 * highest:.0f} kPa")
    tester.expect(BoardState.FAULT, BoardFault.OVER_PRESSURE, f"at {1e-3 * highest:.0f} kPa")
    tester.until(lambda: tester.pressures[0] < 0.5 * limit, _VENT_TIME)
    tester.wait(0.05, DISABLED)
    tester.expect(BoardState.FAULT, BoardFault.OVER_PRESSURE, "after the pressure has fallen")
    tester.rest()
    return f"fault over_pressure at {1e-3 * highest:.0f} kPa, latched"


def _restart(tester: BoardTester) -> str:
    ask = tester.limits.ask
    if ask is None:
        raise NotTriedError("needs a person who switches the board off and on: use --person")
    tester.activate()
    tester.wait(0.1, ENABLED)
    before = [beat.uptime for _, beat in tester.messages(Heartbeat)]
    uptime = max(before, default=0.0)
    if not ask(RESTART):
        raise NotTriedError("the board was not switched off and on")

    def restarted() -> bool:
        nonlocal uptime
        beats = [beat.uptime for _, beat in tester.messages(Heartbeat)]
        uptime = max(uptime, *beats[:-1], 0.0)
        return bool(beats) and beats[-1] < uptime

    # old commands go on, as those of a host that has noticed nothing
    if not tester.until(restarted, _RESTART_TIME, ENABLED):
        raise NotTriedError(f"no Heartbeat with a smaller uptime within {_RESTART_TIME:g} s")
    tester.forget()
    tester.wait(_RESTART_WATCH, ENABLED)
    states = {status.state for _, status in tester.messages(Status)}
    if BoardState.ACTIVE in states:
        raise RuleBrokenError("active after the restart, by commands with set enable bits alone")
    if not states:
        raise RuleBrokenError(f"no Status within {_RESTART_WATCH:g} s after the restart")
    names = " and ".join(sorted(state.name.lower() for state in states))
    return f"the uptime fell; the board was {names} while commands with set enable bits went on"


RULES: Final = (
    Rule(
        "own_channel",
        "Values",
        "A positive ValveN fills channel N, and PressureN measures it.",
        "Valve0 open and Valve1 at its exhaust until the pressure rises, then the other way round",
        "Compare the wiring of valves and sensors with the numbers of the channels.",
        _own_channel,
    ),
    Rule(
        "enable_bits",
        "4 Enable bits",
        "A clear enable bit vents its channel, whatever the value of the command is.",
        "both channels filled; then one enable bit clear with a command that fills",
        "Apply each enable bit to its own output, after the set point.",
        _enable_bits,
    ),
    Rule(
        "over_pressure",
        "6 Over-pressure",
        "A pressure above the board's own limit is a latched fault.",
        "Valve0 open until the board's limit is reached",
        "Compare each sample with the limit on the board itself, independently of the host.",
        _over_pressure,
    ),
    Rule(
        "restart",
        "3 Arming; 9 Boot",
        "After a restart the board is vented and not armed, and the uptime begins at 0.",
        "commands with set enable bits while the board is switched off and on",
        "Initialise state and arming at start-up; do not keep them in memory that survives.",
        _restart,
    ),
)
