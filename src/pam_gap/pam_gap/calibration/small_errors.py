"""Small errors of valves and sensors that every good rig has, beside the numbers of a calibration.

The play of a valve is known to be there, and it looks like a slower valve: it is assumed in its
usual width, and the width of each valve is fitted. Creep of the bladders over decades of time,
zeros and gains of regulators, nonlinearity and drift of sensors are changes of the errors in
amounts that are fitted, as in a diagnosis (`pam_gap.inference.background`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pam_gap.calibration.calibration_rules import CalibrationRules
from pam_gap.inference.background import encoder_changes, play, play_width, sensor_parts
from pam_gap.prediction.channels import Channels
from pam_gap.prediction.fit import Array, FreeParameter
from pam_gap.prediction.linear_terms import LinearTerms
from pam_gap.prediction.problem import PredictionProblem
from pam_model.plant.muscle_arms import SIDES
from pam_model.plant.parameters import INDEX

USUAL, SPREAD, MOST = 0.75, 0.3, 1.5
"""Width of the play of a valve over the largest ordinary one: mean, deviation and most."""
STEP = 0.25
"""Step of the width, in ordinary ones, for the derivative."""
VALVES = 2
CREEP_TIMES = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
"""Time constants of the creep of a bladder [s]: rubber relaxes over decades of time, which a sum of
elements describes (Ferry, Viscoelastic Properties of Polymers, Wiley 1980). The shortest one is
that of the fastest motion, 2 Hz: what relaxes within it would be taken for viscous friction."""
CREEP_RATIO = 0.01
"""Unit of the amount of each element, over the stiffness of the braid at 3 bar."""
LONG_STROKE = 4.0
"""Stroke over which the last threads begin to slide, over that of the fit: published strokes reach
from 0.2 to 2 mm, and threads of one muscle begin one after another. What slides late would be taken
for viscous friction or creep."""
LATE_FRICTION, LATE_SPREAD = 0.01, 0.5
"""Unit of the amount of late friction, as the amplitude of a hysteresis, and its deviation."""


@dataclass(frozen=True, slots=True)
class ValvePlay:
    """The width of the play of both valves, over the largest ordinary one; () without commands."""

    widths: tuple[float, ...]

    @classmethod
    def usual(cls, problem: PredictionProblem) -> ValvePlay:
        """As good valves have it."""
        return cls((USUAL,) * VALVES if problem.has_commands else ())

    def applied(self, problem: PredictionProblem) -> PredictionProblem:
        """The problem with the commands as such valves follow them."""
        if not self.widths:
            return problem
        half = 0.5 * play_width(problem)

        def change(data: Channels) -> Channels:
            spools = [
                play(command, width * half)
                for command, width in zip(data.commands.T.tolist(), self.widths, strict=True)
            ]
            return replace(data, commands=np.ascontiguousarray(np.transpose(spools)))

        return problem.with_data(change)

    def moved(self, amounts: Array) -> ValvePlay:
        """The widths after a fit found these changes of them, which come first in `amounts`."""
        changes = amounts[: len(self.widths)].tolist()
        return ValvePlay(tuple(w + a for w, a in zip(self.widths, changes, strict=True)))


def small_errors(
    problem: PredictionProblem, valves: ValvePlay, vector: Array, rules: CalibrationRules
) -> LinearTerms:
    """Changes of the errors by small errors of valves and sensors.

    Parameters
    ----------
    problem : PredictionProblem
        The recordings as they are.
    valves : ValvePlay
        The play about which the changes are taken; those of its widths come first.
    vector : ndarray, shape (n_parameters,)
        The plant.
    rules : CalibrationRules
        Weight of what is usual.
    """
    share = problem.rules.decision.ordinary_share
    played = valves.applied(problem)
    base = played.errors(vector[None])[0]
    changes: list[Array] = []
    free: list[FreeParameter] = []
    for side, width in enumerate(valves.widths):
        other = list(valves.widths)
        other[side] = width + STEP
        moved = ValvePlay(tuple(other)).applied(problem)
        changes.append((moved.errors(vector[None])[0] - base) / STEP)
        free.append(
            FreeParameter("play of a valve", -width, MOST - width, 0.3, SPREAD, USUAL - width)
        )
    lanes = np.repeat(vector[None], len(CREEP_TIMES), axis=0)
    for lane, time in zip(lanes, CREEP_TIMES, strict=True):
        lane[[INDEX[f"{side}.creep.ratio"] for side in SIDES]] += CREEP_RATIO
        lane[[INDEX[f"{side}.creep.time_constant"] for side in SIDES]] = time
    changes += list(played.errors(lanes) - base)
    free += [FreeParameter("creep", 0.0, 3.0, 0.3, 0.6, 1.0)] * len(CREEP_TIMES)
    late = late_friction(played, vector)
    changes += late
    free += [FreeParameter("late friction", -1.0, 1.0, 0.3, LATE_SPREAD)] * len(late)
    for part in sensor_parts(played):
        if not part.is_one_way:  # the play is above
            changes.append(part.errors(played, vector, 1.0) - base)
            free.append(FreeParameter(part.name, -1.0, 1.0, share, share))
    for one in encoder_changes(played, base):
        changes.append(one)
        free.append(FreeParameter("the encoder", -1.0, 1.0, share, share))
    columns = np.stack(changes, axis=-1) if changes else np.zeros((*base.shape, 0))
    return LinearTerms(columns, tuple(rules.weighted(one) for one in free))


def late_friction(problem: PredictionProblem, vector: Array) -> list[Array]:
    """Changes of the errors by friction of each muscle's threads over a longer stroke."""
    lanes = np.repeat(vector[None], len(SIDES) + 1, axis=0)
    # both muscles have one stroke in a fit: the first lane shows what the longer one alone changes
    lanes[:, [INDEX[f"{side}.hysteresis.presliding_length"] for side in SIDES]] *= LONG_STROKE
    for lane, side in zip(lanes[1:], SIDES, strict=True):
        lane[INDEX[f"{side}.hysteresis.amplitude"]] += LATE_FRICTION
    errors = problem.errors(lanes)
    return list(errors[1:] - errors[0])
