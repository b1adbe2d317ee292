"""What a diagnosis is worth to a policy that is trained in simulation.

`pam check trained-policy` makes the rough rig of rough_rig.py, records and diagnoses it, and trains
a policy by the cross-entropy method (Rubinstein and Kroese, The Cross-Entropy Method, 2004) in the
Gymnasium environment of three robots: the rig file as written, the one that the diagnosis improved,
and improved ones whose numbers are drawn from its intervals. Each policy is then tried on the
independent plant of the blind check, which no training has seen.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pam_check.blind.truth_plant import Sensors, TruthJoint
from pam_check.control.closed_loop import Muscles
from pam_check.control.rough_control import Baselines
from pam_check.control.rough_rig import RoughRig, rough_truth
from pam_check.control.running_truth import RunningTruth
from pam_gap.answer.page_style import PLOT_LOOK
from pam_model.argument_types import make_parents
from pam_model.command_line import Arguments, Outcome, progress
from pam_model.common_options import chosen_rig
from pam_model.rig import Rig, load_rig
from pam_sim.environment import EpisodeTask, PamVectorEnv
from pam_sim.randomisation import Randomisation

Array = npt.NDArray[np.float64]

PICTURE: Final = "trained_policy.png"
TASK: Final = EpisodeTask(period=0.02, seconds=8.0, hold=1.0)
WRITTEN, IMPROVED, DRAWN = (
    "rig file as written",
    "improved rig file",
    "improved, drawn from the intervals",
)
TRIED: Final = 60.0  # s on the independent plant
MIDDLE: Final = 0.35  # of max_pressure, where both pressures meet
INTEGRAL: Final = 0.5  # rad s, at most
LOOK: Final[Any] = PLOT_LOOK


@dataclass(slots=True)
class Policy:
    """Pressures by a linear law, and valves in proportion to the pressures' errors.

    The two muscles should have MIDDLE + d and MIDDLE - d of their largest pressure, where d is
    linear in the target, the error, its integral and the velocity.

    Attributes
    ----------
    numbers : (..., 5) array
        Logarithms of the gains: of the valves, target, error, integral, velocity.
    integral : (...) array
        Of the error [rad s].
    """

    numbers: Array
    integral: Array

    @classmethod
    def of(cls, numbers: Array) -> Policy:
        """A policy that has not acted yet, or many of them."""
        return cls(numbers, np.zeros(numbers.shape[:-1]))

    def act(self, seen: Array) -> Array:
        """Actions (..., 2) for observations (..., 5) of the environment of one joint."""
        position, velocity, first, second, target = np.moveaxis(seen, -1, 0)
        valve, ahead, error_gain, integral_gain, damping = np.moveaxis(np.exp(self.numbers), -1, 0)
        error = target - position
        self.integral = np.clip(self.integral + error * TASK.period, -INTEGRAL, INTEGRAL)
        d = ahead * target + error_gain * error + integral_gain * self.integral
        d = np.clip(d - damping * velocity, -MIDDLE, 1.0 - MIDDLE)
        opened = [valve * (MIDDLE + d - first), valve * (MIDDLE - d - second)]
        action: Array = np.clip(np.stack(opened, axis=-1), -1.0, 1.0)
        return action


START: Final = np.log([3.0, 0.2, 0.3, 0.3, 0.02])


@dataclass(frozen=True, slots=True)
class CrossEntropySearch:
    """How long the cross-entropy method searches.

    Attributes
    ----------
    candidates : int
        Policies of a generation; the best eighth makes the next one.
    robots : int
        On which each of them is judged.
    generations : int
        How often.
    """

    candidates: int = 32
    robots: int = 2
    generations: int = 15


def train(rig: Rig, randomisation: Randomisation, search: CrossEntropySearch, seed: int) -> Array:
    """The numbers of the policy that the search ends with.

    Parameters
    ----------
    rig : Rig
        The robot to train on, of one joint with flow valves.
    randomisation : Randomisation
        How its numbers are drawn.
    search : CrossEntropySearch
        How long.
    seed : int
        Of candidates, numbers and targets.
    """
    generator = np.random.default_rng(seed)
    lanes = search.candidates * search.robots
    envs = PamVectorEnv(rig, lanes, TASK, randomisation)
    mean, spread = START.copy(), np.full(START.size, 0.7)
    for generation in range(search.generations):
        candidates = mean + spread * generator.standard_normal((search.candidates, mean.size))
        policy = Policy.of(np.repeat(candidates, search.robots, axis=0))
        seen, _ = envs.reset(seed=seed + 1000 * generation)
        total, truncated = np.zeros(lanes), False
        while not truncated:
            seen, reward, _, ended, _ = envs.step(policy.act(seen))
            total += reward
            truncated = bool(ended[0])
        score = total.reshape(search.candidates, search.robots).mean(axis=1)
        best = candidates[np.argsort(score)[-max(search.candidates // 8, 2) :]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 0.02
    return mean


@dataclass(frozen=True, slots=True, eq=False)
class Tried:
    """A policy on the independent plant, one row per period.

    Attributes
    ----------
    position, target : (n,) array
        True and asked angle [rad].
    """

    position: Array
    target: Array

    @property
    def rms(self) -> float:
        """Of the error [rad]."""
        return float(np.sqrt(np.mean((self.target - self.position) ** 2)))

    @property
    def settled(self) -> float:
        """RMS error in the second half of each hold [rad], when the joint should be there."""
        place = np.arange(len(self.target)) % round(TASK.hold / TASK.period)
        late = place >= round(0.5 * TASK.hold / TASK.period)
        return float(np.sqrt(np.mean((self.target - self.position)[late] ** 2)))


def tried(
    numbers: Array, rig: Rig, joint: TruthJoint, muscles: Muscles, seed: int, seconds: float = TRIED
) -> Tried:
    """Let a policy act on the independent plant, with noise on its sensors.

    Parameters
    ----------
    numbers : (5,) array
        Of the policy.
    rig : Rig
        What its owner believes: limits and `max_pressure`.
    joint, muscles : TruthJoint, pair of TruthMuscle
        The true rig.
    seed : int
        Of targets and noise.
    seconds : float, optional
        How long [s].
    """
    generator = np.random.default_rng(seed)
    count, hold = round(seconds / TASK.period), round(TASK.hold / TASK.period)
    low, high = TASK.reach * np.array(rig.joints[0].position_limits)
    targets = np.repeat(generator.uniform(low, high, -(-count // hold)), hold)[:count]
    largest = np.array([rig.muscle(name).max_pressure for name in rig.joints[0].muscles])
    plant = RunningTruth(
        joint, muscles, Sensors(), generator,
        period=TASK.period, count=count, pressure=MIDDLE * float(largest[0]),
    )  # fmt: skip
    policy = Policy.of(numbers)
    before, action = 0.0, np.zeros(2)
    for k in range(count):
        # What the sensors showed a period ago: a policy acts after it has seen.
        shown = plant.advance((float(action[0]), float(action[1])))
        velocity = (shown[2] - before) / TASK.period
        before = shown[2]
        seen = np.array([shown[2], velocity, *(shown[:2] / largest), targets[k]])
        action = policy.act(seen)
    return Tried(plant.truth[:, 2], targets)


def _draw(path: Path, found: dict[str, list[Tried]]) -> None:
    with mpl.rc_context(LOOK):
        figure = Figure(figsize=(6.0, 5.4), layout="constrained")
        FigureCanvasAgg(figure)
        motion, bars = figure.subplots(2, 1, height_ratios=[3, 2])
        shown = slice(0, round(8.0 / TASK.period))
        first = next(iter(found.values()))[0]
        time = np.arange(len(first.target))[shown] * TASK.period
        motion.step(time, first.target[shown], "k--", where="post", label="asked", linewidth=1.0)
        for name, runs in found.items():
            motion.plot(time, runs[0].position[shown], label=name)
        motion.set(xlabel="time on the independent plant [s]", ylabel="angle [rad]")
        motion.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
        for place, runs in enumerate(found.values()):
            errors = [1e3 * run.rms for run in runs]
            bars.barh(place, np.mean(errors), color=f"C{place}", height=0.6)
            bars.plot(errors, [place] * len(errors), "k.", markersize=4)
            bars.text(max(errors), place, f"  {np.mean(errors):.0f}", va="center")
        bars.set_yticks(range(len(found)), [name.replace(", ", ",\n") for name in found])
        bars.invert_yaxis()
        bars.set_xlabel("RMS error [mrad]; points: single trainings")
        bars.margins(x=0.15)
        figure.savefig(path, dpi=150, bbox_inches="tight")


def run(given: Arguments) -> Outcome:
    """Diagnose the rough rig, train on three robots, and try the policies on the true one.

    Raises
    ------
    PamError
        For a rig or a file that cannot be used.
    """
    rig = load_rig(chosen_rig(given))
    truth = rough_truth(rig)
    with progress(1 + 3 * given.trainings, "policies") as bar:
        with tempfile.TemporaryDirectory() as folder:
            bench = RoughRig(rig, given.seed, Baselines(Path(folder) / "none.json"), 1)
            answer = bench.diagnosis(*truth, Path(folder))
        print(f"diagnosis of the rough rig: {answer.sentence}")
        improved = answer.improved
        if improved is None:
            return Outcome({"diagnosis": answer.to_json()}, ["no improved rig file was written"])
        path = make_parents(given.out / "diagnosis.json")
        answer.write(path)
        drawn = Randomisation.from_diagnosis(path)
        ways = {
            WRITTEN: (rig, Randomisation()),
            IMPROVED: (improved, Randomisation()),
            DRAWN: (improved, drawn),
        }
        found: dict[str, list[Tried]] = {name: [] for name in ways}
        done = 1
        for name, (known, randomisation) in ways.items():
            for k in range(given.trainings):
                search = replace(CrossEntropySearch(), generations=given.generations)
                numbers = train(known, randomisation, search, given.seed + k)
                found[name].append(tried(numbers, rig, *truth, given.seed))
                done += 1
                bar.show(done, name)
    print(f"RMS error of {given.trainings} policies on the independent plant [mrad]")
    for name, runs in found.items():
        errors = "  ".join(f"{1e3 * run.rms:6.1f}" for run in runs)
        late = "  ".join(f"{1e3 * run.settled:6.1f}" for run in runs)
        print(f"{name:36s}  all {errors}   second half of each hold {late}")
    picture = given.out / PICTURE
    _draw(picture, found)
    print(f"written: {picture}")
    means = {name: float(np.mean([run.rms for run in runs])) for name, runs in found.items()}
    worse = [
        f"{name}: {1e3 * means[name]:.1f} mrad, where training with the rig file as written gives "
        f"{1e3 * means[WRITTEN]:.1f} mrad"
        for name in (IMPROVED, DRAWN)
        if means[name] >= means[WRITTEN]
    ]
    document = {
        "rms": {name: [run.rms for run in runs] for name, runs in found.items()},
        "settled": {name: [run.settled for run in runs] for name, runs in found.items()},
        "unit": "rad",
        "picture": picture,
        "diagnosis": answer.to_json(),
    }
    return Outcome(document, worse)
