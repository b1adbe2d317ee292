"""Talks to one board as a driver would, and breaks the rules of a driver where a test needs it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

from pam_driver.board_rules.line import Line
from pam_driver.boards.pam_board.codec import (
    BoardCode,
    BoardCodec,
    BoardCommand,
    BoardFault,
    BoardMessage,
    BoardState,
    FrameError,
    Measurement,
    Status,
    ValveCommand,
)
from pam_model.errors import PamError

FEED_PERIOD: Final = 0.002  # s, the driver's cycle
ANSWER: Final = 0.025  # s, a status is due every 20 ms
_STALL: Final = 0.05  # s, half of the watchdog's time
OFF: Final = (False, False)
ON: Final = (True, True)
NO_FAULT: Final = BoardFault(0)


class RuleBrokenError(PamError):
    """The board breaks a rule; the message says what came back."""


class NotTriedError(PamError):
    """A rule could not be tried; the message says why."""


class ValveFeed(NamedTuple):
    """A valve command for every cycle; `outputs` sets the bits of brake and dump valve."""

    valves: tuple[float, float]
    enable: tuple[bool, bool]
    outputs: bool = False


DISABLED: Final = ValveFeed((0.0, 0.0), OFF)
ENABLED: Final = ValveFeed((0.0, 0.0), ON)


@dataclass(frozen=True, slots=True)
class TestLimits:
    """What the test may do, and how exactly it can measure."""

    __test__ = False  # not a class of tests, whatever pytest thinks of its name

    opening: float = 0.2  # valve command that fills a channel, as a fraction of full scale
    max_pressure: float = 150_000.0  # a channel is never filled above this [Pa gauge]
    # the board's own limit [Pa gauge]; None: the rule of over-pressure is not tried
    over_pressure: float | None = None
    tolerance: float = 0.005  # how late this computer and the bus may be [s]
    # asks a person to do something and returns whether it was done; None: nobody is there
    ask: Callable[[str], bool] | None = None


class BoardTester:
    """One board on a line.

    Attributes
    ----------
    heard : list of (float, message)
        What the board has sent, with the time of arrival [s]; `forget` empties it.
    others : set of int
        Other boards that were heard.
    commanded : bool
        Whether somebody else commands this board.
    stalled : float
        The longest pause between two commands that were due every 2 ms [s].
    unsent : int
        Frames that the bus did not accept.
    pauses : list of (float, float)
        When this computer did not listen although it should have: a pause above the tolerance, from
        and to [s]; `forget` empties it.
    """

    def __init__(
        self, line: Line, codec: BoardCodec, number: int, limits: TestLimits | None = None
    ) -> None:
        self.line = line
        self.codec = codec
        self.number = number
        self.limits = limits or TestLimits()
        self.heard: list[tuple[float, BoardMessage]] = []
        self.others: set[int] = set()
        self.commanded = False
        self.stalled = 0.0
        self.unsent = 0
        self.pauses: list[tuple[float, float]] = []
        self.sent_at = line.now()
        self._counter = 0
        self._status: Status | None = None
        self._pressures = (0.0, 0.0)

    @property
    def status(self) -> Status:
        """The last status.

        Raises
        ------
        RuleBrokenError
            If the board has sent none.
        """
        if self._status is None:
            raise RuleBrokenError("the board has sent no Status frame")
        return self._status

    @property
    def pressures(self) -> tuple[float, float]:
        """The pressures in the last measurement [Pa gauge]."""
        return self._pressures

    @property
    def counter(self) -> int:
        """The counter of the last valve command."""
        return self._counter

    def messages[T: BoardMessage](self, kind: type[T]) -> list[tuple[float, T]]:
        """The messages of one kind that were heard, with their times [s]."""
        return [(time, one) for time, one in self.heard if isinstance(one, kind)]

    def forget(self) -> None:
        """Forget what was heard, except for the last status and pressures."""
        self.heard.clear()
        self.pauses.clear()

    def raw(self, frame_id: int, data: bytes) -> None:
        """Send any frame."""
        self.unsent += not self.line.send(frame_id, data)

    def command(self, feed: ValveFeed, counter: int | None = None) -> None:
        """Send a valve command, by default with the next counter."""
        self._counter = (self._counter + 1) & 0xFF if counter is None else counter
        message = ValveCommand(feed.valves, feed.enable, self._counter, feed.outputs, feed.outputs)
        self.raw(*self.codec.encode(self.number, message))
        self.sent_at = self.line.now()

    def tell(self, code: BoardCode) -> None:
        """Send a board command."""
        self.raw(*self.codec.encode(self.number, BoardCommand(code)))

    def wait(
        self, seconds: float, feed: ValveFeed | None = None, counter: int | None = None
    ) -> None:
        """Listen for some time, and send a valve command every 2 ms if `feed` is given."""
        self._run(seconds, feed, counter, lambda: False)

    def until(
        self, condition: Callable[[], bool], seconds: float, feed: ValveFeed | None = None
    ) -> bool:
        """Listen until something holds, at most for some time; whether it holds."""
        return condition() or self._run(seconds, feed, None, condition)

    def is_in(self, state: BoardState) -> bool:
        """Whether the last status names this state."""
        return self._status is not None and self._status.state is state

    def described(self) -> str:
        """The last status in words."""
        status = self.status
        faults = ", ".join(str(fault.name).lower() for fault in status.faults)
        return f"state {status.state.name.lower()}" + (f" with fault {faults}" if faults else "")

    def rest(self) -> None:
        """Bring the board to `vented`, without faults and not armed.

        Raises
        ------
        RuleBrokenError
            If it does not get there.
        """
        self.tell(BoardCode.VENT)
        self.wait(ANSWER)
        if not self.is_in(BoardState.VENTED):
            self.tell(BoardCode.CLEAR_FAULTS)
            self.until(lambda: self.is_in(BoardState.VENTED), 1.0)
        if not self.is_in(BoardState.VENTED):
            raise RuleBrokenError(
                f"vent and clear_faults do not lead to vented: {self.described()}"
            )
        self.tell(BoardCode.VENT)
        self.wait(ANSWER)
        self.forget()

    def activate(self, feed: ValveFeed = ENABLED) -> None:
        """Bring the board from rest to `active`.

        Raises
        ------
        RuleBrokenError
            If it does not get there.
        """
        self.rest()
        self.wait(0.02, DISABLED)
        if not self.until(lambda: self.is_in(BoardState.ACTIVE), self.answer_time, feed):
            raise RuleBrokenError(
                "not active after commands with clear enable bits and then commands with set "
                f"ones: {self.described()}"
            )
        self.forget()

    @property
    def answer_time(self) -> float:
        """The time within which a change of state must be reported [s]."""
        return ANSWER + self.limits.tolerance

    def expect(self, state: BoardState, faults: BoardFault = NO_FAULT, after: str = "") -> None:
        """Compare the last status with what it must be.

        Raises
        ------
        RuleBrokenError
            If the state differs, or one of the faults is missing.
        """
        status = self.status
        if status.state is not state or faults & ~status.faults:
            wanted = state.name.lower()
            names = ", ".join(str(fault.name).lower() for fault in faults)
            wanted += f" with fault {names}" if names else ""
            raise RuleBrokenError(f"{after}: {self.described()}, expected {wanted}")

    def _run(
        self,
        seconds: float,
        feed: ValveFeed | None,
        counter: int | None,
        condition: Callable[[], bool],
    ) -> bool:
        now = self.line.now()
        end = now + seconds
        while now < end - 1e-9:
            if feed is not None:
                self.command(feed, counter)
            asked = min(now + FEED_PERIOD, end)
            for time, frame_id, data in self.line.receive(asked):
                self._hear(time, frame_id, data)
            before, now = now, self.line.now()
            if now - asked > self.limits.tolerance:
                self.pauses.append((before, now))
            if feed is not None:
                self.stalled = max(self.stalled, now - before)
            if condition():
                return True
        return condition()

    def _hear(self, time: float, frame_id: int, data: bytes) -> None:
        try:
            number, message = self.codec.decode(frame_id, data)
        except FrameError:
            return
        if number != self.number:
            self.others.add(number)
            return
        if isinstance(message, ValveCommand | BoardCommand):
            self.commanded = True
            return
        self.heard.append((time, message))
        if isinstance(message, Status):
            self._status = message
        elif isinstance(message, Measurement):
            self._pressures = message.pressures

    @property
    def host_stalled(self) -> bool:
        """Whether this computer stalled so long that the board's watchdog may have acted."""
        return self.stalled > _STALL

    def fair_again(self) -> None:
        """Begin a new rule: forget what was heard, and stalls and refused frames."""
        self.forget()
        self.stalled = 0.0
        self.unsent = 0
