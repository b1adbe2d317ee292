"""What a diagnosis tries: every effect of the registry with its free numbers and sensible starts.

An effect that belongs to the muscles has a magnitude for each of them and shapes they share;
effects of one sensor or one valve are tried on either muscle. Each effect's file tells where its
search begins and how far it goes, by the scales of this rig. Many effects are not smooth at their
neutral value (dead zone, dry friction, thread friction), so that every search starts at a size an
ordinary rig shows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pam_gap.prediction.fit import Array, FreeParameter
from pam_gap.rules import DEFAULT
from pam_gap.rules.search_rules import SearchRules
from pam_model.effects import EFFECTS, Effect, Range, RigScales
from pam_model.plant.force_table import closed_form
from pam_model.rig import Joint, Muscle, Rig

SIDES = ("agonist", "antagonist")


@dataclass(frozen=True, slots=True)
class Candidate:
    """One explanation on trial: an effect, on the muscles it touches.

    Attributes
    ----------
    effect : str
        As in `pam_model.effects.EFFECTS`.
    side : str
        "agonist" or "antagonist" for a one-sided effect, else empty.
    free : tuple of FreeParameter
        What the fit moves.
    targets : tuple of tuple of str
        For each of them, the plant parameters it is written to.
    starts : tuple of ndarray
        Where searches begin.
    """

    effect: str
    side: str
    free: tuple[FreeParameter, ...]
    targets: tuple[tuple[str, ...], ...]
    starts: tuple[Array, ...]

    @property
    def label(self) -> str:
        """Effect, with the side where there is one."""
        return f"{self.effect} ({self.side})" if self.side else self.effect


def rig_scales(rig: Rig, joint: Joint) -> RigScales:
    """Quantities that set how large an effect is on this rig."""
    muscle = rig.muscle(joint.agonist)
    area = (3.0 * muscle.neutral_length**2 - muscle.thread_length**2) / (
        4.0 * math.pi * muscle.turns**2
    )
    span = muscle.thread_length**2 - muscle.neutral_length**2
    volume = muscle.neutral_length * span / (4.0 * math.pi * muscle.turns**2)
    pressure = 0.4 * (rig.supply_pressure - rig.gas.ambient_pressure)
    forms = [closed_form(rig.muscle(name)) for name in joint.muscles]
    return RigScales(
        flow=muscle.valve.sonic_conductance,
        volume=volume + muscle.dead_volume,
        force=max(abs(area), 1e-6) * pressure,
        torque=joint.pulley_radius * max(abs(area), 1e-6) * pressure,
        stroke=max(abs(muscle.rest_length - muscle.neutral_length), 0.02 * muscle.rest_length),
        pressure=pressure,
        reach=pressure * muscle.neutral_length,
        viscous_friction=joint.viscous_friction,
        contraction_factor=max(form[1] if form is not None else 1.0 for form in forms),
    )


def _candidate(effect: Effect, sizes: Mapping[str, Range], side: str) -> Candidate:
    free: list[FreeParameter] = []
    targets: list[tuple[str, ...]] = []
    columns: list[tuple[float, ...]] = []
    if effect.scope == "muscle":
        owners: Sequence[str] = (side,) if side else SIDES
    else:
        owners = ("",)
    for key, parameter in effect.parameters.items():
        size = sizes[key]
        low, high = max(size.low, parameter.low), min(size.high, parameter.high)
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
    count = max(len(column) for column in columns)
    starts = tuple(
        np.array([column[min(i, len(column) - 1)] for column in columns], dtype=np.float64)
        for i in range(count)
    )
    return Candidate(effect.name, side, tuple(free), tuple(targets), starts)


def richer_starts(rich: Candidate, simple: Candidate, values: Array) -> tuple[Array, ...]:
    """Where to begin a richer law, given where the simple one that it contains ended.

    Parameters
    ----------
    rich, simple : Candidate
        Of one pair of `selection.NESTED`.
    values : ndarray
        Of the simple one, in the order of its `free`.
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


