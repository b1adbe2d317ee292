"""What has been asked for since the last stop, and whether air may move because of it.

The watcher knows nothing of the table of states. It remembers acts of people and faults, and
compares them with what the valves of the board do:

- After a stop, air may move only after an activation and a command that was computed after it.
- After a fault of driver or board, somebody must have cleared the faults as well.
- A reference from before a stop is followed no longer.
- A driver activates itself only if it was asked to when it started, and nothing stopped it since.

Stops are: vent, deactivation, clean-up, the end of the driver's process, a fault, and a loss of the
board's power. After a stop the valves get as long to close as the board's watchdog needs.

A board that loses its power forgets its faults. If no running driver knows of them either, or if
the driver ends before it has told the board again, nobody does, and the loss of power counts as
clearing them. Activation and a command are needed all the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from pam_check.state_walk.system import FOLLOW, HOLD, LONGEST, TICK, System

# The board's watchdog and one step for the frame that was on its way.
_CLOSING: Final = LONGEST - 1


@dataclass(slots=True)
class Watcher:
    """The memory of one path."""

    # the driver was asked at its start to activate itself, and nothing has stopped it since
    asked: bool = False
    # when the driver was activated [s]; None: not since the last stop; 0: it no longer matters
    activated_at: float | None = None
    fresh: bool = False  # a command that was computed after the activation has been accepted
    faulty: bool = False  # there was a fault that nobody has cleared
    old_reference: bool = True  # the last accepted reference is from before a stop
    board_forgot: bool = False  # the board has lost its power and has not latched a fault since
    closing_until: float = 0.0  # until when the valves may still be open after a stop [s]
    complaint: str = ""

    def stops(self, system: System) -> None:
        """Something stops the arm."""
        if self.activated_at is not None or system.opening > 0.0:
            self.closing_until = max(self.closing_until, system.now + (_CLOSING + 0.5) * TICK)
        self.asked = self.fresh = False
        self.activated_at = None
        self.old_reference = True

    def driver_starts(self, activates: bool) -> None:
        """A driver's process starts."""
        self.asked = activates

    def is_activated(self, system: System) -> None:
        """A person has activated the driver, and it has accepted that."""
        self.activated_at = system.now
        self.fresh = False

    def driver_activates_itself(self, system: System) -> None:
        """The driver has activated itself at its start."""
        if not self.asked:
            self.complaint = "the driver activates itself without being asked"
        self.asked = False
        self.is_activated(system)

    def is_cleared(self) -> None:
        """A person has cleared the faults."""
        self.faulty = False

    def reference_is_accepted(self) -> None:
        """The controller has accepted a reference."""
        self.old_reference = False

    def board_loses_power(self, system: System) -> None:
        """The board forgets its faults; a driver that waits for it at its start may go on."""
        asked = self.asked
        self.stops(system)
        self.asked = asked
        self.board_forgot = True
        if not system.driver_faulty:
            self.faulty = False

    def driver_ends(self, system: System) -> None:
        """The driver's process is gone, and with it all that only the process knew."""
        self.stops(system)
        if self.board_forgot and not system.board_faulty:
            self.faulty = False

    def judge(self, system: System) -> str:
        """What is wrong after an act; empty if nothing is.

        Parameters
        ----------
        system : System
            The system after the act.
        """
        for computed in system.accepted:
            if self.activated_at is not None and computed < self.activated_at:
                self.complaint = "the driver takes a command from before the activation"
            elif self.activated_at is not None:
                self.fresh = True
                self.activated_at = 0.0
        system.accepted.clear()
        if (system.driver_faulty or system.board_faulty) and not self.faulty:
            self.faulty = True
            self.stops(system)
        if system.board_faulty:
            self.board_forgot = False
        closed = system.opening == 0.0
        if closed and (system.controller is None or not system.controller.follows):
            self.old_reference = True
        if system.now > self.closing_until or (closed and not system.driver_moves):
            self.closing_until = 0.0
        if self.complaint or closed or self.closing_until:
            return self.complaint
        return self._why_not(system)

    def _why_not(self, system: System) -> str:
        """Why air must not move now; empty if it may."""
        old = system.opening > 0.5 * (HOLD + FOLLOW) and self.old_reference
        reasons = {
            "air moves although nobody has cleared the fault": self.faulty,
            "air moves although nobody has activated the driver since the last stop": (
                self.activated_at is None
            ),
            "air moves without a command that was computed after the activation": not self.fresh,
            "the joint follows a reference from before the last stop": old,
        }
        return next((reason for reason, holds in reasons.items() if holds), "")
