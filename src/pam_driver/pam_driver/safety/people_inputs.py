"""Emergency stop, enabling switch and permission of full speed: inputs by which people stop.

The first two are inputs of the boards and topics, which can forbid motion; the third is a topic.

Every input is fail-safe: motion needs a value that permits it, and a value that is younger than the
deadline. An emergency stop that is pressed is a latched fault in every state. A missing message of
it is a fault while air may move, and prevents activation otherwise. A released enabling switch
vents and is no fault: holding it again does not move anything before someone activates the driver.
Without permission of full speed the joints must be slow, after the time in which the controller
brakes.

A value that forbids motion counts from its arrival until it has been judged, although the input may
permit motion again by then (`pam_driver.safety.since_judged`).

Sources: ISO 10218-1 (emergency stop, three-position enabling device, reduced speed), IEC 60204-1
section 9.2
(a reset must not itself start motion).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

from pam_driver.boards.protocol import (
    EMERGENCY_STOP,
    ENABLING_SWITCH,
    NEVER,
    Address,
    Board,
    Condition,
    Sample,
)
from pam_driver.safety.since_judged import SinceJudged
from pam_model.errors import RigError

if TYPE_CHECKING:
    from pam_model.rig import People

_PERMITS: Final = Sample(1.0)
FULL_SPEED: Final = "full_speed"
"""The name of the input that permits full speed."""
_WORDS: Final = {
    EMERGENCY_STOP: ("the emergency stop is pressed", "emergency stop"),
    ENABLING_SWITCH: ("the enabling switch is released", "enabling switch"),
}


class PeopleInputs:
    """All inputs for people of one rig.

    Parameters
    ----------
    people : People
        The inputs on which the rig file insists.
    boards : mapping of address to Board
        The boards; every input that one of them reports is obeyed.

    Raises
    ------
    RigError
        If the rig file names a board that it does not have.
    """

    def __init__(self, people: People, boards: Mapping[Address, Board]) -> None:
        self._boards = boards
        self._kept = SinceJudged()
        self._deadline = people.deadline
        self._wanted = {
            EMERGENCY_STOP: people.emergency_stop_board,
            ENABLING_SWITCH: people.enabling_switch_board,
        }
        topics = {
            EMERGENCY_STOP: people.emergency_stop_topic,
            ENABLING_SWITCH: people.enabling_switch_topic,
        }
        self._topics = {name: Sample() for name, wanted in topics.items() if wanted}
        self._slowing_time = people.slowing_time
        self._forbidden_at = NEVER  # when full speed was last forbidden [s]
        # until when full speed is permitted [s]
        self._full_speed_until = NEVER if people.full_speed_topic else math.inf
        for name, address in self._wanted.items():
            if address is not None and address not in boards:
                names = ", ".join(map(str, boards))
                raise RigError(
                    f"people.{name}_board = {address}: the rig has no such board (it has {names})"
                )

    @property
    def topics(self) -> tuple[str, ...]:
        """The inputs that need a topic."""
        return tuple(self._topics)

    def hear_topic(self, name: str, permits: bool, now: float) -> None:
        """Take a message of the topic of an input, received at a monotonic time [s]."""
        if name == FULL_SPEED and self._full_speed_until < math.inf:
            if not permits:
                self._forbidden_at = now
                self._full_speed_until = min(self._full_speed_until, now)
            elif now - self._forbidden_at >= self._deadline:  # of two publishers, "no" counts
                self._full_speed_until = now + self._deadline
        if name in self._topics:
            self._topics[name] = Sample(float(permits), now)
            self._kept.keep(self._forbidding_topic(name))

    def hear_board(self, board: Board) -> None:
        """Keep what the inputs of a board forbid before its next frame replaces it."""
        for name in _WORDS:
            if board.inputs.get(name, _PERMITS).value != 1.0:
                self._kept.keep((_forbidden_by(name, board),))

    def judged(self) -> None:
        """Forget what was forbidden in passing: the driver has acted on it."""
        self._kept.judged()

    def pressed(self, now: float) -> tuple[Condition, ...]:
        """The emergency stops that are pressed: latched faults in every state."""
        return self._forbidding(EMERGENCY_STOP)

    def conditions(self, now: float) -> Sequence[Condition]:
        """An emergency stop without messages: it prevents activation, and is a fault in motion."""
        return (*self._forbidding(EMERGENCY_STOP), *self._silent(EMERGENCY_STOP, now))

    def not_enabled(self, now: float) -> str:
        """Why the enabling switch forbids motion, or forbade it since the last judgement.

        "" if it permits it or there is none.
        """
        found = (*self._forbidding(ENABLING_SWITCH), *self._silent(ENABLING_SWITCH, now))
        return "; ".join(str(condition) for condition in found)

    def reduced_speed(self, now: float) -> bool:
        """Whether full speed is not permitted: the controller keeps the reduced speed."""
        return now >= self._full_speed_until

    def must_be_slow(self, now: float) -> bool:
        """Whether the joints must be at the reduced speed, since they had time to brake."""
        return now >= self._full_speed_until + self._slowing_time

    def _forbidding(self, name: str) -> tuple[Condition, ...]:
        """The sources that forbid motion, or did so since the last judgement."""
        found = [
            _forbidden_by(name, board)
            for board in self._boards.values()
            if (sample := board.inputs.get(name)) is not None and sample.value != 1.0
        ]
        found += self._forbidding_topic(name)
        return self._kept.added_to(found, name)

    def _forbidding_topic(self, name: str) -> tuple[Condition, ...]:
        """Whether the last message of the topic of an input forbids motion."""
        told = self._topics.get(name)
        if told is not None and told.time > NEVER and told.value != 1.0:
            return (Condition(name, "topic", _WORDS[name][0]),)
        return ()

    def _silent(self, name: str, now: float) -> list[Condition]:
        """The sources on which the rig file insists, and that are missing or too old."""
        silent, address = [], self._wanted[name]
        if address is not None:
            board = self._boards[address]
            if now - board.inputs.get(name, Sample()).time > self._deadline:
                silent.append(board.name)
        if name in self._topics and now - self._topics[name].time > self._deadline:
            silent.append("topic")
        text = f"no {_WORDS[name][1]} for {self._deadline:g} s" if silent else ""
        return [Condition(name, source, text) for source in silent]


def _forbidden_by(name: str, board: Board) -> Condition:
    """That the last value of an input of a board does not permit motion."""
    text, word = _WORDS[name]
    if math.isnan(board.inputs[name].value):
        text = (
            f"it had an input for the {word} and reports none now; if it has none, clean "
            "up and configure the driver"
        )
    return Condition(name, board.name, text)
