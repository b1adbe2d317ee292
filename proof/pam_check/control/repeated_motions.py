"""How the error of a repeated motion falls while the controller learns it.

`pam check learning` hides an effect, or several at once, in the independent plant of the
blind check, gives the controller the nominal rig file, and repeats one motion. Nothing is known
before the first repetition.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Final

from pam_check.blind.effect_cases import KNOWN, size_of
from pam_check.blind.truth_plant import Sensors, TruthJoint
from pam_check.control.closed_loop import (
    APPROACH,
    MOTIONS_BEGIN_AT,
    TOLD,
    Muscles,
    PlayedRun,
    RunTrace,
    play,
    true_rig,
)
from pam_check.control.hidden_rigs import NOTHING
from pam_check.control.rough_control import RoughControl
from pam_control.controller import Controller
from pam_control.references.trajectory import TrajectoryPoint
from pam_model.command_line import Arguments, Outcome, progress
from pam_model.common_options import chosen_rig
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig

MOTION: Final = "arm"
LEAST_GAIN: Final = 4.0
"""By how much five repetitions shall reduce the error of the first."""
WORSE: Final = 1.05
"""How much above the first a repetition may be; below it, repetitions differ by their noise."""
SMALL: Final = 5e-4
"""Errors below this need no learning [rad]; a rig that is its file has 0.2 mrad."""
ENCODER_NOISE: Final = math.hypot(Sensors().position_noise, Sensors().position_step / 12**0.5)
"""Standard deviation of what the encoder shows [rad]: what it hides cannot be learnt."""


@dataclass(frozen=True, slots=True)
class Repetitions:
    """The repetitions of one motion.

    Attributes
    ----------
    hidden : str
        Effects, joined by "+".
    errors : list of float
        RMS error of each repetition [rad].
    ended : str
        Why learning ended by itself; empty if it did not.
    """

    hidden: str
    errors: list[float]
    ended: str

    def problems(self) -> list[str]:
        """What is not as it should be."""
        first, last = self.errors[0], self.errors[-1]
        found = []
        if max(self.errors) > max(WORSE * first, SMALL):
            found.append(
                f"{self.hidden}: a repetition has {max(self.errors) / first:.2f} times "
                "the error of the first"
            )
        if first > SMALL and last > max(first / LEAST_GAIN, ENCODER_NOISE):
            found.append(f"{self.hidden}: the last has {last / first:.2f} of the first error")
        return found


def hide(rig: Rig, names: str) -> tuple[TruthJoint, Muscles]:
    """The true rig with all effects of a list like "hysteresis+payload".

    Raises
    ------
    PamError
        For an unknown name.
    """
    joint, muscles = true_rig(rig)
    for name in names.split("+"):
        if name == NOTHING:
            continue
        if name not in KNOWN:
            known = ", ".join([NOTHING, *KNOWN])
            raise PamError(f"--effects {names}: {name} is unknown; expected some of {known}")
        joint, muscles = size_of(name).applied(joint, muscles)
    return joint, muscles


def from_start(points: Sequence[TrajectoryPoint]) -> list[TrajectoryPoint]:
    """The motion, which first brings the joint to where motions begin.

    The joint is taken over where its encoder shows it, a step beside its place: without time to go
    there, each repetition would begin with another jerk, which nobody can learn.
    """
    return [
        TrajectoryPoint(APPROACH[1], [MOTIONS_BEGIN_AT], [0.0], [0.0]),
        *(replace(each, time_from_start=each.time_from_start + APPROACH[1]) for each in points),
    ]


def learnt(
    controller: Controller,
    joint: TruthJoint,
    muscles: Muscles,
    points: Sequence[TrajectoryPoint],
    repetitions: int,
    seed: int,
) -> tuple[list[PlayedRun], RunTrace, str]:
    """Repeat a motion of `from_start`; return all figures, the last trace, and why learning ended.

    The controller forgets what it knew before. Its settings name a motion to learn.
    """
    controller.forget_adaptation()
    for name in ("", MOTION):  # a motion that is named anew begins anew
        controller.change(controller.prepared.asked.replace(learning_motion=name))
    learner = controller.channels[0].setup.learner
    assert learner is not None
    every = []
    for index in range(repetitions):
        played, trace = play(controller, joint, muscles, points, seed + index, goes_to=None)
        learner.wait()
        every.append(played)
    return every, trace, learner.motion.ended


def repeat(rough: RoughControl, hidden: str, repetitions: int, seed: int) -> Repetitions:
    """Repeat the motion with what is hidden, from a controller that has learnt nothing."""
    joint, muscles = hide(rough.rig, hidden)
    points = from_start(rough.motions[MOTION])
    played, _, ended = learnt(rough.controller, joint, muscles, points, repetitions, seed)
    return Repetitions(hidden, [each.rms for each in played], ended)


def _row(result: Repetitions) -> str:
    errors = " ".join(f"{1e3 * error:7.2f}" for error in result.errors)
    return f"{result.hidden:36s} {errors}  {result.ended}".rstrip()


def run(given: Arguments) -> Outcome:
    """Repeat the motion with every effect and print the table.

    Raises
    ------
    PamError
        For a rig or an effect that cannot be used.
    """
    chosen: Sequence[str] = given.effects
    rig = load_rig(chosen_rig(given))
    for hidden in chosen:
        hide(rig, hidden)
    settings = TOLD.replace(adaptation=True, learning_motion=MOTION)
    rough = RoughControl(rig, settings, given.seed)
    results: list[Repetitions] = []
    print(f"{'hidden':36s} RMS error of each repetition [mrad]")
    with progress(len(chosen), "effects") as bar:
        for done, hidden in enumerate(chosen, start=1):
            results.append(repeat(rough, hidden, given.repetitions, given.seed))
            print(_row(results[-1]), flush=True)
            bar.show(done, hidden)
    problems = [problem for result in results for problem in result.problems()]
    return Outcome({"seed": given.seed, "results": [asdict(each) for each in results]}, problems)
