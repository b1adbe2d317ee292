"""How well the controller tracks on rigs that are not their rig file.

`pam check rough-control` hides every effect, one after the other, in the independent
plant of the blind check, gives the controller the nominal rig file, and plays two motions. Beside
it runs a PID with feedforward that was tuned on that very rig (`tuned_pid`). What the tuning found
is kept in a file, because it takes about a minute per rig; the rest takes a second per motion. What
was found with other code is searched again.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

import pam_control
import pam_model
from pam_check.blind.effect_cases import KNOWN
from pam_check.blind.plants import FIRST
from pam_check.blind.truth_plant import TruthJoint
from pam_check.control.closed_loop import TOLD, Muscles, PlayedRun, play, true_rig
from pam_check.control.hidden_rigs import NOTHING, chosen_rigs, hidden_rig
from pam_check.control.motions import MOTIONS
from pam_check.control.tuned_pid import Motions, TunedPid, TuningBench, tune
from pam_control.controller import Controller
from pam_control.feedback.kept_designs import KeptDesigns, user_cache_folder
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.settings import ControlSettings
from pam_model.argument_types import make_parents
from pam_model.command_line import Arguments, Outcome, progress
from pam_model.common_options import chosen_rig
from pam_model.errors import PamError
from pam_model.rig import Rig, load_rig

WORST_RATIO: Final = 1.1  # of the controller's error to that of the tuned PID
MOST_CLIPPED: Final = 0.05  # of the arm's motion
NO_HARM: Final = (1.05, 1e-4)
"""Times the error without adaptation, or above it [rad], which is no harm: the larger one."""


@dataclass(slots=True)
class RoughResult:
    """One effect and one motion.

    Attributes
    ----------
    effect, motion : str
        What was hidden, and what was played.
    controller : PlayedRun
        With the nominal rig file, at the last time.
    first : PlayedRun
        The same at the first time, when the controller had learnt nothing.
    pid : PlayedRun or None
        The tuned PID; None without its search.
    seconds : float
        Processor time of a run of the controller [s].
    unadapted : tuple of PlayedRun
        The controller without adaptation at the first and at the last time, in the same noise;
        empty if it was not compared.
    """

    effect: str
    motion: str
    controller: PlayedRun
    first: PlayedRun
    pid: PlayedRun | None = None
    seconds: float = 0.0
    unadapted: tuple[PlayedRun, ...] = ()

    @property
    def ratio(self) -> float:
        """The controller's error at the last time over that of the tuned PID; NaN without one."""
        return math.nan if self.pid is None else self.controller.rms / self.pid.rms

    @property
    def first_ratio(self) -> float:
        """The same at the first time."""
        return math.nan if self.pid is None else self.first.rms / self.pid.rms

    def harm(self) -> list[str]:
        """Where what was learnt makes the error larger than it is without adaptation."""
        found = []
        for turn, mine, plain in zip(
            ("first", "last"), (self.first, self.controller), self.unadapted, strict=False
        ):
            factor, more = NO_HARM
            if mine.rms > max(factor * plain.rms, plain.rms + more):
                found.append(
                    f"{self.effect}, {self.motion}: {1e3 * mine.rms:.2f} mrad the {turn} time, "
                    f"{1e3 * plain.rms:.2f} mrad without adaptation"
                )
        return found

    def problems(self) -> list[str]:
        """What is not as it should be."""
        what = f"{self.effect}, {self.motion}"
        found = self.harm()
        if self.ratio > WORST_RATIO and self.effect != NOTHING:
            found.append(f"{what}: {self.ratio:.2f} times the error of the tuned PID")
        for played in {id(each): each for each in (self.first, self.controller)}.values():
            if played.cycles:
                shown = played.stopped or f"{1e3 * played.limit_cycle:.1f} mrad"
                found.append(f"{what}: limit cycle, {shown}")
        if self.motion == "arm" and self.controller.clipped > MOST_CLIPPED:
            found.append(f"{what}: a valve is at its end {self.controller.clipped:.0%} of the time")
        return found

    def document(self) -> dict[str, object]:
        """For --json."""
        return {**asdict(self), "ratio": self.ratio, "first_ratio": self.first_ratio}


