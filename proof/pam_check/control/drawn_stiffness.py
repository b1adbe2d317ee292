"""How well the controller knows the stiffness of a joint whose dimensions are a little off.

`pam check stiffness` draws rigs whose numbers differ from the rig file within its
tolerance, in the independent plant of the blind check, and plays the arm motion, or the small test
motion of a joint that rests (`stiffness_test.amplitude`), at a drawn position. The true stiffness
at the true pressures and angle is the derivative of the ideal braided muscle (Chou and Hannaford,
1996, equation 8) with the drawn numbers: r^2 times the sum of 6 p L/(4 pi n^2).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import asdict, dataclass
from typing import Final

import numpy as np

from pam_check.blind.truth_plant import TruthJoint
from pam_check.control.closed_loop import MOTIONS_BEGIN_AT, TOLD, Muscles, play, true_rig
from pam_check.control.rough_control import RoughControl
from pam_control.references.sine_burst import sine_burst
from pam_model.command_line import Arguments, Outcome, progress
from pam_model.common_options import chosen_rig
from pam_model.rig import load_rig

JOINT_FIELDS: Final = ("pulley_radius", "inertia", "viscous_friction", "gravity_torque")
MUSCLE_FIELDS: Final = ("thread_length", "turns", "neutral_length", "dead_volume")
PLACES: Final = (0.45, 0.55, 0.65, 0.75, 0.85)  # of the run, where the stiffness is compared
MOTION: Final = "arm"
TEST_FREQUENCY: Final = 1.5  # Hz
MOST: Final = 0.05  # relative error
LEAST_COVERED: Final = 0.85  # of the intervals of 90 %, of few draws


@dataclass(frozen=True, slots=True)
class DrawnStiffness:
    """One drawn rig.

    Attributes
    ----------
    model_error, error : float
        Largest relative error of the model's and of the corrected stiffness [-].
    covered : float
        Share of the places where the interval contains the true stiffness [-].
    width : float
        Mean half width of the intervals, relative [-].
    learnt : bool
        Whether the stiffness was corrected.
    """

    model_error: float
    error: float
    covered: float
    width: float
    learnt: bool


def drawn(
    joint: TruthJoint, muscles: Muscles, tolerance: float, random: np.random.Generator
) -> tuple[TruthJoint, Muscles]:
    """The rig with every number changed within the tolerance."""

    def factor() -> float:
        return float(random.uniform(1.0 - tolerance, 1.0 + tolerance))

    changed = {name: factor() * getattr(joint, name) for name in JOINT_FIELDS}
    first, second = (
        muscle._replace(**{name: factor() * getattr(muscle, name) for name in MUSCLE_FIELDS})
        for muscle in muscles
    )
    return joint._replace(**changed), (first, second)


def true_stiffness(
    joint: TruthJoint, muscles: Muscles, pressures: tuple[float, float], position: float
) -> float:
    """r^2 (dF_a/dL + dF_b/dL) at constant pressures [N m/rad]."""
    found = 0.0
    for muscle, pressure, sign in zip(muscles, pressures, (-1.0, 1.0), strict=True):
        length = muscle.neutral_length + sign * joint.pulley_radius * position
        found += 6.0 * pressure * length / (4.0 * math.pi * muscle.turns**2)
    return joint.pulley_radius**2 * found


def run_draw(rough: RoughControl, seed: int, amplitude: float = 0.0) -> DrawnStiffness:
    """Draw a rig, play the motion, and compare the stiffness at some places of the run.

    Parameters
    ----------
    rough : RoughControl
        The controller.
    seed : int
        Of what is drawn.
    amplitude : float
        Of the test motion that is played in place of the arm motion [rad]; 0: the arm motion.
    """
    tolerance = rough.rig.parameter_tolerance
    random = np.random.default_rng(seed)
    joint, muscles = drawn(*true_rig(rough.rig), tolerance, random)
    rough.controller.forget_adaptation()
    points, goes_to = rough.motions[MOTION], MOTIONS_BEGIN_AT
    if amplitude > 0.0:
        goes_to = float(random.uniform(-0.6, 0.6))
        points = sine_burst(goes_to, amplitude, TEST_FREQUENCY)
    _, trace = play(rough.controller, joint, muscles, points, seed, goes_to)
    channel = rough.controller.channels[0]
    model_error = error = covered = width = 0.0
    for place in PLACES:
        index = round(place * (len(trace.position) - 1))
        pressures = (float(trace.pressures[index, 0]), float(trace.pressures[index, 1]))
        position = float(trace.position[index])
        truth = true_stiffness(joint, muscles, pressures, position)
        found = channel.law_state.estimates.stiffness.at(pressures, position)
        model_error = max(
            model_error, abs(channel.models.model.stiffness(pressures, position) / truth - 1.0)
        )
        error = max(error, abs(found.value / truth - 1.0))
        covered += (found.low <= truth <= found.high) / len(PLACES)
        width += 0.5 * (found.high - found.low) / found.value / len(PLACES)
    return DrawnStiffness(model_error, error, covered, width, found.learnt)


def run(given: Arguments) -> Outcome:
    """Draw rigs and print the table; the command of `pam_check.__main__`."""
    rig = load_rig(chosen_rig(given))
    rough = RoughControl(rig, dataclasses.replace(TOLD, adaptation=True), given.seed)
    results = []
    print("relative errors of the stiffness [%]: model, corrected; half width; intervals that hold")
    with progress(given.draws, "draws") as bar:
        for number in range(given.draws):
            found = run_draw(rough, 1000 * given.seed + number, given.test_motion)
            results.append(found)
            print(
                f"{100 * found.model_error:6.2f} {100 * found.error:6.2f} {100 * found.width:6.2f} "
                f"{100 * found.covered:5.0f} {'' if found.learnt else 'not learnt'}".rstrip(),
                flush=True,
            )
            bar.show(number + 1, f"{100 * found.error:.1f} %")
    covered = float(np.mean([each.covered for each in results]))
    within = sum(each.error <= MOST for each in results)
    worst = max(each.error for each in results)
    before = max(each.model_error for each in results)
    print(
        f"{len(results)} draws: {within} within {MOST:.0%}, worst {worst:.1%} (model "
        f"{before:.1%}); {covered:.0%} of the intervals hold the true stiffness"
    )
    problems = []
    if within < len(results):
        problems.append(f"{len(results) - within} of {len(results)} draws above {MOST:.0%}")
    if covered < LEAST_COVERED:
        problems.append(f"only {covered:.0%} of the intervals hold the true stiffness")
    return Outcome(
        {"seed": given.seed, "results": [asdict(each) for each in results], "covered": covered},
        problems,
    )
