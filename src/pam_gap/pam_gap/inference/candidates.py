"""The candidates: every effect of the registry with its free parameters, bounds and starts.

An effect of the muscles has a magnitude for each muscle and shape parameters that both share. An
effect of one sensor or one valve is tried on each muscle separately. The file of each effect
defines the starts and bounds of its search in terms of the scales of the rig. Many effects are not
smooth at their neutral value (dead zone, dry friction, thread friction), so that every search
starts at a size that is common on ordinary rigs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pam_gap.prediction.channel_order import BOTH_FORCES, POSITION
from pam_gap.prediction.fit import Array, FreeParameter
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import LOCKED, SHUT
from pam_gap.rules import DEFAULT
from pam_gap.rules.search_rules import SearchRules
from pam_model.effects import EFFECTS, Effect, Range, RigScales
from pam_model.plant.muscle_arms import SIDES
from pam_model.plant.written_numbers import written_numbers
from pam_model.rig import Joint, Rig
from pam_model.robot import compose
from pam_model.views.effect_scales import effect_scales

NESTED = {
    (effect.search.richer.than, effect.name)
    for effect in EFFECTS.values()
    if effect.search.richer is not None
}
"""Pairs (simple, rich): for some parameter values, the rich law equals the simple one."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """One possible explanation: an effect and the muscles on which it acts."""

    effect: str  # name in `pam_model.effects.EFFECTS`
    side: str  # "agonist" or "antagonist" for a one-sided effect, else empty
    free: tuple[FreeParameter, ...]  # parameters that the fit changes
    targets: tuple[tuple[str, ...], ...]  # for each of them, the plant parameters that it sets
    starts: tuple[Array, ...]  # starting values of the search
    # for each parameter, its neutral value and the largest distance from it on an ordinary good
    # rig; the distance is 0 where a good rig has none of the effect, and for shapes
    ordinary: tuple[tuple[float, float], ...] = ()

    def is_ordinary(self, values: Array) -> bool:
        """Whether the effect is no larger with these values than on an ordinary good rig.

        The size of an effect of both muscles is the mean over them.
        """
        sizes = [
            (abs(float(value) - neutral) / reach)
            for value, (neutral, reach) in zip(values, self.ordinary, strict=True)
            if reach > 0.0
        ]
        return bool(sizes) and sum(sizes) <= len(sizes)

    @property
    def label(self) -> str:
        """Name of the effect, with the side of a one-sided effect."""
        return f"{self.effect} ({self.side})" if self.side else self.effect

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Name of each parameter in an answer, with the side of a one-sided effect."""
        return tuple(f"{p.name}.{self.side}" if self.side else p.name for p in self.free)


def rig_scales(rig: Rig, joint: Joint) -> RigScales:
    """Quantities by which the size of an effect is measured on this rig."""
    robot = compose(rig)
    return effect_scales(robot, robot.joint(joint.name))


def _candidate(
    effect: Effect, sizes: Mapping[str, Range], side: str, sides: Sequence[str]
) -> Candidate:
    free: list[FreeParameter] = []
    targets: list[tuple[str, ...]] = []
    columns: list[tuple[float, ...]] = []
    ordinary: list[tuple[float, float]] = []
    if effect.scope == "muscle":
        owners: Sequence[str] = (side,) if side else sides
    else:
        owners = ("",)
    for key, parameter in effect.parameters.items():
        size = sizes[key]
        low, high = max(size.low, parameter.low), min(size.high, parameter.high)
        if low == high:  # known on this rig
            continue
        plain = FreeParameter(key, low, high, size.size, is_logarithmic=size.logarithmic)
        paths = [f"{owner}.{effect.name}.{key}".lstrip(".") for owner in owners]
        if parameter.is_shape or size.logarithmic or len(paths) == 1:
            free.append(plain)
            targets.append(tuple(paths))
            columns.append(size.starts)
        else:
            for owner, path in zip(owners, paths, strict=True):
                free.append(replace(plain, name=f"{key}.{owner}"))
                targets.append((path,))
                columns.append(size.starts)
        ordinary += [(parameter.neutral, size.ordinary)] * (len(free) - len(ordinary))
    count = max(len(column) for column in columns)
    starts = tuple(
        np.array([column[min(i, len(column) - 1)] for column in columns], dtype=np.float64)
        for i in range(count)
    )
    return Candidate(effect.name, side, tuple(free), tuple(targets), starts, tuple(ordinary))


def richer_starts(rich: Candidate, simple: Candidate, values: Array) -> tuple[Array, ...]:
    """Starting values of a richer law, given the fitted values of the simpler law it contains.

    Parameters
    ----------
    rich, simple : Candidate
        One pair of `NESTED`.
    values : ndarray
        Fitted values of the simpler law, in the order of its `free`.
    """
    richer = EFFECTS[rich.effect].search.richer
    assert richer is not None
    known = {p.name: float(v) for p, v in zip(simple.free, values, strict=True)}
    found = richer.starts(known)
    own = [rich.starts[min(i, len(rich.starts) - 1)] for i in range(len(found))]
    return tuple(
        np.array(
            [
                changes.get(p.name, known.get(p.name, start))
                for p, start in zip(rich.free, starts, strict=True)
            ]
        )
        for changes, starts in zip(found, own, strict=True)
    )


