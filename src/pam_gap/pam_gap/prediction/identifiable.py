"""Whether a recording holds enough for a diagnosis, and what is missing if it does not.

A search always finds a best effect, even in data that show nothing. Before it, the seconds that
count, the motion, the sample rate and saturated sensors are compared with what an answer needs.
"""

from __future__ import annotations

import numpy as np

from pam_gap.prediction.bench_joint import wrong_bench_wiring
from pam_gap.prediction.channel_order import BOTH_PRESSURES, POSITION, UNITS
from pam_gap.prediction.dead_sensors import dead_encoder, dead_pressure_sensors
from pam_gap.prediction.fit import Array
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.prediction.wrong_wiring import wrong_wiring
from pam_gap.recordings.blind_time import BlindTime, blind_time
from pam_model.gas.constants import (
    GAS_CONSTANT,
    REFERENCE_DENSITY,
    REFERENCE_TEMPERATURE,
)
from pam_model.joints.joint_statics import JointStatics

USUAL = "Record 40 s at 200 Hz or more, at rest for the first two seconds."


def counted_seconds(problem: PredictionProblem) -> Array:
    """Time that is compared in each channel [s], shape (N_CHANNELS,); 0 if it is not compared."""
    seconds = np.zeros(problem.present.size)
    for data, start, end in zip(
        problem.data, problem.offsets[:-1], problem.offsets[1:], strict=True
    ):
        rows = int(end - start)
        known = data.rows(data.known.astype(np.float64))[:rows] > 0.999
        counted = known & problem.counted[start:end, None] & data.votes
        seconds += counted.sum(axis=0) * data.row_time
    result: Array = np.where(problem.present, seconds, 0.0)
    return result


def is_too_still(problem: PredictionProblem) -> bool:
    """Whether no compared channel ever changes by more than its noise."""
    limit = problem.rules.recording.still_span
    for data, start, end in zip(
        problem.data, problem.offsets[:-1], problem.offsets[1:], strict=True
    ):
        counted = problem.counted[start:end]
        means = data.rows(data.measured)[: int(end - start)][counted]
        if not len(means):
            continue
        low, high = np.percentile(means, [2.5, 97.5], axis=0)
        moved = (high - low) > limit * data.block_deviation
        if (moved & data.votes & problem.present).any():
            return False
    return True


def full_of_holes(problem: PredictionProblem) -> tuple[str, ...]:
    """Whether gaps of the log spoil most of the recordings, in full sentences."""
    lost = blind_in(problem)
    if lost.spoiled_share <= problem.rules.recording.spoiled_share:
        return ()
    return (
        f"The recording shows too little to judge the robot: {lost.words()}. With the "
        f"{problem.rules.prediction.horizon:g} s after each of them, in which the prediction still "
        f"errs, {100.0 * lost.spoiled_share:.0f} % of the time shows nothing. The computer that "
        "recorded was busy, or the network lost messages: record on a computer without other work, "
        f"and watch what `record` says. {USUAL}",
    )


def blind_in(problem: PredictionProblem) -> BlindTime:
    """How much of the recordings is lost in holes."""
    recordings = [data.recording for data in problem.data]
    return blind_time(recordings, problem.muscles, problem.rules)


def some_holes(problem: PredictionProblem) -> tuple[str, ...]:
    """Gaps that take a part of the recordings which is worth a word, in full sentences."""
    lost = blind_in(problem)
    if lost.missing_share <= problem.rules.recording.told_share:
        return ()
    return (
        f"The recording has holes: {lost.words()}. They are not compared; what happened in them "
        "is unknown, and the answer rests on the rest.",
    )


def what_is_missing(problem: PredictionProblem) -> tuple[str, ...]:
    """Reasons why a diagnosis is not possible, in full sentences; empty if it is."""
    rules = problem.rules.recording
    if not problem.present.any():
        return (
            "No channel can be compared with a prediction: this needs valve commands, a joint "
            "position that changes, or muscle forces, and the pressure of every muscle.",
        )
    missing = []
    seconds = float(counted_seconds(problem).max())
    settling = problem.rules.prediction.settling
    if seconds < rules.least_seconds:
        lengths = ", ".join(f"{data.recording.duration:.3g} s" for data in problem.data[:6])
        more = ", ..." if len(problem.data) > 6 else ""
        missing.append(
            f"Too short: {seconds:.3g} s of data count, and at least {rules.least_seconds:g} s are "
            f"needed. The first {settling:g} s of every recording never count, because the state "
            f"of the rig is unknown there (recorded: {lengths}{more}). {USUAL}"
        )
    elif is_too_still(problem):
        missing.append(
            "Too still: no compared channel changes by more than its noise. A diagnosis needs "
            "pressures or positions that change, over the range and at the speed of the robot's "
            "work."
        )
    step = max(data.recording.sample_time for data in problem.data)
    if step > rules.longest_step:
        missing.append(
            f"Too slow: {1.0 / step:.3g} samples per second. At least "
            f"{1.0 / rules.longest_step:g} Hz are needed to see a joint move; 200 Hz or more are "
            "better."
        )
    dead = (*dead_encoder(problem), *dead_pressure_sensors(problem))
    found = (*full_of_holes(problem), *missing, *dead, *saturated_channels(problem))
    wiring = wrong_bench_wiring if problem.is_bench else wrong_wiring
    return tuple(dict.fromkeys(found)) or wiring(problem)


