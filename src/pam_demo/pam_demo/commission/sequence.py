"""The sequence of a commissioning: check, move, identify, go on, until the joint tracks.

Every step is shown and may be refused. Whatever does not fit ends the sequence: a finding of the
start-up check, exchanged signs or hoses, a motion that leaves the limits or what was foreseen for
the least favourable robot, and motions that no numbers of a rig explain. Recordings are kept as
they are made, so that an interrupted commissioning goes on after the last one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Final

import pandas as pd

from pam_control.controller import Controller
from pam_control.references.trajectory import TrajectoryPoint
from pam_demo.commission.commissioned import Commissioned, SequenceStep
from pam_demo.commission.exchange import (
    BY_RIG_FILE,
    Confirm,
    CrossedPort,
    Mend,
    nobody,
    question,
    rewired,
    said_of,
    why_not,
)
from pam_demo.commission.expected_tracking import (
    NoisyPort,
    doubt,
    expected,
    noise_of,
)
from pam_demo.commission.kept import Kept
from pam_demo.commission.knowledge import (
    Known,
    as_written,
    easily_turned,
    narrowed,
    reaching_limits,
)
from pam_demo.commission.least_favourable import Permitted, least_favourable, permitted
from pam_demo.commission.lower_priority import Compute, at_same_priority
from pam_demo.commission.motion_loop import scale_of
from pam_demo.commission.motions import SampledMotion, Scale, filling, staircase, steps
from pam_demo.commission.play import Finding, Played, play, start_up_check, touch
from pam_demo.commission.robot_port import RobotPort
from pam_demo.commission.simulated_port import SimulatedPort
from pam_demo.commission.tracking import (
    Tracked,
    controller_for,
    designed_gains,
    not_possible,
    reaches,
    track,
)
from pam_demo.commission.watch import STOOD_STILL, Limits
from pam_driver.safety.start_up_check import REPETITIONS
from pam_gap.calibration.calibration import calibrate_joint
from pam_gap.calibration.calibration_rules import CalibrationRules
from pam_gap.calibration.free_numbers import Said
from pam_gap.recordings.recording import Recording, from_columns
from pam_gap.recordings.resample import resample
from pam_model.errors import PamError
from pam_model.rig import Rig
from pam_model.rig.partial import PartialRig

Tell = Callable[[str], None]
Ask = Callable[[str], bool]
FILLING, WITHHELD = "filling", "withheld"
COARSE: Final = 2.0
"""Sample time of the recordings between two motions, over the period of the port."""
QUICK: Final = CalibrationRules(rounds=1, last_steps=6, undamped_steps=2)
"""For the numbers between two motions; the last identification takes all its steps."""
FULL: Final = CalibrationRules()
PARTS: Final[Sequence[tuple[Sequence[str], CalibrationRules]]] = (
    (("filling", "staircase"), QUICK),
    (("steps",), QUICK),
    (("fast", "withheld"), FULL),
)
"""Motions, and how the numbers are identified after them."""
FORESEEN_SPEED: Final = 1.5
"""The limit of the speed in a motion, over the speed of the least favourable robot. The motion ends
at the same share of it as of any limit, which is 1.2 times that speed."""
LEAST_SHARE: Final = 0.1
WAY_TIME: Final = (0.6, 0.8, 1.1, 1.5, 2.0, 3.0)
"""Durations of a way as long as the reach that the tracking test tries, the fastest first [s]."""
TRACKING_SHARES: Final = (0.9, 0.6, 0.9)
"""Shares of the limits that a foreseen tracking test may use: pressure, speed, distance."""


class EndedError(PamError):
    """Why the sequence ends."""


@dataclass(slots=True)
class Commissioning:
    """One joint, from a rough rig file to tracking."""

    port: RobotPort  # the robot, vented
    partial: PartialRig  # its rig file, with this joint alone
    said: Said  # how far plain numbers may be off
    kept: Kept  # where recordings and results are kept
    tell: Tell  # shows a line
    ask: Ask  # whether the next step may be done; it gets the step in words
    compute: Compute = at_same_priority  # calls what takes seconds between two motions
    confirm: Confirm = nobody  # whether a person says that something is exchanged, or mended
    result: Commissioned = field(default_factory=Commissioned)

    def run(self) -> Commissioned:
        """Go through the sequence."""
        result = self.result
        try:
            rig, known = self.check()
            seen: dict[str, pd.DataFrame] = {}
            for (names, rules), (later, _) in pairwise((*PARTS, ((), FULL))):
                seen |= self._motions(names, rig, known)
                if later and all(name in self.kept for name in later):
                    continue  # nothing is planned with what would be identified
                self._identify(seen, rules)
                assert result.calibration is not None
                if result.calibration.rig is not None:
                    rig = result.calibration.rig
                    known = narrowed(known, result.calibration.numbers)
            result.rig = rig
            self._track()
        except EndedError as error:
            result.ended = str(error)
            result.rig = None
            self.tell(f"ended: {error}")
        result.seconds = self.kept.seconds
        return result

    def _allowed(self, what: str) -> None:
        if not self.ask(what):
            raise EndedError(f"not agreed to: {what}. Start the same command again to go on.")

    def _uninterrupted[T: (Played, Tracked)](self, what: str, once: Callable[[], T]) -> T:
        """What was played, if allowed; once more where the computer stood still meanwhile."""
        self._allowed(what)
        done = once()
        for _ in range(REPETITIONS):
            if not done.stopped.startswith(STOOD_STILL):
                break
            self.tell(f"{done.stopped}: the air was let out slowly, and it begins again")
            self._allowed(f"once more: {what}")
            done = once()
        return done

    def check(self) -> tuple[Rig, tuple[Known, ...]]:
        """Check valves, hoses and sensors; returns the rig to begin with, and what is known of it.

        Raises
        ------
        EndedError
            If something is at the wrong place, or the check is not allowed.
        """
        # what the rig file describes otherwise may have been put right at the robot since
        again = bool(self.kept.exchanged)
        if again:
            self._rewire(Mend(self.kept.exchanged))
        while True:
            rig = reaching_limits(self.partial.rig, as_written(self.partial, self.said, FULL))
            known = as_written(replace(self.partial, rig=rig), self.said, FULL)
            if self.kept.checked and not again:
                self.tell("start-up check: passed before")
                return rig, known
            first, second = rig.joints[0].muscles
            self._allowed(
                f"open each valve for a moment, and give {first} and then {second} a small test "
                "pulse; watch which of them swells"
            )
            reason = touch(self.port, rig)
            findings = (
                (Finding(reason),)
                if reason
                else start_up_check(self.port, easily_turned(rig, known, self.said))
            )
            if not findings:
                self.tell("start-up check: valves, hoses, sensors and encoder belong together")
                self.kept.check()
                return rig, known
            reason = reason or " ".join(f"Start-up check: {one.text}." for one in findings)
            self._mended(reason, findings[0])

    def _mended(self, reason: str, first: Finding) -> None:
        """Put right what the start-up check has found, as a person says; or end."""
        if first.turns_wrong and self.kept.exchanged:
            reason += (
                f" This commissioning goes on with what was found before: {self.result.exchanged} "
                "If it was put right at the robot since, begin again with another folder (--out)."
            )
        self.tell(reason)
        by_rig_file = BY_RIG_FILE if first.turns_wrong and not self.kept.exchanged else ()
        for mend in (*by_rig_file, Mend.AT_ROBOT):
            if self.confirm(mend, question(self.partial, mend)):
                break
        else:
            raise EndedError(reason)
        if mend in by_rig_file:
            problem = why_not(self.partial, mend)
            if problem:
                raise EndedError(f"{reason} {problem}")
            self.kept.exchange(mend.value)
            self._rewire(mend)
            if first.is_complete:  # with the muscles changed over, all pulses were right
                self.kept.check()

    def _rewire(self, mend: Mend) -> None:
        """Go on with a rig file that describes what is exchanged."""
        self.result.exchanged = said_of(self.partial, mend)
        self.tell(self.result.exchanged)
        self.partial = rewired(self.partial, mend)
        self.port = CrossedPort.of(self.port)

    def _made(self, name: str, scale: Scale) -> SampledMotion:
        return {
            "filling": lambda: filling(scale),
            "staircase": lambda: staircase(scale),
            "steps": lambda: steps(scale, "steps", 0.5, 20.0, 1),
            "fast": lambda: steps(scale, "fast", 1.0, 30.0, 2),
            "withheld": lambda: steps(scale, "withheld", 0.8, 15.0, 3),
        }[name]()

    def _motions(
        self, names: Sequence[str], rig: Rig, known: Sequence[Known]
    ) -> dict[str, pd.DataFrame]:
        """Play what has not been played yet, as large as the least favourable robot permits."""
        scale, limits = scale_of(rig, self.port.period), Limits.of(rig)
        found: dict[str, pd.DataFrame] = {}
        robots: Sequence[Mapping[str, float]] | None = None
        for name in names:
            table = self.kept.recording(name)
            if table is None:
                motion = self._made(name, scale)
                if robots is None:
                    judged = self._made(names[-1] if name == FILLING else name, scale)
                    search = partial(least_favourable, rig, known, judged, scale, limits)
                    self.tell("computing how large the next motion may be")
                    robots = self.compute(search)
                allowed = self.compute(partial(permitted, rig, robots, motion, scale, limits))
                table = self._play(motion, allowed, rig, scale, limits)
            else:
                self.tell(f"{name}: recorded before")
            if name != FILLING:  # it shows little of any number
                found[name] = table
        return found

    def _play(
        self, motion: SampledMotion, allowed: Permitted, rig: Rig, scale: Scale, limits: Limits
    ) -> pd.DataFrame:
        worst = allowed.worst
        if allowed.share < LEAST_SHARE:
            raise EndedError(
                f"{motion.name}: too little is known of this robot. On the least favourable one "
                f"that the numbers permit, even a small motion would use {worst.pressure:.0%} of "
                f"the pressure, {worst.speed:.0%} of the speed and {worst.distance:.0%} of the "
                "range. State numbers more narrowly."
            )
        # the watch ends what the least favourable robot would not do
        fits = max(FORESEEN_SPEED * worst.speed, 0.2)
        watched = replace(limits, speed=min(limits.speed, fits * limits.speed))
        gentle = motion.smaller(allowed.share).gentler(allowed.pace)
        played = self._uninterrupted(
            f"{motion.title} ({motion.duration:.0f} s, {allowed.share:.0%} of the usual size; the "
            f"least favourable robot would use {worst.speed:.0%} of the permitted speed)",
            partial(play, self.port, rig, gentle, scale, watched),
        )
        pressure, speed, place = played.most
        most = (pressure, speed * watched.speed / limits.speed, place)
        expected = (worst.pressure, worst.speed, worst.distance)
        self.result.steps.append(
            SequenceStep(motion.name, motion.title, allowed.share, expected, most)
        )
        if played.stopped:
            self.kept.failed(motion.name, played.table)
            raise EndedError(
                f"{motion.name}: {played.stopped}; the air was let out slowly. With what is known "
                f"of its numbers, no robot exceeds {worst.speed * limits.speed:.2g} rad/s here: if "
                "the joint was faster, a number is further off than was stated (--tolerance)."
            )
        self.kept.add(motion.name, played.table)
        self.tell(f"{motion.name}: {most[1]:.0%} of the permitted speed, {most[0]:.0%} of the "
                  "permitted pressure")  # fmt: skip
        return played.table

    def _identify(self, seen: Mapping[str, pd.DataFrame], rules: CalibrationRules) -> None:
        step = None if rules is FULL else COARSE * self.port.period
        read = {name: as_recording(table, name, step) for name, table in seen.items()}
        withheld = [read.pop(WITHHELD)] if WITHHELD in read else []
        fitted = list(read.values())
        self.tell(f"identifying numbers from {', '.join(seen)}")
        found = self.compute(
            lambda: calibrate_joint(self.partial, 0, fitted, withheld, said=self.said, rules=rules)
        )
        self.result.calibration = found
        if found.wiring:
            raise EndedError(" ".join(found.wiring))
        if found.refused and (rules is FULL or found.numbers):
            raise EndedError(" ".join(found.refused))
        if found.refused:
            self.tell(f"nothing identified yet: {' '.join(found.refused)}")

    def _track(self) -> None:
        """The tracking test with the identified rig, and with the rig file as it was."""
        result, port = self.result, self.port
        assert result.rig is not None
        scale, limits = scale_of(result.rig, port.period), Limits.of(result.rig)
        try:
            controller = self.compute(partial(controller_for, port, result.rig))
        except PamError as error:
            result.after = not_possible(error)
            raise EndedError(f"no safe controller for the identified numbers: {error}") from None
        result.gains = designed_gains(controller)
        for time in WAY_TIME:
            points = reaches(scale.middle, scale.reach, time)
            model = self._simulated(result.rig, controller, points, limits)
            if _permitted(model):
                break
        else:
            raise EndedError("no tracking test is within the limits of the identified robot")
        result.points = points
        result.after = self._uninterrupted(
            "follow a motion with the identified rig file",
            partial(track, port, controller, points, limits),
        )
        self.kept.track("after", result.after.table)
        result.before = self._before(points, limits)
        self.kept.track("before", result.before.table)
        if result.after.stopped:
            raise EndedError(f"tracking test: {result.after.stopped}")
        before = result.before.stopped or f"{1e3 * result.before.rms:.2f} mrad RMS"
        self.tell(
            f"tracking error with the identified rig file: {1e3 * result.after.rms:.2f} mrad RMS; "
            f"with the rig file as it was: {before}"
        )
        self.tell("simulating how well a robot with these numbers should track")
        self._judge(lambda simulated: track(simulated, controller, points, limits))

    def _judge(self, test: Callable[[NoisyPort], Tracked]) -> None:
        """Whether the joint tracks as it should with the numbers that were identified."""
        result = self.result
        assert result.rig is not None
        assert result.calibration is not None
        assert result.after is not None
        assert result.calibration.posterior is not None
        noise, posterior = noise_of(result.calibration), result.calibration.posterior
        result.expected = self.compute(
            partial(expected, result.rig, posterior, noise, self.port.period, test)
        )
        result.doubt = doubt(result.after.rms, result.expected, result.calibration.numbers)
        if result.doubt:
            self.tell(result.doubt)

    def _simulated(
        self, rig: Rig, controller: Controller, points: Sequence[TrajectoryPoint], limits: Limits
    ) -> Tracked:
        """The tracking test on a simulated robot."""
        simulated = SimulatedPort(rig, self.port.period)
        return self.compute(partial(track, simulated, controller, points, limits))

    def _before(self, points: Sequence[TrajectoryPoint], limits: Limits) -> Tracked:
        """The same test with the rough rig file, on the robot only if the model survives it."""
        try:
            controller = self.compute(partial(controller_for, self.port, self.partial.rig))
        except PamError as error:
            return not_possible(error)
        assert self.result.rig is not None
        model = self._simulated(self.result.rig, controller, points, limits)
        if not _permitted(model):
            reason = model.stopped or "too near to the limits"
            return replace(model, stopped=f"only simulated, on the identified robot: {reason}")
        return self._uninterrupted(
            "follow the same motion with the rig file as it was",
            partial(track, self.port, controller, points, limits),
        )


def _permitted(tracked: Tracked) -> bool:
    return not tracked.stopped and all(
        share <= most for share, most in zip(tracked.most, TRACKING_SHARES, strict=True)
    )


def as_recording(table: pd.DataFrame, name: str, step: float | None = None) -> Recording:
    """A recording as the import of a table makes it, at its own sample time or another one [s]."""
    columns = {c: table[c].to_numpy(dtype=float) for c in table.columns if c != "time"}
    return resample(from_columns(Path(name), table["time"].to_numpy(dtype=float), columns), step)
