"""Settings with all gains: what a design has prepared, and which loops are in use."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from pam_control.feedback.margins import Margins
from pam_control.laws.law import AnyLaw
from pam_control.learning.learning_session import LearningSession
from pam_control.loop_guard import LoopGuard, Means
from pam_control.settings import ControlSettings


@dataclass(frozen=True, slots=True)
class Loops:
    """Settings with all gains, and the margins of every joint with them."""

    settings: ControlSettings  # no gain is missing
    margins: list[list[Margins]]  # by joint
    soft: bool = False  # whether they are for a joint that has oscillated

    def changed_to(self, settings: ControlSettings) -> Loops:
        """Other settings with the same loops."""
        mine = self.settings
        kept = {
            "gains": mine.gains,
            "pressure_gain": mine.pressure_gain,
            "observer": mine.observer,
            "extra_delay": mine.extra_delay,
        }
        return dataclasses.replace(self, settings=settings.replace(**kept))

    def lowered(self, share: float) -> Loops:
        """The loops with a share of the gains [-]; the integral gets its square.

        So the integral's phase lag moves away from the crossover. The pressure loops get the root
        of the share, because it may be they that are late. The margins are not known.
        """
        gains = {
            name: schedule.changed(
                lambda each: dataclasses.replace(
                    each,
                    proportional=share * each.proportional,
                    integral=share * share * each.integral,
                    derivative=share * each.derivative,
                    observer=share * each.observer,
                )
            )
            for name, schedule in self.settings.gains.items()
        }
        gain = self.settings.pressure_gain
        lowered = self.settings.replace(gains=gains, pressure_gain=gain and share**0.5 * gain)
        return dataclasses.replace(self, settings=lowered)


@dataclass(frozen=True, slots=True)
class PreparedSettings:
    """Settings and law as asked for, the loops with all gains, and what is learnt."""

    # asked, law: as asked for
    asked: ControlSettings
    law: AnyLaw
    normal: Loops  # usually in use
    soft: Loops | None  # for a joint that has oscillated; None if there are none
    learning: LearningSession | None = None  # of a motion that is repeated
    # for a joint that swings a little, each with lower gains than the one before
    lowered: tuple[Loops, ...] = ()

    def loops(self, guard: LoopGuard) -> Loops:
        """The loops that the guard permits."""
        if guard.softened and self.soft is not None:
            return self.soft
        lower = (self.normal, *self.lowered)
        return lower[min(guard.lowered, len(lower) - 1)]

    @property
    def means(self) -> Means:
        """What the guard may do to end an oscillation."""
        return Means(
            self.soft is not None,
            len(self.lowered),
            [min(each.crossover for each in found) for found in self.normal.margins],
        )