def candidates_for(rig: Rig, joint: Joint, sides: Sequence[str] = SIDES) -> tuple[Candidate, ...]:
    """Every effect of the table as a candidate for one joint of a rig.

    Effects in the rig file are candidates too; the fitted values replace those of the file. Of a
    file that was read, the effects that only change its numbers are in the numbers already, and
    such a candidate adds to them.

    Parameters
    ----------
    rig : Rig
        The rig as its file describes it.
    joint : Joint
        The joint.
    sides : sequence of str
        Those of its muscles that exist; with one, the joint is invented and is no candidate.
    """
    scales = rig_scales(rig, joint)
    one_sided = sides if len(sides) > 1 else ("",)
    return tuple(
        _candidate(effect, effect.search.ranges(scales), side, sides)
        for effect in EFFECTS.values()
        if len(sides) > 1 or effect.scope != "joint"
        for side in (one_sided if effect.search.is_one_sided else ("",))
    )


def shown_candidates(problem: PredictionProblem) -> tuple[Candidate, ...]:
    """The effects that the recorded channels and motions of a problem can show at all."""
    mountings = {data.recording.mounting for data in problem.data}
    recorded = {
        "commands": problem.has_commands,
        "position": problem.present[POSITION],
        "pulls": problem.present[BOTH_FORCES].any(),
    }

    def is_shown(effect: Effect) -> bool:
        if effect.stage == "joint" and mountings == {LOCKED}:
            return False
        if effect.stage == "valve" and mountings == {SHUT}:
            return effect.search.shows_when_shut
        shown_by = effect.search.shown_by
        return not shown_by or any(recorded[channel] for channel in shown_by)

    joint = problem.rig.joints[problem.joint]
    every = candidates_for(problem.rig, joint, problem.sides)
    return tuple(candidate for candidate in every if is_shown(EFFECTS[candidate.effect]))


@dataclass(frozen=True, slots=True)
class Nuisance:
    """A nuisance parameter: a number that may deviate without being an effect."""

    free: FreeParameter  # the parameter; its fit starts at its centre
    targets: tuple[str, ...]  # the plant parameters that it sets or scales
    is_factor: bool  # whether it multiplies the values of the rig file

    @property
    def is_transport(self) -> bool:
        """Whether it belongs to the log and not to the rig."""
        return not self.is_factor


def nuisances_for(
    rig: Rig,
    joint: Joint,
    rules: SearchRules = DEFAULT.search,
    sides: Sequence[str] = SIDES,
) -> tuple[Nuisance, ...]:
    """One nuisance parameter for each nominal value, within its tolerance; none for tolerance 0."""
    return tuple(
        Nuisance(
            FreeParameter(
                name,
                1.0 - rules.tolerance_reach * reach,
                1.0 + rules.tolerance_reach * reach,
                rules.tolerance_size * reach,
                prior=reach / math.sqrt(3.0),  # the standard deviation of a uniform range
                centre=1.0,
            ),
            (name,),
            is_factor=True,
        )
        for name, reach in written_numbers(rig, joint, sides)
        if reach > 0.0
    )


def ordinary_sizes(
    rig: Rig, joint: Joint, sides: Sequence[str] = SIDES
) -> tuple[tuple[str, tuple[str, ...], float], ...]:
    """What an ordinary good rig has of the effects: name, plant parameters and largest change.

    Both muscles of a joint are of one kind and have a part of it together. An effect that the rig
    file states is known, and is no background. Zeros and gains of sensors are left out: they are
    calibrated, and what is left of them would imitate almost any static error.
    """
    scales = rig_scales(rig, joint)
    found: list[tuple[str, tuple[str, ...], float]] = []
    for effect in EFFECTS.values():
        if effect.stage == "sensing" or (len(sides) < len(SIDES) and effect.scope == "joint"):
            continue
        owners = [
            owner
            for owner, stated in _owners(rig, joint, effect)
            if effect.name not in stated and (owner in sides or not owner)
        ]
        for key, size in effect.search.ranges(scales).items():
            if size.ordinary > 0.0 and owners:
                paths = tuple(f"{owner}.{effect.name}.{key}".lstrip(".") for owner in owners)
                grows = size.high > effect.parameters[key].neutral
                found.append((effect.name, paths, size.ordinary if grows else -size.ordinary))
    return tuple(found)


def _owners(
    rig: Rig, joint: Joint, effect: Effect
) -> tuple[tuple[str, Mapping[str, Mapping[str, float]]], ...]:
    """Owners of an effect's parameters in the plant, with the effects that the rig file states."""
    if effect.scope == "muscle":
        muscles = (rig.muscle(name) for name in joint.muscles)
        return tuple((s, m.effects) for s, m in zip(SIDES, muscles, strict=True))
    return (("", joint.effects if effect.scope == "joint" else rig.effects),)


def transport_time(
    sample_time: float,
    written: float,
    rules: SearchRules = DEFAULT.search,
    sides: Sequence[str] = SIDES,
) -> Nuisance:
    """The transport time of a command as a nuisance parameter; the message stamps do not show it.

    Commands are stamped when they are sent and measurements when they arrive, so that a command may
    act up to one sample later than its stamp says. This is a property of the log and not an effect.

    Parameters
    ----------
    sample_time : float
        Sample time of the recording [s].
    written : float
        Delay of commands in the rig file [s].
    rules : SearchRules
        Constants.
    sides : sequence of str
        Muscles that exist.
    """
    free = FreeParameter(
        "transport time",
        written,
        written + sample_time,
        rules.tolerance_size * sample_time,
        prior=sample_time / math.sqrt(3.0),
        centre=written,
    )
    return Nuisance(free, tuple(f"{side}.command_delay.delay" for side in sides), is_factor=False)
