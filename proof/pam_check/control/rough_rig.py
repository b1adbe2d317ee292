"""One rig as real ones are, beside one that is its rig file: what diagnosis and learning bring.

`pam check rough-rig` hides several effects of ordinary size at once in the independent
plant of the blind check, and makes the dimensions differ from the rig file. It plays the arm's
motion with a PID that was tuned on that very rig, with the controller that has the rig file as it
was written, with the improved rig file of a diagnosis, and after it has learnt the motion. The same
PID and controller play it on a rig that matches its rig file.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final

from pam_check.blind.hidden_size import HiddenSize
from pam_check.blind.truth_plant import TruthJoint
from pam_check.control.closed_loop import (
    APPROACH,
    PERIOD,
    SETTLED,
    TOLD,
    Muscles,
    RunTrace,
    play,
    true_rig,
)
from pam_check.control.improved_rigs import ADAPTING, NOT_WORSE, OTHER_NOISE, recordings
from pam_check.control.repeated_motions import MOTION, from_start, learnt
from pam_check.control.rough_control import WORST_RATIO, Baselines, RoughControl
from pam_check.control.rough_rig_picture import Way, draw
from pam_control.controller import Controller
from pam_gap import diagnose
from pam_gap.answer.diagnosis import Diagnosis
from pam_model.argument_types import make_parents
from pam_model.command_line import Arguments, Outcome, progress
from pam_model.common_options import chosen_rig
from pam_model.rig import Rig, load_rig

PICTURE: Final = "rough_rig.png"
_MUSCLE: Final = {"thread_friction": 0.003, "play_length": 1e-3, "command_delay": 0.01}
ROUGH: Final = HiddenSize(
    "about half of the thread friction, the dry friction and the delay that `effect_cases` states "
    "for each alone, and a cable that lies 2 % higher",
    muscles=(_MUSCLE, _MUSCLE),
    joint={"coulomb_torque": 0.27, "static_torque": 0.27},
    scaled_joint={"pulley_radius": 1.02},
)
TURNS: Final = 0.98
"""Turns of the threads over those of the rig file: the force is 4 % larger."""
PID, WRITTEN, IMPROVED, LEARNT = (
    "PID with feedforward, tuned on this rig",
    "controller, rig file as written",
    "controller, after the diagnosis",
    "controller, after {} repetitions",
)


def rough_truth(rig: Rig) -> tuple[TruthJoint, Muscles]:
    """The rough rig whose owner believes in this rig file."""
    joint, (first, second) = ROUGH.applied(*true_rig(rig))
    changed = [muscle._replace(turns=TURNS * muscle.turns) for muscle in (first, second)]
    return joint, (changed[0], changed[1])


def _way(name: str, stopped: str, trace: RunTrace, motion: float, begin: float = SETTLED) -> Way:
    rows = slice(round(begin / PERIOD), round((begin + motion) / PERIOD))
    return Way(name, trace.position[rows], trace.reference[rows, 0], stopped)


class RoughRig:
    """The laws on either rig.

    Parameters
    ----------
    rig : Rig
        The rig file as it was written.
    seed : int
        Of the motions and of the noise.
    baselines : Baselines
        Store of the tuned PIDs.
    tries : int
        Gains that the search for a PID tries.
    """

    def __init__(self, rig: Rig, seed: int, baselines: Baselines, tries: int) -> None:
        self._rough = RoughControl(rig, TOLD, seed)
        self._seed, self._baselines, self._tries = seed, baselines, tries
        self._points = self._rough.motions[MOTION]
        self._motion = self._points[-1].time_from_start

    def pid(self, joint: TruthJoint, muscles: Muscles) -> Way:
        """The PID, tuned on this rig, in the noise that it was tuned in."""
        bench, tuned = self._rough.tuned_pid(joint, muscles, self._baselines, self._tries)
        played, trace = bench.play(tuned)[MOTION]
        return _way(PID, played.stopped, trace, self._motion)

    def controller(self, name: str, rig: Rig, joint: TruthJoint, muscles: Muscles) -> Way:
        """The controller with a rig file, which plays the motion for the first time."""
        law = Controller(rig, ADAPTING, self._rough.designs)
        played, trace = play(law, joint, muscles, self._points, self._seed + OTHER_NOISE)
        return _way(name, played.stopped, trace, self._motion)

    def diagnosis(self, joint: TruthJoint, muscles: Muscles, folder: Path) -> Diagnosis:
        """What the diagnosis says of both motions, played with the rig file as written."""
        logs = recordings(self._rough, joint, muscles, self._seed, folder)
        (answer,) = diagnose(logs, self._rough.rig)
        return answer

    def repeated(self, rig: Rig, joint: TruthJoint, muscles: Muscles, repetitions: int) -> Way:
        """The controller with a rig file at the last of so many repetitions."""
        law = Controller(rig, ADAPTING.replace(learning_motion=MOTION), self._rough.designs)
        points = from_start(self._points)
        seed = self._seed + OTHER_NOISE
        played, trace, _ = learnt(law, joint, muscles, points, repetitions, seed)
        begin = SETTLED + APPROACH[1]
        name = LEARNT.format(repetitions)
        return _way(name, played[-1].stopped, trace, self._motion, begin)


def problems(clean: Sequence[Way], rough: Sequence[Way]) -> list[str]:
    """What is not as it should be.

    On the rough rig, the controller with the rig file as written plays the motion for the first
    time, while the PID was tuned in it. That it is better is asked of it after the diagnosis alone.

    Parameters
    ----------
    clean, rough : sequence of Way
        The PID, then the controller with more and more knowledge.
    """
    compared = [(clean[0], clean[1], WORST_RATIO)]
    compared += [(rough[0], better, WORST_RATIO) for better in rough[2:]]
    compared += [(before, after, NOT_WORSE) for before, after in pairwise(rough[1:])]
    return [
        f"{after.name}: {1e3 * after.rms:.2f} mrad, where {before.name} has "
        f"{1e3 * before.rms:.2f} mrad"
        for before, after, most in compared
        if not after.rms <= most * before.rms
    ]


def run(given: Arguments) -> Outcome:
    """Play all laws on both rigs, print the table and draw the picture.

    Raises
    ------
    PamError
        For a rig or a file that cannot be used.
    """
    rig = load_rig(chosen_rig(given))
    bench = RoughRig(rig, given.seed, Baselines(given.tuned), given.tries)
    with progress(6, "laws") as bar, tempfile.TemporaryDirectory() as folder:
        clean = [bench.pid(*true_rig(rig)), bench.controller(WRITTEN, rig, *true_rig(rig))]
        bar.show(2, PID)
        truth = rough_truth(rig)
        rough = [bench.pid(*truth), bench.controller(WRITTEN, rig, *truth)]
        bar.show(4, "diagnosis")
        answer = bench.diagnosis(*truth, Path(folder))
        known = rig if answer.improved is None else answer.improved
        if answer.improved is not None:
            rough.append(bench.controller(IMPROVED, known, *truth))
        bar.show(5, "learning")
        rough.append(bench.repeated(known, *truth, given.repetitions))
        bar.show(6, "learning")
    print(f"diagnosis of the rough rig: {answer.sentence}")
    print("RMS error of the arm's motion [mrad]")
    named = (("rig that matches its rig file", clean), ("rough rig", rough))
    for words, ways in named:
        for way in ways:
            print(f"{words:24s}  {way.name:40s} {1e3 * way.rms:7.2f}  {way.stopped}".rstrip())
    path = make_parents(given.out / PICTURE)
    draw(path, dict(named))
    print(f"written: {path}")
    found = problems(clean, rough)
    if answer.improved is None:
        found.append("the diagnosis has written no improved rig file")
    document = {
        "seed": given.seed,
        "diagnosis": answer.to_json(),
        "rms": {words: {way.name: way.rms for way in ways} for words, ways in named},
        "unit": "rad",
        "picture": path,
    }
    return Outcome(document, found)
