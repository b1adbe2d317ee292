"""The next experiment: the one that best separates hypotheses that the data do not distinguish.

Every excitation of the menu is simulated with the leading hypothesis. Every other hypothesis then
predicts that recording as a diagnosis would. Its free parameters and nuisance parameters are moved
as far as the recordings so far allow, so that it imitates the simulated recording as closely as a
linearised fit can. The difference that remains after this re-fit, in units of what the leading
hypothesis itself leaves unexplained, is the separation. The excitation whose smallest pairwise
separation is largest is proposed. This is T-optimality (Atkinson and Fedorov, Biometrika 62, 1975),
for more than two rivals in its max-min form (Hunter and Reiner, Technometrics 7, 1965).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pam_gap.experiments.excitations import Excitation, Menu
from pam_gap.experiments.files import FOLDER, write_experiment
from pam_gap.experiments.loop import ExperimentLoop
from pam_gap.inference.hypothesis import Hypothesis, HypothesisFitter
from pam_gap.prediction.channel_order import N_CHANNELS
from pam_gap.prediction.fit import (
    Array,
    Scaling,
    Slopes,
    mean_squares,
    normal_equations,
    numerical_jacobian,
)
from pam_gap.prediction.problem import PredictionProblem, as_mounted
from pam_gap.recordings.recording import COMMANDS, Recording
from pam_gap.rules import DEFAULT
from pam_model.plant.simulate import Plant, initial_state


@dataclass(frozen=True, slots=True)
class Separation:
    """How well one excitation would separate the hypotheses."""

    excitation: Excitation  # excitation of the menu
    # smallest expected difference of the levels of two hypotheses (sum over channels of the log
    # mean square, both recordings together)
    smallest: float
    # RMS difference between the predictions of these two after the re-fit, in units of the noise
    # floor
    in_noise: float
    closest: tuple[str, str]  # labels of these two hypotheses
    # expected difference of the levels that counts as separating two hypotheses
    decisive: float = DEFAULT.experiment.decisive

    @property
    def is_decisive(self) -> bool:
        """Whether the experiment is expected to distinguish the two closest hypotheses."""
        return self.smallest > self.decisive


def simulate_excitation(
    problem: PredictionProblem, values: Array, excitation: Excitation
) -> Recording:
    """The recording that a plant would give under an excitation, with the noise of the channels.

    Parameters
    ----------
    problem : PredictionProblem
        Rig, and recordings that determine the channels and the noise of the new one.
    values : ndarray, shape (n_parameters,)
        Parameters of the plant.
    """
    mounted = as_mounted(values[None], excitation.mounting)[0]
    parameters = replace(problem.base, values=mounted)
    loop = ExperimentLoop(problem.rig, problem.joint, excitation)
    pressures = loop.start_pressures
    start = [p if r else 0.0 for p, r in zip(pressures, loop.is_regulated, strict=True)]
    state = initial_state(parameters, pressures=pressures, commands=start)
    plant = Plant(parameters, problem.rules.prediction.step, state)
    dt = excitation.sample_time
    count = excitation.time.size
    measured, commands = np.zeros((count, N_CHANNELS)), np.zeros((count, 2))
    seen: tuple[float, ...] = (0.0, *pressures)
    for k, time in enumerate(excitation.time.tolist()):
        output = plant.output
        position, agonist, antagonist = seen
        forces = (output["agonist.force"], output["antagonist.force"])
        measured[k] = (agonist, antagonist, position, *forces)
        sent = loop.commands(time, position, (agonist, antagonist))
        commands[k] = sent
        seen = plant.step(sent, dt)
    template = problem.data[0]
    noise = np.nan_to_num(np.mean([d.deviation for d in problem.data], axis=0))
    measured += noise * np.random.default_rng(0).standard_normal(measured.shape)
    values_by_name = {
        name: measured[:, c] for c, name in enumerate(problem.names) if problem.recorded[c]
    }
    if template.has_commands:
        for i, muscle in enumerate(problem.rig.joints[problem.joint].muscles):
            values_by_name[f"{COMMANDS}{muscle}"] = commands[:, i]
    valid = {name: np.ones(count, dtype=np.bool_) for name in values_by_name}
    return Recording(
        Path(excitation.name), dt, excitation.time, values_by_name, valid, (), excitation.mounting
    )


def difference_after_refit(
    apart: Array,
    jacobian: Slopes,
    rows: npt.NDArray[np.bool_],
    weights: Array,
    known: Array,
    correlation: float,
) -> Array:
    """The difference that remains after a linearised re-fit of the imitating hypothesis.

    Parameters
    ----------
    apart : ndarray, shape (n_rows, n_channels)
        Difference of the two predictions; a row with NaN or infinity is not fitted.
    jacobian : ndarray, shape (n_rows, n_channels, n_parameters)
        Slopes of the imitating prediction.
    rows : ndarray of bool, shape (n_rows,)
        The rows that count.
    weights : ndarray, shape (n_channels,)
        Of the squares of each channel.
    known : ndarray, shape (n_parameters, n_parameters)
        Fisher information about the parameters from the recordings so far.
    correlation : float
        How many samples carry the information of one independent sample.
    """
    apart = np.where(np.isfinite(apart), apart, np.nan)
    hessian, slope = normal_equations(apart, jacobian, rows, weights)
    total = hessian / correlation + known
    # With columns of unit size, the parameters' units do not decide which directions count as
    # undetermined.
    size = np.sqrt(np.diag(total))
    size[size == 0.0] = 1.0
    scaled = total / np.outer(size, size)
    move = -np.linalg.lstsq(scaled, slope / size / correlation, rcond=1e-10)[0] / size
    left: Array = apart + jacobian @ move
    return left


class ExperimentPlanner:
    """Chooses an excitation for the survivors of one diagnosis.

    Parameters
    ----------
    survivors : sequence of Hypothesis
        At least two, the leading one first; `most_survivors` of them are compared.
    """

    def __init__(self, fitter: HypothesisFitter, survivors: Sequence[Hypothesis]) -> None:
        self.fitter = fitter
        self.problem = fitter.problem
        self.rules = fitter.rules.experiment
        self.survivors = tuple(survivors[: self.rules.most_survivors])
        leading = self.survivors[0]
        self.left = np.maximum(leading.mean_square, fitter.floor)
        self.weights = np.where(self.problem.present, 1.0 / self.left, 0.0)
        self.known = [self._information(h) for h in self.survivors]

    def _information(self, h: Hypothesis) -> Array:
        """Fisher information of the recordings about the fitted (scaled) parameters."""
        free, _, _ = self.fitter.problem_parts(h.members)
        curvature, _ = normal_equations(
            np.nan_to_num(h.result.errors), h.result.jacobian, self.problem.counted, self.weights
        )
        prior: Array = np.diag(Scaling(free).weight ** 2)
        result: Array = curvature / self.rules.correlation + prior
        return result

    def separation(self, excitation: Excitation) -> Separation:
        """How well an excitation separates the two closest surviving hypotheses."""
        leading = self.survivors[0]
        recording = simulate_excitation(
            self.problem, self.fitter.vector(leading.members, leading.result.values), excitation
        )
        trial = PredictionProblem(
            self.problem.rig,
            self.problem.joint,
            [recording],
            rules=self.problem.rules,
            threads=self.problem.threads,
        )
        errors, jacobians = [], []
        step = trial.rules.prediction.fit_difference
        for h in self.survivors:
            free, targets, factor = self.fitter.problem_parts(h.members)
            predict = trial.predictor(trial.base.values, targets, factor)
            scaling = Scaling(free)
            at = scaling.scaled(h.result.values)
            own = predict(scaling.own(at[None]))[0]
            errors.append(own)
            jacobians.append(
                numerical_jacobian(predict, scaling, at, own, np.arange(at.size), step)
            )
        rows = trial.counted
        share = float(rows.sum()) / float(rows.sum() + self.problem.counted.sum())
        worst = Separation(excitation, np.inf, np.inf, ("", ""), self.rules.decisive)
        for i, j in permutations(range(len(self.survivors)), 2):
            apart = errors[j] - errors[i]
            left = difference_after_refit(
                apart, jacobians[j], rows, self.weights, self.known[j], self.rules.correlation
            )
            mean = mean_squares(left, rows)[self.problem.present]
            level = float(np.sum(np.log1p(share * mean / self.left[self.problem.present])))
            if level < worst.smallest:
                noise = float(np.sqrt(np.max(mean / self.fitter.floor[self.problem.present])))
                names = (self.survivors[i].label, self.survivors[j].label)
                worst = Separation(excitation, level, noise, names, self.rules.decisive)
        return worst

    def choose(self, menu: Sequence[Excitation]) -> tuple[Separation, ...]:
        """Every excitation that can be simulated, with its separation, best first."""
        found = []
        for excitation in menu:
            separation = self.separation(excitation)
            if np.isfinite(separation.smallest):
                found.append(separation)
        return tuple(sorted(found, key=lambda s: -s.smallest))


@dataclass(frozen=True, slots=True)
class Proposal:
    """The proposed experiment, and how the rest of the menu compares with it."""

    problem: PredictionProblem  # the rig and recordings that it is proposed for
    ranking: tuple[Separation, ...]  # the whole menu, best first

    @property
    def best(self) -> Separation:
        """The excitation that is proposed."""
        return self.ranking[0]

    def sentence(self) -> str:
        """The instruction, as text."""
        best = self.best
        times = f"{float(f'{best.in_noise:.3g}'):g}"  # 2610, not 2.61e+03
        words = (
            f"{best.excitation.name}: {best.excitation.instruction} "
            f"({best.excitation.duration:.0f} s; files in {FOLDER}/). The predictions of "
            f"{best.closest[0]} and {best.closest[1]}, the two closest hypotheses, should then "
            f"differ by {times} times the noise after each has been fitted again."
        )
        if not best.is_decisive:
            words += (
                " Compared with the error that both of them leave, this difference may be too "
                "small: no experiment of the menu separates them well."
            )
        return words

    def write(self, folder: Path) -> None:
        """Write the files that play the experiment, and the ranking of the menu."""
        ranking = [
            {
                "name": s.excitation.name,
                "expected_level": s.smallest,
                "times_noise": s.in_noise,
                "closest": list(s.closest),
            }
            for s in self.ranking
        ]
        write_experiment(
            folder, self.problem.rig, self.problem.joint, self.best.excitation, {"menu": ranking}
        )


def propose(fitter: HypothesisFitter, survivors: Sequence[Hypothesis]) -> Proposal | None:
    """The experiment whose smallest separation is largest; None for fewer than two survivors.

    Parameters
    ----------
    fitter : HypothesisFitter
        Of the problem diagnosed.
    survivors : sequence of Hypothesis
        Hypotheses that the data could not distinguish, best first; `most_survivors` of them are
        compared.
    """
    if len(survivors) < 2:
        return None
    problem = fitter.problem
    menu = Menu(problem.rig, problem.joint, problem.data[0].recording.sample_time)
    ranking = ExperimentPlanner(fitter, survivors).choose(menu.entries())
    return Proposal(problem, ranking) if ranking else None
