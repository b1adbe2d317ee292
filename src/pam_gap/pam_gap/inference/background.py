"""The ordinary background of a good rig: what it looks like, and what it leaves unexplained.

No rig is exact. A good one has a little thread friction, creep, dry friction, leakage and play of
the spools, and sensors that are not quite linear and drift. None of that is a cause. The change
that an ordinary amount of each makes is simulated once along the recording. Every hypothesis then
contains these changes, in amounts within their ordinary bounds, in addition to the re-tuned
numbers: small effects are nuisance parameters and not noise (Basseville and Nikiforov, Fault
isolation for diagnosis: nuisance rejection, Annu. Rev. Control 26, 2002; Kennedy and O'Hagan, J. R.
Statist. Soc. B 63, 2001, with an informative prior as Brynjarsdottir and O'Hagan, Inverse Problems
30, 2014, recommend). They are linear, so that they cost no simulation in a fit. Either muscle has
amounts of its own, and thread friction and creep are mixtures of several strokes and time
constants.

The laws of a real background differ from those of the effects. A share of the whole background
therefore remains; it plays the part of V_discrepancy in history matching (Gardner, Lord and
Barthorpe, Mech. Syst. Signal Process. 143, 2020).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from pam_gap.inference.candidates import ordinary_sizes, rig_scales
from pam_gap.prediction.channel_order import BOTH_FORCES, BOTH_PRESSURES, POSITION
from pam_gap.prediction.channels import Channels
from pam_gap.prediction.fit import (
    Array,
    FreeParameter,
    Scaling,
    Slopes,
    mean_squares,
    normal_equations,
)
from pam_gap.prediction.linear_terms import LinearTerms
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.rules.decision_rules import DecisionRules
from pam_model.effects import EFFECTS
from pam_model.plant.muscle_arms import SIDES
from pam_model.plant.parameters import INDEX

SENSOR_RANGES = tuple(f * 10.0**k for k in (4, 5, 6, 7) for f in (1.0, 1.6, 2.5, 4.0, 6.0))
"""Usual ranges of pressure sensors [Pa] (EN 837-1, table of scale ranges)."""
HEADROOM = 1.25
"""Range of a pressure sensor that is chosen for a supply, at least, over the supply pressure."""
ECCENTRIC_ROUNDS = 6
"""Fixed-point steps from a reading to the angle; each leaves the size of the error in rad."""


@dataclass(frozen=True, slots=True)
class Background:
    """Changes of the errors that the parts of an ordinary background make.

    Attributes
    ----------
    effects : tuple of str
        For each part, the effect of which it is an ordinary amount; empty for errors of sensors
        that are no effect of the table.
    terms : LinearTerms
        Changes that the largest ordinary amount of each part makes, and bounds of the amounts.
    """

    effects: tuple[str, ...]
    terms: LinearTerms

    def beside(self, effects: Collection[str]) -> LinearTerms:
        """The terms for a hypothesis with these effects, which replace their ordinary amounts."""
        own = set(effects)
        for name in effects:
            richer = EFFECTS[name].search.richer
            if richer is not None:
                own.add(richer.than)
        absent = tuple(effect in own for effect in self.effects)
        if not any(absent):
            return self.terms
        return self.terms.without(absent)


@dataclass(frozen=True, slots=True)
class SensorPart:
    """A part of a background that no effect of the table describes: it changes what is recorded."""

    name: str  # in words, for the answer
    # (problem, channels, amount) -> channels with this amount, in the largest ordinary sizes
    change: Callable[[PredictionProblem, Channels, float], Channels]
    is_one_way: bool = False  # whether the amount cannot be negative

    def errors(self, problem: PredictionProblem, vector: Array, amount: float) -> Array:
        """Errors of a plant if the recordings are changed by this amount."""
        changed = problem.with_data(lambda data: self.change(problem, data, amount))
        result: Array = changed.errors(vector[None])[0]
        return result


def _muscles(problem: PredictionProblem) -> list[tuple[int, str]]:
    """Channel of each muscle that exists, and what it is called."""
    return list(enumerate(("muscle",) if problem.is_bench else SIDES))


def sensor_parts(problem: PredictionProblem) -> list[SensorPart]:
    """The parts of a background that change the recorded channels of this problem."""
    found: list[SensorPart] = []
    if problem.has_commands and has_regulators(problem):
        found.append(SensorPart("a hysteresis of the regulators", _played, is_one_way=True))
        for channel, side in _muscles(problem):
            zero, gain = (partial(one, channel=channel) for one in (_shifted, _scaled))
            found.append(SensorPart(f"the zero of the {side}'s regulator", zero))
            found.append(SensorPart(f"the gain of the {side}'s regulator", gain))
    elif problem.has_commands:
        found.append(SensorPart("a hysteresis of the spools", _played, is_one_way=True))
    for channel, side in _muscles(problem):
        if problem.present[BOTH_PRESSURES][channel]:
            of = f"of the {side}'s pressure sensor"
            found.append(
                SensorPart(f"a nonlinearity {of}", partial(_nonlinearity, channel=channel))
            )
            found.append(SensorPart(f"a drift {of}", partial(_drift, channel=channel)))
    return found


def ordinary_background(problem: PredictionProblem, vector: Array) -> Background:
    """Simulate an ordinary amount of every part of a background along the recordings.

    Parameters
    ----------
    problem : PredictionProblem
        Rig and recordings.
    vector : ndarray, shape (n_parameters,)
        The plant, re-tuned without effects.
    """
    rules = problem.rules.decision
    sizes = ordinary_sizes(problem.rig, problem.rig.joints[problem.joint], problem.sides)
    shapes = [
        (effect, path, size, shape, most)
        for effect, paths, size in sizes
        for (shape, most), path in product(_shapes(effect, rules), paths)
    ]
    lanes = np.repeat(vector[None], len(shapes), axis=0)
    for lane, (effect, path, size, shape, _) in zip(lanes, shapes, strict=True):
        lane[INDEX[path]] += size
        for name, factor in shape.items():
            lane[[INDEX[f"{side}.{effect}.{name}"] for side in SIDES]] *= factor
    base = problem.errors(vector[None])[0]
    changes = list(problem.errors(lanes) - base) if shapes else []
    parts = [_Part(effect, 0.0, most) for effect, _, _, _, most in shapes]
    for part in (*_single_spools(problem), *sensor_parts(problem)):
        changes.append(part.errors(problem, vector, 1.0) - base)
        parts.append(_Part("", 0.0 if part.is_one_way else -1.0, 1.0))
    encoder = encoder_changes(problem, base)
    changes += encoder
    parts += [_Part("", -1.0, 1.0)] * len(encoder)
    return Background(
        tuple(part.effect for part in parts),
        LinearTerms(np.stack(changes, axis=-1), tuple(p.free(rules.ordinary_share) for p in parts)),
    )


class _Part(NamedTuple):
    """One part of the background: an effect of the table or none, and the range of its amount."""

    effect: str
    low: float
    high: float

    def free(self, share: float) -> FreeParameter:
        """Its amount as a number of the fits, with an ordinary share of the largest as prior."""
        name = f"ordinary {self.effect or 'part'}"
        return FreeParameter(name, self.low, self.high, share, prior=share * self.high)


def _shapes(effect: str, rules: DecisionRules) -> list[tuple[dict[str, float], float]]:
    """Factors of the parameters that shape an effect, and the largest amount of each shape.

    A background is a mixture of these shapes. Threads begin to slide one after another: they share
    the ordinary size, so that the squares of their amounts add up to that of one. A bladder relaxes
    within seconds as well as within minutes: its pull falls with a small power of time, so that
    slower decades have less of the ordinary size, but none takes from another.
    """
    if effect == "hysteresis":
        reach = rules.ordinary_presliding
        return [({"presliding_length": factor}, 1.0 / math.sqrt(2.0)) for factor in (1.0, reach)]
    if effect == "creep":
        step = rules.ordinary_relaxation
        decade = step**-rules.ordinary_creep_order
        return [({"time_constant": step ** (k - 1)}, decade**k) for k in range(3)]
    return [({}, 1.0)]


def _supply(problem: PredictionProblem) -> float:
    """Gauge pressure of the supply [Pa]."""
    return problem.rig.supply_pressure - problem.rig.gas.ambient_pressure


def has_regulators(problem: PredictionProblem) -> bool:
    """Whether commands are pressures."""
    joint = problem.rig.joints[problem.joint]
    kinds = {problem.rig.muscle(name).valve.kind for name in joint.muscles}
    return kinds == {"pressure_regulator"}


def _single_spools(problem: PredictionProblem) -> list[SensorPart]:
    """A hysteresis of half the width in either valve; the play of two widths adds to others."""
    if not problem.has_commands or problem.is_bench:  # of one valve, it is that of all
        return []
    return [
        SensorPart(
            f"a hysteresis of the {side}'s valve", partial(_played_half, channel=channel), True
        )
        for channel, side in _muscles(problem)
    ]


def _played(problem: PredictionProblem, data: Channels, amount: float) -> Channels:
    """Commands as valves with an ordinary hysteresis follow them: play of half its width."""
    half = 0.5 * amount * play_width(problem)
    spool = [play(valve, half) for valve in data.commands.T.tolist()]
    return replace(data, commands=np.ascontiguousarray(np.transpose(spool)))


def _played_half(
    problem: PredictionProblem, data: Channels, amount: float, channel: int
) -> Channels:
    """Commands as one valve with half of the ordinary hysteresis follows them."""
    commands = data.commands.copy()
    half = 0.25 * amount * play_width(problem)
    commands[:, channel] = play(commands[:, channel].tolist(), half)
    return replace(data, commands=commands)


def play_width(problem: PredictionProblem) -> float:
    """Width of the ordinary hysteresis of a valve, in the unit of its command."""
    rules = problem.rules.decision
    if has_regulators(problem):
        return rules.ordinary_regulator * _supply(problem)
    return rules.ordinary_spool


def play(commands: list[float], half: float) -> list[float]:
    """Positions of a spool that stays where it is until a command is `half` away."""
    at, found = commands[0], []
    for command in commands:
        at = min(max(at, command - half), command + half)
        found.append(at)
    return found


def _shifted(problem: PredictionProblem, data: Channels, amount: float, channel: int) -> Channels:
    """Commands of a regulator with another zero."""
    commands = data.commands.copy()
    commands[:, channel] += amount * problem.rules.decision.ordinary_regulator * _supply(problem)
    return replace(data, commands=commands)


def _scaled(problem: PredictionProblem, data: Channels, amount: float, channel: int) -> Channels:
    """Commands of a regulator with another gain."""
    commands = data.commands.copy()
    commands[:, channel] *= 1.0 + amount * problem.rules.decision.ordinary_regulator
    return replace(data, commands=commands)


def _nonlinearity(
    problem: PredictionProblem, data: Channels, amount: float, channel: int
) -> Channels:
    """Readings of a pressure sensor that is right at both ends of its range, but not between."""
    needed = HEADROOM * _supply(problem)
    full = next((size for size in SENSOR_RANGES if size >= needed), needed)
    measured = data.measured.copy()
    share = np.clip(measured[:, channel] / full, 0.0, 1.0)
    size = amount * problem.rules.decision.ordinary_nonlinearity * full
    measured[:, channel] += 4.0 * size * share * (1.0 - share)
    return replace(data, measured=measured)


def _drift(problem: PredictionProblem, data: Channels, amount: float, channel: int) -> Channels:
    """Readings whose zero drifts by an ordinary zero error during the recording."""
    scales = rig_scales(problem.rig, problem.rig.joints[problem.joint])
    size = amount * EFFECTS["pressure_bias"].search.ranges(scales)["bias"].ordinary
    measured = data.measured.copy()
    measured[:, channel] += size * (_elapsed(data) - 0.5)
    return replace(data, measured=measured)


def _elapsed(data: Channels) -> Array:
    """Share of the whole recording at each sample, of which the data may be a part, shape (N,).

    A sensor drifts on through the gap between two parts.
    """
    return np.linspace(*data.recording.elapsed, len(data.measured))


def encoder_part(problem: PredictionProblem, data: Channels, amounts: Array) -> Channels:
    """Positions as they would be read without an eccentricity of the encoder (two phases)."""
    size = problem.rules.decision.ordinary_position
    measured = data.measured.copy()
    true = read = data.measured[:, POSITION]
    for _ in range(ECCENTRIC_ROUNDS):
        true = read + size * (amounts[0] * np.sin(true) + amounts[1] * np.cos(true))
    measured[:, POSITION] = true
    return replace(data, measured=measured)


def encoder_changes(problem: PredictionProblem, errors: Array) -> list[Array]:
    """Changes by an eccentric encoder (two phases) and by its drift."""
    if not problem.present[POSITION]:
        return []
    data = problem.data
    angle = np.concatenate([one.rows(one.measured[:, POSITION]) for one in data])
    elapsed = np.concatenate([one.rows(_elapsed(one)) for one in data])
    found = []
    for shape in (np.sin(angle), np.cos(angle), elapsed - 0.5):
        change = np.zeros_like(errors)
        size = problem.rules.decision.ordinary_position / _deviation(problem)[POSITION]
        change[:, POSITION] = size * shape
        found.append(change)
    return found


def _deviation(problem: PredictionProblem) -> Array:
    """Unit of the whitened errors of each channel; NaN for a channel that is not recorded."""
    result: Array = np.sqrt(np.mean([data.block_deviation**2 for data in problem.data], axis=0))
    return result


def discrepancy(
    problem: PredictionProblem,
    background: Background,
    jacobian: Slopes,
    scaling: Scaling,
    weights: Array,
) -> tuple[Array, Array]:
    """Mean squared whitened error of an ordinary background: the whole, and what remains of it.

    Both have shape (channels,). The whole is what re-tuning leaves of it. A share of that remains
    after its parts have been fitted, since the laws of the parts are approximate. The coloured
    noise of the sensors belongs to both. Amounts are taken as uniformly distributed
    up to the largest ordinary one. Those that cannot be negative have a mean: all friction opposes
    the motion at the same time, and two muscles are of one kind, so that their changes add before
    they are squared.

    Parameters
    ----------
    problem : PredictionProblem
        Rig and recordings.
    background : Background
        Its parts.
    jacobian : ndarray, shape (n_rows, channels, n)
        Slopes of the errors of the re-tuned plant over its `n` scaled numbers.
    scaling : Scaling
        Of these numbers, with their priors.
    weights : ndarray, shape (channels,)
        Of the squares of each channel.
    """
    columns, free = background.terms.columns, background.terms.free
    mean = np.array([0.5 * (p.low + p.high) for p in free])
    spread = np.array([(p.high - p.low) / np.sqrt(12.0) for p in free])

    def left(change: Array) -> Array:
        if jacobian.shape[-1]:
            hessian, slope = normal_equations(change, jacobian, problem.counted, weights)
            hessian += np.diag(scaling.weight**2 + 1e-9 * np.max(np.diag(hessian)) + 1e-12)
            change = change - jacobian @ np.linalg.solve(hessian, slope)
        return mean_squares(change, problem.counted)

    total = left(columns @ mean)
    for part in range(spread.size):
        total = total + left(columns[..., part] * spread[part])
    rules, rig = problem.rules.decision, problem.rig
    noise = np.zeros_like(total)
    gauge = rig.supply_pressure - rig.gas.ambient_pressure
    noise[BOTH_PRESSURES] = rules.ordinary_pressure * gauge
    noise[BOTH_FORCES] = rules.ordinary_force * rig_scales(rig, rig.joints[problem.joint]).force
    unmodelled = np.nan_to_num((noise / _deviation(problem)) ** 2)
    whole = np.where(problem.present, total + unmodelled, 0.0)
    return whole, np.where(problem.present, rules.unlike_share * total + unmodelled, 0.0)
