"""The calibration of one muscle on a bench, of which length, pressure and force were recorded.

The simulation is that of a joint. The muscle is put on an invented one whose position is the
measured length, so that nothing but its pressure and its pull is predicted: the pressure from the
commands along the measured length, if there are commands, and the pull from both. The invented
second muscle is far from the ends of its range, and none of its channels counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pam_gap.answer.improved_rig import with_number
from pam_gap.calibration.calibration import KEPT, Calibration, conclusion, misfit
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
from pam_gap.inference.search import Progress, silent
from pam_gap.prediction.channel_order import AGONIST_FORCE, AGONIST_PRESSURE, UNITS
from pam_gap.prediction.directions import Direction, cross_phase, valve_phase
from pam_gap.prediction.fit import Array, mean_squares
from pam_gap.prediction.gap_figures import GapFigure, noise_level
from pam_gap.prediction.identifiable import counted_seconds
from pam_gap.prediction.problem import PredictionProblem, PredictionSettings
from pam_gap.recordings.recording import (
    COMMANDS,
    JOINTS,
    MUSCLES,
    PRESSURES,
    Recording,
    RecordingError,
)
from pam_model.plant.parameters import INDEX, NAMES
from pam_model.rig import Joint, Rig
from pam_model.rig.partial import PartialRig

INVENTED = "invented"
RADIUS = 0.05  # m, of the invented pulley; it changes nothing but the unit of the length
HEAVY = 1e3  # kg m^2: between two samples the length goes on at its measured speed
LONG = 4.0
"""Thread of the invented second muscle, in threads of the first."""
ALONG_LENGTH = PredictionSettings(follow_motion=True)
ALONG_BOTH = PredictionSettings(follow_motion=True, follow_pressures=True)


def bench_muscles_recorded(rig: Rig, recordings: Sequence[Recording]) -> list[str]:
    """The muscles without a joint whose length, pressure and force are in all recordings."""
    return [
        muscle.name
        for muscle in rig.muscles
        if rig.joint_of(muscle.name) is None
        and all(r.has(name) for r in recordings for name in _needed(muscle.name))
    ]


def _needed(muscle: str) -> tuple[str, ...]:
    return f"{PRESSURES}{muscle}", f"{MUSCLES}{muscle}.position", f"{MUSCLES}{muscle}.effort"


def expected_channels(rig: Rig) -> str:
    """What a recording of the bench muscles of a rig needs, for a message."""
    names = [m.name for m in rig.muscles if rig.joint_of(m.name) is None]
    return ", ".join(_needed(names[0])) if names else "a muscle in bench_muscles of the rig file"


def on_an_invented_joint(partial: PartialRig, muscle: str) -> PartialRig:
    """The rig with nothing but one muscle, on a joint that turns as the muscle shortens."""
    own = partial.rig.muscle(muscle)
    thread = LONG * own.thread_length
    other = replace(
        own,
        name=f"{INVENTED}_{muscle}",
        thread_length=thread,
        rest_length=0.9 * thread,
        neutral_length=0.6 * thread,
        turns=LONG * own.turns,
        effects={},
    )
    joint = Joint(
        f"{INVENTED}_joint",
        (own.name, other.name),
        RADIUS,
        HEAVY,
        (-2.0 * np.pi, 2.0 * np.pi),
    )
    return replace(partial, rig=replace(partial.rig, joints=(joint,), muscles=(own, other)))


def as_motion(recording: Recording, rig: Rig) -> Recording:
    """A recording of the bench with the length as the position of the invented joint."""
    joint = rig.joints[0]
    own, other = (rig.muscle(name) for name in joint.muscles)
    pressure, length, force = _needed(own.name)
    position = f"{JOINTS}{joint.name}.position"
    copies = {
        pressure: (pressure, f"{PRESSURES}{other.name}"),
        force: (force,),
        f"{COMMANDS}{own.name}": (f"{COMMANDS}{own.name}", f"{COMMANDS}{other.name}"),
    }
    values, valid = {}, {}
    for source, targets in copies.items():
        for target in targets:
            if recording.has(source):
                values[target], valid[target] = recording.values[source], recording.valid[source]
    values[position] = _turned(rig, recording.values[length])
    valid[position] = recording.valid[length]
    return replace(
        recording,
        values=values,
        valid=valid,
        samples={},
        silent=frozenset({position, f"{PRESSURES}{other.name}"}),
    )


def _turned(rig: Rig, length: Array) -> Array:
    """Position of the invented joint at which the muscle has this length."""
    neutral = rig.to_parameters()[rig.joints[0].agonist]["neutral_length"]
    result: Array = (neutral - length) / RADIUS
    return result


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


def _wiring(problem: PredictionProblem, muscle: str, rules: CalibrationRules) -> tuple[str, ...]:
    """Whether the pressure follows the command, and the force the pressure, by their phases."""
    pulls = cross_phase(
        [
            (d.measured[:, AGONIST_PRESSURE], d.measured[:, AGONIST_FORCE], d.recording.sample_time)
            for d in problem.data
        ],
        rules.slow_band,
        problem.rules.recording,
    )
    drive = valve_phase(problem, 0, rules.slow_band)
    return tuple(
        f"Wrong wiring or sign of {muscle}: {phase.words(first, second)}; they should agree, at a "
        "phase near 0."
        for phase, first, second in (
            (pulls, "the pressure", "the force"),
            (drive, "the command", "the pressure"),
        )
        if phase.direction == Direction.OPPOSED
    )


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
    invented = on_an_invented_joint(partial, muscle)
    rig = invented.rig
    for recording in (*recordings, *withheld):
        _refuse_other_lengths(rig, muscle, recording)

    def problem_of(some: Sequence[Recording]) -> PredictionProblem:
        moved = [as_motion(one, rig) for one in some]
        return PredictionProblem(rig, 0, moved, threads=threads, usual=ALONG_LENGTH)

    result = Calibration(muscle)
    progress("wiring", 0.0)
    problem = problem_of(recordings)
    result.wiring = _wiring(problem, muscle, rules)
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
    result.numbers, result.small = conclusion(rig, rig.joints[0].name, numbers, joint, rules)
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
    result.rig = replace(
        partial.rig.with_muscle(calibrated.muscle(muscle)),
        supply_pressure=calibrated.supply_pressure,
    )
    if withheld:
        result.withheld = _along_the_length(problem_of(withheld), result.before, after)
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


def _refuse_other_lengths(rig: Rig, muscle: str, recording: Recording) -> None:
    """Refuse lengths that the muscle cannot have, such as millimetres."""
    name = f"{MUSCLES}{muscle}.position"
    low, high = rig.force_model(muscle).length_bounds
    values = recording.values[name][recording.valid[name]]
    least, most = float(np.min(values)), float(np.max(values))
    if not (low < least and most < 1.05 * high):
        raise RecordingError(
            f"{recording.source}: {name} reaches from {least:.4g} to {most:.4g} m; expected the "
            f"length of {muscle}, between {low:.4g} and {high:.4g} m by the rig file"
        )
