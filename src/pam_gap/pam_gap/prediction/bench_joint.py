"""One muscle on a bench, of which length, pressure and force are recorded, as a joint.

The simulation is that of a joint. The muscle is put on an invented one whose position is the
measured length, so that nothing but its pressure and its pull is predicted: the pressure from the
commands along the measured length, if there are commands, and the pull from both. What moves or
holds the muscle does not matter, be it a motor, a spring or a weight. The invented second muscle is
far from the ends of its range, takes no air, and none of its channels counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pam_gap.prediction.channel_order import AGONIST_FORCE, AGONIST_PRESSURE, POSITION
from pam_gap.prediction.directions import Direction, cross_phase, valve_phase
from pam_gap.prediction.fit import Array
from pam_gap.prediction.problem import PredictionProblem, PredictionSettings
from pam_gap.recordings.recording import (
    COMMANDS,
    JOINTS,
    MUSCLES,
    PRESSURES,
    Recording,
    RecordingError,
)
from pam_gap.rules import DEFAULT, Rules
from pam_model.rig import Joint, Rig

INVENTED = "invented"
RADIUS = 0.05  # m, of the invented pulley; it changes nothing but the unit of the length
HEAVY = 1e3  # kg m^2: between two samples the length goes on at its measured speed
LONG = 4.0
"""Thread of the invented second muscle, in threads of the first."""
LITTLE = 1e-3
"""Conductance of the second muscle's valve over that of the first, so that it draws no air."""
ALONG_LENGTH = PredictionSettings(follow_motion=True)
ALONG_BOTH = PredictionSettings(follow_motion=True, follow_pressures=True)


def bench_channels(muscle: str) -> tuple[str, str, str]:
    """The channels that a bench needs: pressure, length and force of the muscle."""
    return f"{PRESSURES}{muscle}", f"{MUSCLES}{muscle}.position", f"{MUSCLES}{muscle}.effort"


def bench_muscles(rig: Rig) -> list[str]:
    """The muscles of a rig that belong to no joint."""
    return [muscle.name for muscle in rig.muscles if rig.joint_of(muscle.name) is None]


def bench_muscles_recorded(rig: Rig, recordings: Sequence[Recording]) -> list[str]:
    """The muscles without a joint whose length, pressure and force are in all recordings."""
    return [
        name
        for name in bench_muscles(rig)
        if all(r.has(channel) for r in recordings for channel in bench_channels(name))
    ]


def expected_channels(rig: Rig) -> str:
    """What a recording of the bench muscles of a rig needs, for a message."""
    names = bench_muscles(rig)
    return ", ".join(bench_channels(names[0])) if names else "a muscle in bench_muscles"


def on_an_invented_joint(rig: Rig, muscle: str) -> Rig:
    """The rig with nothing but one muscle, on a joint that turns as the muscle shortens."""
    own = rig.muscle(muscle)
    thread = LONG * own.thread_length
    valve = replace(own.valve, sonic_conductance=LITTLE * own.valve.sonic_conductance)
    other = replace(
        own,
        name=f"{INVENTED}_{muscle}",
        thread_length=thread,
        rest_length=0.9 * thread,
        neutral_length=0.6 * thread,
        turns=LONG * own.turns,
        valve=valve,
        effects={},
    )
    joint = Joint(
        f"{INVENTED}_joint",
        (own.name, other.name),
        RADIUS,
        HEAVY,
        (-2.0 * np.pi, 2.0 * np.pi),
    )
    return replace(rig, joints=(joint,), muscles=(own, other))


def off_the_joint(rig: Rig, muscle: str, found: Rig) -> Rig:
    """The rig with the numbers of one muscle, and of all that muscles share, from another one.

    Parameters
    ----------
    rig : Rig
        The rig as its file describes it.
    muscle : str
        The muscle on the bench.
    found : Rig
        What `on_an_invented_joint` made of it, with other numbers.
    """
    shared = replace(rig, supply_pressure=found.supply_pressure, effects=found.effects)
    return shared.with_muscle(found.muscle(muscle))


def as_motion(recording: Recording, rig: Rig) -> Recording:
    """A recording of the bench with the length as the position of the invented joint."""
    joint = rig.joints[0]
    own, other = (rig.muscle(name) for name in joint.muscles)
    pressure, length, force = bench_channels(own.name)
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
        samples={k: v for k, v in recording.samples.items() if k in values},
        silent=recording.silent | {position, f"{PRESSURES}{other.name}"},
    )


def _turned(rig: Rig, length: Array) -> Array:
    """Position of the invented joint at which the muscle has this length."""
    neutral = rig.to_parameters()[rig.joints[0].agonist]["neutral_length"]
    result: Array = (neutral - length) / RADIUS
    return result


def bench_problem(
    rig: Rig, recordings: Sequence[Recording], *, rules: Rules = DEFAULT, threads: int = 1
) -> PredictionProblem:
    """The prediction of pressure and pull of one muscle along its measured length.

    Parameters
    ----------
    rig : Rig
        From `on_an_invented_joint`.
    recordings : sequence of Recording
        Recordings of the bench, as they are.
    rules, threads
        As for `PredictionProblem`.
    """
    moved = [as_motion(one, rig) for one in recordings]
    return PredictionProblem(
        rig, 0, moved, rules=rules, threads=threads, usual=ALONG_LENGTH, sides=1
    )


def wrong_bench_wiring(problem: PredictionProblem, highest: float | None = None) -> tuple[str, ...]:
    """Whether the pressure follows the command, and the force the pressure, by their phases.

    What the force and the pressure owe to the length does not count: where a machine stretches the
    muscle, its force rises while its pressure falls.

    Parameters
    ----------
    problem : PredictionProblem
        From `bench_problem`.
    highest : float, optional
        Upper end of the band of frequencies [Hz]; by default that of the rules.
    """
    (muscle,) = problem.muscles
    if highest is None:
        highest = problem.rules.recording.bench_band
    pulls = cross_phase(
        [
            (d.measured[:, AGONIST_PRESSURE], d.measured[:, AGONIST_FORCE], d.recording.sample_time)
            for d in problem.data
        ],
        highest,
        problem.rules.recording,
        [d.measured[:, POSITION] for d in problem.data],
    )
    drive = valve_phase(problem, 0, highest)
    return tuple(
        f"Wrong wiring or sign of {muscle}: {phase.words(first, second)}; they should agree, at a "
        "phase near 0."
        for phase, first, second in (
            (pulls, "the pressure", "the force"),
            (drive, "the command", "the pressure"),
        )
        if phase.direction == Direction.OPPOSED
    )


def refuse_other_lengths(rig: Rig, muscle: str, recording: Recording) -> None:
    """Refuse lengths that the muscle cannot have, such as millimetres.

    Raises
    ------
    RecordingError
        The message names the recording, the channel, the lengths seen and those expected.
    """
    name = f"{MUSCLES}{muscle}.position"
    low, high = rig.force_model(muscle).length_bounds
    values = recording.values[name][recording.valid[name]]
    if not values.size:
        raise RecordingError(f"{recording.source}: {name} has no valid sample")
    least, most = float(np.min(values)), float(np.max(values))
    if not (low < least and most < 1.05 * high):
        raise RecordingError(
            f"{recording.source}: {name} reaches from {least:.4g} to {most:.4g} m; expected the "
            f"length of {muscle}, between {low:.4g} and {high:.4g} m by the rig file"
        )
