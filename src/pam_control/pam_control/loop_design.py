"""Design and check of the gains of all joints of a rig, with normal and with soft gains."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from pam_control.declared import changes_loop
from pam_control.feedback.gain_design import DesignTask, design_pressure_gain
from pam_control.feedback.gain_schedule import GainSchedule
from pam_control.feedback.kept_designs import KeptDesigns
from pam_control.feedback.linear_joint import LoopTiming
from pam_control.feedback.margins import (
    ControlDesignError,
    LoopCase,
    Margins,
    checked_margins,
)
from pam_control.feedback.observer_design import ObserverCost
from pam_control.feedback.pid import PidGains
from pam_control.joint_models import JointModels
from pam_control.laws.law import AnyLaw
from pam_control.learning.learning_filter import LearningFilter
from pam_control.learning.learning_session import LearningSession
from pam_control.prepared_settings import Loops, PreparedSettings
from pam_control.settings import ControlSettings
from pam_model.errors import RigError
from pam_model.rig import Rig
from pam_ros.valve_command import PRESSURE_REGULATOR

WARM_UP = 2  # repetitions in which the adaptation learns the rig
LEARNING_FIELDS = ("learning_motion", "learning_file", "adaptation", "default_stiffness")
LOWERED = (0.6, 0.36)  # shares of the gains for a joint that swings a little
STIFFNESS_RANGE = 0.15  # about the default stiffness, for which learning converges


class LoopDesign:
    """Designs and checks the loops of a control law, which says how it is connected to them.

    Parameters
    ----------
    rig : Rig
        What is controlled.
    law : Law
        The control law, with its own parameters.
    designs : KeptDesigns
        Store of designed gains for equal joints and later starts.
    """

    def __init__(
        self, rig: Rig, joints: Sequence[JointModels], law: AnyLaw, designs: KeptDesigns
    ) -> None:
        self.rig, self.joints, self.law, self.designs = rig, joints, law, designs

    def cases(self, models: JointModels, settings: ControlSettings) -> list[LoopCase]:
        """The linearised loops at which a joint's gains are designed and checked."""
        return self.law.cases(models, settings)

    def timing(self, models: JointModels, settings: ControlSettings) -> LoopTiming:
        """The delays of a joint's loop, including the unknown delay that the design assumes.

        Raises
        ------
        RigError
            For a joint with a flow valve and a pressure regulator, for which no gains are designed.
        """
        valves = [muscle.valve for muscle in models.muscles]
        if valves[0].kind != valves[1].kind:
            raise RigError(
                f"{models.name}: its muscles have a {valves[0].kind} and a "
                f"{valves[1].kind} valve; the controller needs the same kind for both"
            )
        return LoopTiming(
            period=settings.period,
            transport_delay=settings.measurement_delay
            + settings.command_delay
            + settings.extra_delay
            + max(models.command_delays)
            + models.pressure_lag,
            valve_time_constant=max(models.valve_time_constants),
            lead_ratio=settings.lead_ratio,
            velocity_filter=settings.derivative_filter,
            regulated=valves[0].kind == PRESSURE_REGULATOR,
            position_delay=models.position_delay,
            valve_damping=min(valve.damping for valve in valves),
            pressure_lag=models.pressure_lag,
        )

    def designed(self, settings: ControlSettings, one_set: bool = False) -> ControlSettings:
        """The settings with every missing gain designed.

        Parameters
        ----------
        settings : ControlSettings
            Some gains may be missing.
        one_set : bool, optional
            The gains do not depend on the stiffness, even with a law for which they usually do.

        Raises
        ------
        ControlDesignError
            When no gains reach the required margins.
        """
        if settings.pressure_gain is None:
            timings = [self.timing(models, settings) for models in self.joints]
            # a pressure regulator closes its own loop and does not limit the gain of the others
            ours = [timing for timing in timings if not timing.regulated] or timings
            settings = settings.replace(pressure_gain=min(map(design_pressure_gain, ours)))
        gains = dict(settings.gains)
        for models in self.joints:
            name = models.name
            if name not in gains:
                given = settings.partial_gains.get(name, {})
                scheduled = self.law.is_scheduled and not one_set
                find = self._schedule if scheduled else self._constant
                gains[name] = find(models, settings).replaced(given)
            if self.law.has_observer and settings.observer and settings.observer_bandwidth > 0.0:
                gains[name] = gains[name].replaced({"observer": settings.observer_bandwidth})
        return settings.replace(gains=gains)

    def _schedule(self, models: JointModels, settings: ControlSettings) -> GainSchedule:
        """Designed gains; at each stiffness of the grid they serve half the way to the next."""
        grid = models.scale.complete(settings).stiffness_grid
        dense = _with_middles(grid)
        near = [dense[max(2 * index - 1, 0) : 2 * index + 2] for index in range(len(grid))]
        gains = (self._found(models, settings.replace(stiffness_grid=each)) for each in near)
        schedule = GainSchedule(grid, tuple(gains))
        try:
            self._margins(models, settings, schedule)
        except ControlDesignError:  # not safe between two stiffnesses
            return self._constant(models, settings)
        return schedule

    def _constant(self, models: JointModels, settings: ControlSettings) -> GainSchedule:
        """Designed gains for the whole range of the stiffness."""
        return GainSchedule.constant(self._found(models, settings))

    def _task(self, models: JointModels, settings: ControlSettings) -> DesignTask:
        return DesignTask(
            tuple(self.cases(models, settings)),
            self.timing(models, settings),
            settings.phase_margin,
            settings.sensitivity,
            settings.derivative_filter,
            unknown_delay=settings.extra_delay,
            lead=self._lead(models, settings),
        )

    def _lead(self, models: JointModels, settings: ControlSettings) -> float:
        """Time constant of the lead on the derivative [s]."""
        if not self.law.has_lead:
            return 0.0
        if self.timing(models, settings).regulated:
            return settings.feedback_lead * max(models.valve_time_constants)
        return settings.feedback_lead / (settings.pressure_gain or math.inf)

    def _found(self, models: JointModels, settings: ControlSettings) -> PidGains:
        """Designed gains; without an observer if none keeps the margins."""
        task, name, tasks = self._task(models, settings), models.name, []
        if self.law.has_observer and settings.feedforward:
            observed = dataclasses.replace(task, motion=settings.motion_observer)
            if settings.observer:
                tasks += [dataclasses.replace(each, has_observer=True) for each in (observed, task)]
            tasks.append(observed)
        for each in tasks:
            with contextlib.suppress(ControlDesignError):
                return self.designs.pid(name, each)
        return self.designs.pid(name, task)

    def _check_observer(self, models: JointModels, settings: ControlSettings) -> None:
        schedule = settings.gains[models.name]
        for stiffness, gains in zip(schedule.stiffnesses, schedule.gains, strict=True):
            if gains.observer == 0.0:
                continue
            near = settings.replace(stiffness_grid=(stiffness,)) if stiffness > 0.0 else settings
            task = self._task(models, near)
            cost = ObserverCost(dataclasses.replace(task, has_observer=True, motion=gains.motion))
            if not cost.stable(gains):
                raise ControlDesignError(
                    f"{models.name}: a disturbance observer of {gains.observer:g} rad/s "
                    f"makes the loop unstable if a measurement is {1e3 * settings.extra_delay:g} "
                    "ms late or the limb is heavier than written"
                )

    def check(self, settings: ControlSettings) -> list[list[Margins]]:
        """Margins of every joint with these settings, the worst operating point first.

        Raises
        ------
        ControlDesignError
            When a loop is not safe.
        """
        found = []
        for models in self.joints:
            self._check_observer(models, settings)
            found.append(self._margins(models, settings, settings.gains[models.name]))
        self._check_bare(settings)
        return found

    def _margins(
        self, models: JointModels, settings: ControlSettings, gains: GainSchedule
    ) -> list[Margins]:
        """Margins of one joint at and between the stiffnesses of the grid, the worst first.

        Raises
        ------
        ControlDesignError
            When a loop is not safe.
        """
        grid = _with_middles(models.scale.complete(settings).stiffness_grid)
        cases = self.cases(models, settings.replace(stiffness_grid=grid))
        timing = self.timing(models, settings)
        stable = self.designs.stable(cases, timing, gains)
        return checked_margins(models.name, cases, timing, gains, stable)

    def _check_bare(self, settings: ControlSettings) -> None:
        """Refuse muscles that are unstable by themselves, if the law needs stable ones."""
        if not self.law.bare:
            return
        none = GainSchedule.constant(PidGains(0.0, 0.0, 0.0, settings.derivative_filter))
        for models in self.joints:
            cases = self.law.bare_cases(models, settings)
            if not all(self.designs.stable(cases, self.timing(models, settings), none)):
                raise ControlDesignError(
                    f"{models.name}: {self.law.bare} unstable with pressure loops of "
                    f"{settings.pressure_gain or 0.0:g} 1/s; a lower pressure_loop.gain may be "
                    "stable"
                )

    def is_quick(self, settings: ControlSettings, before: PreparedSettings) -> bool:
        """Whether `changed` only copies: it designs, checks and reads nothing."""
        return (
            not self._changes_loop(settings, before)
            and settings.default_stiffness == before.asked.default_stiffness
            and self._learns_as_before(settings, before.asked)
        )

    def _changes_loop(self, settings: ControlSettings, before: PreparedSettings) -> bool:
        return settings.changes_loop(before.asked) or changes_loop(self.law, before.law)

    def prepared(self, settings: ControlSettings) -> PreparedSettings:
        """Design and check settings, which may take minutes.

        Raises
        ------
        ControlDesignError
            When a loop would not be safe.
        """
        return self._with_learning(self._designed_and_checked(settings))

    def changed(self, settings: ControlSettings, before: PreparedSettings) -> PreparedSettings:
        """The same, with the loops of other settings where nothing else is needed.

        Raises
        ------
        ControlDesignError
            When a loop would not be safe.
        """
        if self._changes_loop(settings, before):
            return self.prepared(settings)
        normal, soft = before.normal, before.soft
        prepared = PreparedSettings(
            settings,
            self.law,
            normal.changed_to(settings),
            soft and soft.changed_to(settings),
            lowered=tuple(each.changed_to(settings) for each in before.lowered),
        )
        if self._learns_as_before(settings, before.asked):
            return dataclasses.replace(prepared, learning=before.learning)
        return self._with_learning(prepared)

    def _learns_as_before(self, settings: ControlSettings, before: ControlSettings) -> bool:
        return not (self._learns(before) or self._learns(settings)) or all(
            getattr(settings, name) == getattr(before, name) for name in LEARNING_FIELDS
        )

    def _learns(self, settings: ControlSettings) -> bool:
        """Whether repeated motions are learnt."""
        return bool(settings.learning_motion) and self.law.has_adaptation and settings.feedforward

    def _with_learning(self, prepared: PreparedSettings) -> PreparedSettings:
        """With the learning that the settings ask for.

        Raises
        ------
        PamError
            For a file that cannot be read; ControlDesignError if no learning filter converges.
        """
        settings = prepared.normal.settings
        if not self._learns(settings):
            return prepared
        told = settings.replace(extra_delay=0.0)
        filters = {
            models.name: LearningFilter(
                models.name,
                self.cases(models, told.replace(stiffness_grid=_near_stiffness(models, settings))),
                self.timing(models, told),
                settings.gains[models.name].at(models.scale.complete(settings).default_stiffness),
            )
            for models in self.joints
        }
        path = Path(settings.learning_file) if settings.learning_file else None
        warm_up = WARM_UP if settings.adaptation else 1
        session = LearningSession(
            self.rig,
            settings.learning_motion,
            path,
            filters,
            settings.period,
            warm_up,
            read=self.designs.compute,
        )
        return dataclasses.replace(prepared, learning=session)

    def _designed_and_checked(self, settings: ControlSettings) -> PreparedSettings:
        designed = self.designed(settings)
        normal = Loops(designed, self.check(designed))
        lowered = self._lowered(normal)
        if settings.safe_delay <= settings.extra_delay:
            return PreparedSettings(settings, self.law, normal, None, lowered=lowered)
        soft: Loops | None = None
        with contextlib.suppress(ControlDesignError):
            asked = settings.replace(
                extra_delay=settings.safe_delay,
                feedback_lead=0.0,
                motion_observer=0.0,
                pressure_gain=None,
                gains={},
                partial_gains={},
                observer=False,
            )
            designed = self.designed(asked, one_set=True)
            soft = Loops(designed, self.check(designed), soft=True)
        return PreparedSettings(settings, self.law, normal, soft, lowered=lowered)

    def _lowered(self, normal: Loops) -> tuple[Loops, ...]:
        """Loops with lower and lower gains, as long as they are safe.

        The muscles are a spring, so that most joints need no feedback to be stable. Without
        feedforward, one that gravity turns over does.
        """
        found = []
        with contextlib.suppress(ControlDesignError):
            for share in LOWERED:
                loops = normal.lowered(share)
                found.append(dataclasses.replace(loops, margins=self.check(loops.settings)))
        return tuple(found)


def _with_middles(grid: tuple[float, ...]) -> tuple[float, ...]:
    """Increasing stiffnesses and those in the middle between two of them."""
    middles = [0.5 * (low + high) for low, high in pairwise(grid)]
    return tuple(sorted((*grid, *middles)))


def _near_stiffness(models: JointModels, settings: ControlSettings) -> tuple[float, ...]:
    stiffness = models.scale.complete(settings).default_stiffness
    return tuple(share * stiffness for share in (1.0 - STIFFNESS_RANGE, 1.0, 1.0 + STIFFNESS_RANGE))