def cautions(problem: PredictionProblem) -> tuple[str, ...]:
    """What makes an answer less certain than it looks, in full sentences."""
    still = tuple(
        f"{problem.names[POSITION]} never changes in {data.recording.source.name}, so that the "
        "joint is taken for locked. If it was free to move, this answer is wrong."
        for data in problem.data
        if data.recording.is_found_still
    )
    seconds = float(counted_seconds(problem).max())
    frozen = [note for data in problem.data for note in data.recording.frozen]
    frozen += [
        f"{name} stands at the end of its sensor's range for {100.0 * share:.2g} % of "
        f"{data.recording.source.name}. This time is not compared."
        for data in problem.data
        for name, share in data.recording.saturated.items()
        if name in problem.names and name != problem.names[POSITION]
    ]
    logged = (*some_holes(problem), *frozen, *sparse_commands(problem), *held_commands(problem))
    found = tuple(dict.fromkeys((*logged, *still)))
    if seconds >= problem.rules.recording.short_seconds:
        return found
    return (
        *found,
        f"Only {seconds:.3g} s of data count, so that little is left to check a cause on data that "
        f"took no part in its fit. {USUAL}",
    )


def sparse_commands(problem: PredictionProblem) -> tuple[str, ...]:
    """Whether a log may have lost commands between its rows, in full sentences.

    The median deviation of a command from the mean of its neighbours shows how much commands change
    within a row, apart from steps. What a filling muscle gains from it within a row is compared
    with the noise of its pressure. A bag holds each command with its own stamp, and loses none.
    """
    rig, rules = problem.rig, problem.rules.recording
    muscles = [rig.muscle(name) for name in rig.joints[problem.joint].muscles]
    if not problem.has_commands or any(m.valve.kind == "pressure_regulator" for m in muscles):
        return ()
    volumes = JointStatics.from_rig(rig, rig.joints[problem.joint].name).volumes(0.0)
    nominal = REFERENCE_DENSITY * GAS_CONSTANT * REFERENCE_TEMPERATURE
    flow = np.array([m.valve.sonic_conductance for m in muscles])
    rate = flow * rig.supply_pressure * nominal / np.array(volumes)
    for data in problem.data:
        if not data.recording.one_clock:
            continue
        u, step = data.commands, data.recording.sample_time
        jagged = np.median(np.abs(u[1:-1] - 0.5 * (u[:-2] + u[2:])), axis=0)
        gained = rate * jagged * step / data.deviation[BOTH_PRESSURES]
        if (gained > rules.jagged_commands).any():
            return (
                f"The valve commands change a lot from row to row at {1.0 / step:.3g} Hz. If the "
                "control loop is faster than this log, the commands between the rows are lost and "
                "the errors that they leave can be taken for a cause. Log every command.",
            )
    return ()


def held_commands(problem: PredictionProblem) -> tuple[str, ...]:
    """Whether commands were logged more slowly than the measurements, in full sentences.

    Such commands change at even intervals. Those of a slow experiment change at intervals of its
    own, and those of a usual loop more often than a joint needs.
    """
    if not problem.has_commands:
        return ()
    rules = problem.rules.recording
    for data in problem.data:
        changes = np.flatnonzero(np.diff(data.commands, axis=0).any(axis=1))
        if not data.recording.one_clock or changes.size < rules.fewest_changes:
            continue  # a bag holds each command with its own stamp
        intervals = np.diff(changes) * data.recording.sample_time
        usual = float(np.median(intervals))
        near = np.abs(intervals - usual) <= 1.5 * data.recording.sample_time
        if usual > rules.longest_step and near.mean() > rules.even_changes:
            return (
                f"The valve commands change every {usual:.2g} s only, and the measurements come "
                f"every {data.recording.sample_time:.2g} s. If the control loop is quicker than "
                "its commands in this log, those between are lost and the errors that they leave "
                "can be taken for a cause. Log every command.",
            )
    return ()


def small_motion(problem: PredictionProblem) -> tuple[str, ...]:
    """What an answer without a cause may have missed, in full sentences.

    A load, for example, hardly acts while the joint stays near the angle at which it balances.
    """
    if not problem.present[POSITION]:
        return ()
    position = np.concatenate([data.measured[:, POSITION] for data in problem.data])
    lower, upper = problem.rig.joints[problem.joint].position_limits
    share = float(np.nanmax(position) - np.nanmin(position)) / (upper - lower)
    wanted = problem.rules.recording.wanted_range
    if share >= wanted:
        return ()
    return (
        f"The joint has used {100.0 * share:.0f} % of its range only. Effects that depend on its "
        f"angle, such as a load, may be hidden; record a motion over {100.0 * wanted:.0f} % of the "
        "range or more.",
    )


def saturated_channels(problem: PredictionProblem) -> tuple[str, ...]:
    """Channels that stand at one end of their range for most of the time, in full sentences."""
    notes = []
    for c, name in enumerate(problem.names):
        for data in problem.data:
            part = data.recording.saturated.get(name, 0.0)
            if problem.recorded[c] and part > problem.rules.recording.saturated_share:
                notes.append(
                    f"Saturated: {name} stands at the end of its sensor's range "
                    f"[{UNITS[c]}] for {100.0 * part:.0f} % of {data.recording.source.name}. Use a "
                    "sensor with a larger range, or a smaller motion."
                )
    return tuple(notes)
