"""The calibration of one muscle on a bench, of which length, pressure and force were recorded.

`pam_gap.prediction.bench_joint` says how such a muscle is simulated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pam_gap.answer.improved_rig import with_number
from pam_gap.calibration.calibration import KEPT, Calibration, conclusion, misfit, not_sought
from pam_gap.calibration.calibration_rules import DEFAULT, CalibrationRules
from pam_gap.calibration.free_numbers import (
    GAS,
    ORDINARY_BODY,
    ORDINARY_VALVE,
    SENSORS,
    STATICS,
    FreeRigNumber,
    Said,
    free_numbers,
)
from pam_gap.calibration.staged_fit import FitStage, fit_stage, fit_together
from pam_gap.prediction.bench_joint import (
    ALONG_BOTH,
    ALONG_LENGTH,
    bench_problem,
    off_the_joint,
    on_an_invented_joint,
    refuse_other_lengths,
    wrong_bench_wiring,
)
from pam_gap.prediction.channel_order import AGONIST_FORCE, AGONIST_PRESSURE, UNITS
from pam_gap.prediction.fit import Array, mean_squares
from pam_gap.prediction.gap_figures import GapFigure, noise_level
from pam_gap.prediction.identifiable import counted_seconds
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import Recording
from pam_gap.search.candidate_search import Progress, silent
from pam_model.plant.parameters import INDEX, NAMES
from pam_model.rig.partial import PartialRig


def _of_the_muscle(numbers: Sequence[FreeRigNumber]) -> tuple[FreeRigNumber, ...]:
    """The numbers of the muscle itself; the zero of its length is where it is measured."""
    return tuple(
        one if not one.others else replace(one, others=())
        for one in numbers
        if (one.name.startswith("agonist.") or one.name == "supply_pressure")
        and not one.key.endswith("neutral_length")
    )


def _too_little(problem: PredictionProblem) -> tuple[str, ...]:
    """Why nothing can be found, in full sentences; empty if something can."""
    rules = problem.rules
    seconds = float(counted_seconds(problem).max())
    if seconds < rules.recording.least_seconds:
        return (
            f"Too short: {seconds:.3g} s of data count, and at least "
            f"{rules.recording.least_seconds:g} s are needed; the first "
            f"{rules.prediction.settling:g} s of a recording never count.",
        )
    pressure = problem.data[0].measured[:, AGONIST_PRESSURE]
    if not np.ptp(pressure) > 0.0:
        return (f"{problem.names[AGONIST_PRESSURE]} never changes; expected several pressures.",)
    return ()


def calibrate_bench_muscle(
    partial: PartialRig,
    muscle: str,
    recordings: Sequence[Recording],
    withheld: Sequence[Recording] = (),
    *,
    said: Said,
    rules: CalibrationRules = DEFAULT,
    threads: int = 1,
    progress: Progress = silent,
) -> Calibration:
    """Find the numbers of one muscle from recordings of its length, pressure and force.

    Parameters
    ----------
    partial : PartialRig
        What the rig file says.
    muscle : str
        Name of the muscle, which belongs to no joint.
    recordings, withheld : sequence of Recording
        Recordings that are fitted, and others on which the result is tried.
    said, rules, threads, progress
        As for `calibrate_joint`.

    Raises
    ------
    RecordingError
        For a length that the muscle cannot have.
    """
    rig = on_an_invented_joint(partial.rig, muscle)
    invented = replace(partial, rig=rig)
    for recording in (*recordings, *withheld):
        refuse_other_lengths(rig, muscle, recording)

    result = Calibration(muscle)
    progress("wiring", 0.0)
    problem = bench_problem(rig, recordings, threads=threads)
    result.wiring = wrong_bench_wiring(problem, rules.slow_band)
    result.refused = result.wiring or _too_little(problem)
    if result.refused:
        return result
    start = dict(zip(NAMES, problem.base.values.tolist(), strict=True))
    numbers = _of_the_muscle(
        free_numbers(invented, rig.joints[0], start, said, rules, has_commands=problem.has_commands)
    )
    vector = problem.base.values.copy()
    for one in numbers:
        vector[INDEX[one.name]] = one.free.centre
    steps = [FitStage(STATICS, (STATICS, SENSORS, ORDINARY_BODY), (AGONIST_FORCE,), ALONG_BOTH)]
    if problem.has_commands:
        of_gas = (GAS, SENSORS, ORDINARY_VALVE)
        steps.append(FitStage(GAS, of_gas, (AGONIST_PRESSURE,), ALONG_LENGTH))
    for place, stage in enumerate(steps):
        progress(f"stage: {stage.name}", 0.1 + 0.2 * place)
        vector, result.stage_errors[stage.name] = fit_stage(problem, stage, numbers, vector, rules)
    progress("all numbers together", 0.5)
    joint = fit_together(problem, numbers, vector, rules)
    relative, result.posterior = conclusion(rig, rig.joints[0].name, numbers, joint, rules)
    found = tuple(replace(one, relative=None) for one in relative)  # forces were measured
    others = not_sought(invented, rig.joints[0], found, problem.base.values)
    own = (f"{muscle}.", "supply_pressure")
    result.numbers = (*found, *(one for one in others if one.key.startswith(own)))
    result.small = result.posterior.small
    result.problem, result.before = problem, problem.base.values
    result.refused = misfit(problem, joint.fitted, rules)
    names = {one.key: one.name for one in numbers}
    after, calibrated = problem.base.values.copy(), rig
    for what in result.numbers:
        if what.status == KEPT:
            continue
        after[INDEX[names[what.key]]] = what.value
        calibrated = with_number(calibrated, rig.joints[0].name, names[what.key], what.value)
    result.after = after
    if result.refused:
        return result
    result.rig = off_the_joint(partial.rig, muscle, calibrated)
    if withheld:
        result.withheld = _along_the_length(
            bench_problem(rig, withheld, threads=threads), result.before, after
        )
    return result


def _along_the_length(
    problem: PredictionProblem, before: Array, after: Array
) -> tuple[GapFigure, ...]:
    """Errors of pressure and pull along the measured length."""
    errors = problem.errors(np.array([before, after]))
    rms = np.sqrt(mean_squares(errors, problem.counted))
    floor = np.sqrt(noise_level(problem, after))
    scale = np.sqrt(np.mean([data.block_deviation**2 for data in problem.data], axis=0))
    return tuple(
        GapFigure(
            "along the measured length",
            problem.names[c],
            UNITS[c],
            *(float(x[c] * scale[c]) for x in (rms[0], rms[1], floor)),
        )
        for c in np.flatnonzero(problem.present)
    )