@dataclass
class Baselines:
    """The tuned PIDs of earlier runs, kept in a file.

    Attributes
    ----------
    path : Path
        JSON; it need not exist.
    """

    path: Path
    _known: dict[str, TunedPid] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.path.is_file():
            return
        try:
            for key, entry in json.loads(self.path.read_text()).items():
                self._known[key] = TunedPid(
                    tuple(entry["gains"]),
                    float(entry["pressure_gain"]),
                    tuple(entry["feedforward"]),
                    int(entry["tried"]),
                )
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise PamError(f"{self.path}: not a file of tuned gains ({error})") from None

    def get(self, key: str, search: Callable[[], TunedPid]) -> TunedPid:
        """The gains for a key; searched and written if they are not known."""
        if key not in self._known:
            self._known[key] = search()
            content = {key: asdict(tuned) for key, tuned in self._known.items()}
            make_parents(self.path).write_text(json.dumps(content, indent=1))
        return self._known[key]


class RoughControl:
    """The controller and the baselines for one rig file.

    Parameters
    ----------
    rig : Rig
        The nominal rig.
    settings : ControlSettings
        Of the controller.
    seed : int
        Of the motions and of the noise.
    pressure_loops : bool, optional
        Whether the PID's pressure loops are tuned as well.
    plays : int, optional
        How often the controller plays each motion; it keeps what it learns meanwhile.
    compares : bool, optional
        Whether the controller without adaptation plays each motion as well.
    plant : str, optional
        Which has the true rigs.

    Attributes
    ----------
    rig, seed
        See above.
    """

    def __init__(
        self,
        rig: Rig,
        settings: ControlSettings,
        seed: int,
        pressure_loops: bool = False,
        plays: int = 1,
        compares: bool = False,
        plant: str = FIRST,
    ) -> None:
        self._plays, self._plant = plays, plant
        self.rig, self.seed, self._pressure_loops = rig, seed, pressure_loops
        self.designs = KeptDesigns(user_cache_folder())
        self._true = true_rig(rig)
        self.controller = Controller(rig, settings, self.designs)
        plain = settings.replace(adaptation=False)
        self._unadapted = Controller(rig, plain, self.designs) if compares else None
        self.motions: Motions = {
            name: make(np.random.default_rng([seed, index]))
            for index, (name, make) in enumerate(MOTIONS.items())
        }

    def hidden(self, effect: str) -> tuple[TruthJoint, Muscles]:
        """The true rig with what is hidden in one of `hidden_rigs`."""
        return hidden_rig(self._true, effect)

    def run(self, effect: str, baselines: Baselines | None, tries: int) -> list[RoughResult]:
        """Play all motions with a hidden effect."""
        joint, muscles = self.hidden(effect)
        results = []
        for name, points in self.motions.items():
            start = time.process_time()
            self.controller.forget_adaptation()
            played = [
                self._played(self.controller, (joint, muscles), points, index)
                for index in range(self._plays)
            ]
            seconds = (time.process_time() - start) / self._plays
            plain: tuple[PlayedRun, ...] = ()
            if self._unadapted is not None:
                plain = tuple(
                    self._played(self._unadapted, (joint, muscles), points, index)
                    for index in (0, self._plays - 1)
                )
            results.append(RoughResult(effect, name, played[-1], played[0], None, seconds, plain))
        if baselines is None:
            return results
        bench, tuned = self.tuned_pid(joint, muscles, baselines, tries)
        runs = bench.play(tuned)
        return [dataclasses.replace(each, pid=runs[each.motion][0]) for each in results]

    def _played(
        self,
        controller: Controller,
        true: tuple[TruthJoint, Muscles],
        points: Sequence[TrajectoryPoint],
        index: int,
    ) -> PlayedRun:
        """Play a motion for the time of this number, with its noise."""
        return play(controller, *true, points, self.seed + index, plant_name=self._plant)[0]

    def tuned_pid(
        self, joint: TruthJoint, muscles: Muscles, baselines: Baselines, tries: int
    ) -> tuple[TuningBench, TunedPid]:
        """A true rig with the PID that was tuned on it, in these motions."""
        bench = TuningBench(
            self.rig, joint, muscles, self.motions, self.seed, self.designs, self._plant
        )
        key = self._key(joint, muscles, tries)
        return bench, baselines.get(key, lambda: tune(bench, tries, self._pressure_loops))

    def _key(self, joint: TruthJoint, muscles: Muscles, tries: int) -> str:
        parts = [self.rig.to_parameters(), joint, muscles, self.motions, self.seed, tries]
        parts += [self._pressure_loops, self._plant, code_version()]
        return hashlib.sha256(repr(parts).encode()).hexdigest()[:24]


