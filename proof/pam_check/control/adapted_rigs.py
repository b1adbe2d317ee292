"""How good a rig file is that was written from what the controller has learnt.

`pam check adapted-rig` draws rigs whose numbers differ from the rig file within its
tolerance, and which have a load, grease and dry friction that nobody has written down, in the
independent plant of the blind check. The controller plays the arm motion, and what it has learnt is
written as a rig file. Two controllers without adaptation then play the motions of the table of
rough rigs: one with the rig file as it was, one with the file that was written.
"""

from __future__ import annotations

import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import numpy as np

from pam_check.blind.truth_plant import TruthJoint
from pam_check.control.closed_loop import TOLD, play, true_rig
from pam_check.control.drawn_stiffness import drawn
from pam_check.control.rough_control import RoughControl
from pam_control.adapted_rig import adapted_rig, learnt_of, save_adapted_rig
from pam_control.controller import Controller
from pam_model.command_line import Arguments, Outcome, progress
from pam_model.common_options import chosen_rig
from pam_model.rig import load_rig

MOTION: Final = "arm"
MOST_MASS: Final = 1.2  # kg
DISTANCES: Final = (0.15, 0.3)  # m
MOST_GREASE: Final = 0.35  # N m s/rad
MOST_FRICTION: Final = 0.6  # N m
GRAVITY: Final = 9.81  # m/s^2
LEAST_COVERED: Final = 0.85  # of the intervals of 90 %, of few draws
LEAST_GAIN: Final = 2.0  # by which the written file shall reduce the error


@dataclass(frozen=True, slots=True)
class AdaptedDraw:
    """One drawn rig.

    Attributes
    ----------
    before, after : dict of str to float
        RMS error of each motion with the rig file and with the written one [rad].
    covered : dict of str to bool
        By number, whether its interval contains the true one.
    """

    before: dict[str, float]
    after: dict[str, float]
    covered: dict[str, bool]

    @property
    def share(self) -> float:
        """Error after over before, in the worse motion [-]."""
        return max(self.after[name] / self.before[name] for name in self.before)


def loaded(joint: TruthJoint, random: np.random.Generator) -> TruthJoint:
    """The joint with a drawn load and drawn friction."""
    mass, distance = random.uniform(0.0, MOST_MASS), random.uniform(*DISTANCES)
    dry = random.uniform(0.0, MOST_FRICTION) * random.integers(2)
    return joint._replace(
        gravity_torque=joint.gravity_torque + mass * GRAVITY * distance,
        inertia=joint.inertia + mass * distance**2,
        viscous_friction=joint.viscous_friction + random.uniform(0.0, MOST_GREASE),
        coulomb_torque=dry,
        static_torque=dry,
    )


def run_draw(learning: RoughControl, written: RoughControl, seed: int, folder: Path) -> AdaptedDraw:
    """Draw a rig, learn it, write its file, and compare the two files.

    Raises
    ------
    PamError
        When the controller refuses to write a file.
    """
    random = np.random.default_rng(seed)
    joint, muscles = drawn(*true_rig(learning.rig), learning.rig.parameter_tolerance, random)
    joint = loaded(joint, random)
    learning.controller.forget_adaptation()
    play(learning.controller, joint, muscles, learning.motions[MOTION], seed)
    learnt = [learnt_of(channel) for channel in learning.controller.channels]
    path = folder / f"adapted_{seed}.yaml"
    save_adapted_rig(adapted_rig(learning.rig, learnt), path)
    adapted = Controller(load_rig(path), TOLD.replace(adaptation=False), learning.designs)
    truth = {
        "inertia": joint.inertia,
        "viscous_friction": joint.viscous_friction,
        "gravity_torque": joint.gravity_torque,
        "coulomb_friction.torque": joint.coulomb_torque,
    }
    before, after = (
        {
            name: play(law, joint, muscles, points, seed)[0].rms
            for name, points in written.motions.items()
        }
        for law in (written.controller, adapted)
    )
    covered = {
        number.key: bool(number.low <= truth[number.key] <= number.high)
        for number in learnt[0].numbers.numbers
        if number.key in truth
    }
    return AdaptedDraw(before, after, covered)


def run(given: Arguments) -> Outcome:
    """Draw rigs and print the table; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        For a rig that cannot be used.
    """
    rig = load_rig(chosen_rig(given))
    learning = RoughControl(rig, TOLD.replace(adaptation=True), given.seed)
    written = RoughControl(rig, TOLD.replace(adaptation=False), given.seed)
    results: list[AdaptedDraw] = []
    print("RMS error without adaptation, arm / chirp [mrad]: rig file, file that was written")
    with progress(given.draws, "draws") as bar, tempfile.TemporaryDirectory() as folder:
        for number in range(given.draws):
            found = run_draw(learning, written, 1000 * given.seed + number, Path(folder))
            results.append(found)
            before, after = (
                " / ".join(f"{1e3 * error:6.2f}" for error in errors.values())
                for errors in (found.before, found.after)
            )
            outside = [key for key, inside in found.covered.items() if not inside]
            note = f"  outside its interval: {', '.join(outside)}" if outside else ""
            print(f"{before}   {after}{note}", flush=True)
            bar.show(number + 1, f"{found.share:.2f}")
    inside = [each for result in results for each in result.covered.values()]
    covered = float(np.mean(inside))
    halved = sum(result.share <= 1.0 / LEAST_GAIN for result in results)
    print(
        f"{len(results)} draws: {halved} with at most half the error in both motions, median "
        f"{np.median([result.share for result in results]):.2f} of it in the worse one; "
        f"{covered:.0%} of {len(inside)} intervals hold the true number"
    )
    problems = [
        f"draw {number}: {result.share:.2f} times the error with the file that was written"
        for number, result in enumerate(results)
        if result.share > 1.0
    ]
    if covered < LEAST_COVERED:
        problems.append(f"only {covered:.0%} of the intervals hold the true number")
    return Outcome(
        {"seed": given.seed, "results": [asdict(each) for each in results], "covered": covered},
        problems,
    )