def candidates_for(rig: Rig, joint: Joint) -> tuple[Candidate, ...]:
    """Every effect of the table as a candidate for one joint of a rig.

    Effects that the rig file already states are candidates too: what is fitted replaces them.
    """
    scales = rig_scales(rig, joint)
    return tuple(
        _candidate(effect, effect.search.ranges(scales), side)
        for effect in EFFECTS.values()
        for side in (SIDES if effect.search.is_one_sided else ("",))
    )


def applicable(
    effect: str, *, commands: bool, position: bool, pulls: bool, shut: bool = False
) -> bool:
    """Whether the recorded channels can show an effect at all.

    Parameters
    ----------
    effect : str
        As in `EFFECTS`.
    commands, position, pulls : bool
        Whether valve commands, joint position and load cells were recorded.
    shut : bool
        Whether the valves were shut all the time.
    """
    search = EFFECTS[effect].search
    if shut and EFFECTS[effect].stage == "valve":
        return search.shows_when_shut
    recorded = {"commands": commands, "position": position, "pulls": pulls}
    return not search.shown_by or any(recorded[channel] for channel in search.shown_by)


@dataclass(frozen=True, slots=True)
class Nuisance:
    """A number that may be off without being an effect, and where it goes.

    Attributes
    ----------
    free : FreeParameter
        Starts at its centre.
    targets : tuple of str
        The plant parameters it sets, or scales.
    is_factor : bool
        Whether it multiplies the written values.
    """

    free: FreeParameter
    targets: tuple[str, ...]
    is_factor: bool


def nuisances_for(
    rig: Rig, joint: Joint, rules: SearchRules = DEFAULT.search
) -> tuple[Nuisance, ...]:
    """The nuisance parameters: nominal values that may be off within the tolerance; none for 0."""
    tolerance = rig.parameter_tolerance
    if tolerance <= 0.0:
        return ()
    names: list[str] = ["supply_pressure"]
    for key in ("pulley_radius", "inertia", "viscous_friction", "gravity_torque", "gravity_angle"):
        if getattr(joint, key) != 0.0:
            names.append(f"joint.{key}")
    muscles: tuple[Muscle, ...] = tuple(rig.muscle(name) for name in joint.muscles)
    for side, muscle in zip(SIDES, muscles, strict=True):
        for key in ("thread_length", "turns", "neutral_length", "dead_volume", "wall_thickness"):
            if getattr(muscle, key) != 0.0:
                names.append(f"{side}.{key}")
        for key in ("sonic_conductance", "critical_ratio", "time_constant"):
            names.append(f"{side}.valve.{key}")
    return tuple(
        Nuisance(
            FreeParameter(
                name,
                1.0 - rules.tolerance_reach * tolerance,
                1.0 + rules.tolerance_reach * tolerance,
                rules.tolerance_size * tolerance,
                prior=tolerance / math.sqrt(3.0),  # the standard deviation of a uniform range
                centre=1.0,
            ),
            (name,),
            is_factor=True,
        )
        for name in names
    )


def transport_time(
    sample_time: float, written: float, rules: SearchRules = DEFAULT.search
) -> Nuisance:
    """The transport time of a command, which the stamps of messages do not show.

    Commands are stamped when they are sent and measurements when they arrive, so that a command may
    act up to one sample later than its stamp says. That is a property of the log and no effect.

    Parameters
    ----------
    sample_time : float
        Of the recording [s].
    written : float
        Delay of commands that the rig file has already [s].
    rules : SearchRules
        Constants.
    """
    free = FreeParameter(
        "transport time",
        written,
        written + sample_time,
        rules.tolerance_size * sample_time,
        prior=sample_time / math.sqrt(3.0),
        centre=written,
    )
    return Nuisance(free, tuple(f"{side}.command_delay.delay" for side in SIDES), is_factor=False)