@functools.cache
def code_version() -> str:
    """Digest of all code that the tuning of a PID runs."""
    here = Path(__file__)
    blind = (
        here.parents[1] / "blind" / f"{n}.py"
        for n in (
            "truth_plant",
            "second_plant",
            "second_motion",
            "second_laws",
            "effect_cases",
            "hidden_size",
        )
    )
    files = [*here.parent.glob("*.py"), *blind]
    for package in (pam_control, pam_model):
        files += Path(str(package.__file__)).parent.rglob("*.py")
    digest = hashlib.sha256()
    for path in sorted(files):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _row(result: RoughResult) -> str:
    mine, pid = result.controller, result.pid
    cells = [
        f"{result.effect:20s} {result.motion:6s} {1e3 * result.first.rms:8.2f}",
        f"{1e3 * mine.rms:8.2f}",
        f"{1e3 * pid.rms:8.2f} {result.ratio:6.2f}" if pid else f"{'-':>8s} {'-':>6s}",
        f"{100.0 * mine.clipped:6.1f} {1e3 * mine.limit_cycle:8.2f}",
        f"{'yes' if mine.cycles else 'no':>4s} {mine.activity:7.1f}",
    ]
    if result.unadapted:
        cells.append(" ".join(f"{1e3 * plain.rms:8.2f}" for plain in result.unadapted))
    told = result.first.swings or mine.swings
    notes = [
        f"stopped: {mine.stopped}" if mine.stopped else "",
        "soft gains" if mine.softened else "",
        f"told: {told}" if told else "",
    ]
    return " ".join([*cells, "; ".join(note for note in notes if note)]).rstrip()


HEADER: Final = (
    f"{'hidden':20s} {'motion':6s} {'first':>8s} {'last':>8s} {'PID':>8s} {'ratio':>6s} "
    f"{'clip %':>6s} {'rest':>8s} cycle  spool/s"
)
UNADAPTED: Final = "  first and last time without adaptation"


def _compared(ratios: Sequence[tuple[str, float]]) -> str:
    """How many effects are how good, by the larger one of the ratios of each."""
    worse: dict[str, float] = {}
    for effect, ratio in ratios:
        worse[effect] = max(worse.get(effect, 0.0), ratio)
    half = sum(ratio <= 0.5 for ratio in worse.values())
    within = sum(ratio <= WORST_RATIO for ratio in worse.values())
    return f"{half} with at most half the error of the tuned PID, {within} within {WORST_RATIO:g}"


def summary(results: Sequence[RoughResult]) -> str:
    """How often the controller is better, in one line."""
    judged = [each for each in results if each.effect != NOTHING and each.pid is not None]
    cycles = {result.effect for result in results if result.controller.cycles}
    text = f"{len(cycles)} effects with a limit cycle"
    if any(result.unadapted for result in results):
        harmed = {result.effect for result in results if result.harm()}
        text += f"; {len(harmed)} worse than without adaptation"
    if not judged:
        return text
    return (
        f"of {len({each.effect for each in judged})} effects, in the worse motion: the first time "
        f"{_compared([(each.effect, each.first_ratio) for each in judged])} times it, the last "
        f"time {_compared([(each.effect, each.ratio) for each in judged])} times it; {text}"
    )


def run(given: Arguments) -> Outcome:
    """Play all effects and print the table; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        For a rig, an effect or a file that cannot be used.
    """
    effects = chosen_rigs("--effects", given.effects, [NOTHING, *KNOWN])
    settings = TOLD.replace(observer=given.observer, adaptation=not given.no_adaptation)
    rig = load_rig(chosen_rig(given))
    compares = given.compare_unadapted
    rough = RoughControl(
        rig, settings, given.seed, given.tune_pressure_loops, given.plays, compares, given.plant
    )
    baselines = Baselines(given.tuned) if given.tries else None
    results: list[RoughResult] = []
    print(HEADER + (UNADAPTED if compares else ""))
    with progress(len(effects), "effects") as bar:
        for done, effect in enumerate(effects, start=1):
            for result in rough.run(effect, baselines, given.tries):
                results.append(result)
                print(_row(result), flush=True)
            bar.show(done, effect)
    seconds = float(np.mean([result.seconds for result in results]))
    print(f"{summary(results)}; {seconds:.1f} s of processor time per effect and motion")
    problems = [problem for result in results for problem in result.problems()]
    document = {
        "seed": given.seed,
        "seconds_per_run": seconds,
        "results": [result.document() for result in results],
        "problems": problems,
    }
    return Outcome(document, problems)
