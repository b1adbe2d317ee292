"""What a diagnosis tries: every effect of the table with its free numbers and sensible starts.

An effect that belongs to the muscles has a magnitude for each of them and shapes they share;
effects that the table gives to one sensor or one valve are tried on either muscle. Many effects
are not smooth at their neutral value (dead zone, dry friction, thread friction), so that every
search starts at a size an ordinary rig shows, scaled to this rig.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pam_gap.prediction.fit import Array, FreeParameter
from pam_model.effects import EFFECTS, Effect
from pam_model.plant.force_table import closed_form
from pam_model.rig import Joint, Muscle, Rig

ONE_SIDED = ("valve_null_offset", "pressure_gain", "pressure_bias")
"""Effects of one valve or one sensor: tried on each muscle by itself."""

SIDES = ("agonist", "antagonist")

RISING_SPEEDS = (0.05, 0.3)
"""Speeds [rad/s] over which a Stribeck curve may fall."""


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


@dataclass(frozen=True, slots=True)
class _Sizes:
    """Bounds, a sizeable change and starts of one parameter."""

    low: float
    high: float
    size: float
    starts: tuple[float, ...]
    logarithmic: bool = False


def _scales(rig: Rig, joint: Joint) -> Mapping[str, float]:
    """Quantities that set how large an effect is on this rig."""
    muscle = rig.muscle(joint.agonist)
    area = (3.0 * muscle.neutral_length**2 - muscle.thread_length**2) / (
        4.0 * math.pi * muscle.turns**2
    )
    span = muscle.thread_length**2 - muscle.neutral_length**2
    volume = muscle.neutral_length * span / (4.0 * math.pi * muscle.turns**2)
    pressure = 0.4 * (rig.supply_pressure - rig.gas.ambient_pressure)
    return {
        "flow": muscle.valve.sonic_conductance,
        "volume": volume + muscle.dead_volume,
        "force": max(abs(area), 1e-6) * pressure,
        "torque": joint.pulley_radius * max(abs(area), 1e-6) * pressure,
        "stroke": max(abs(muscle.rest_length - muscle.neutral_length), 0.02 * muscle.rest_length),
        "pressure": pressure,
        "reach": pressure * muscle.neutral_length,
    }


def _sizes(rig: Rig, joint: Joint) -> dict[str, dict[str, _Sizes]]:
    s = _scales(rig, joint)
    flow, volume, force, torque = s["flow"], s["volume"], s["force"], s["torque"]
    stroke, reach = s["stroke"], s["reach"]
    # Ends pull less than a cylinder, never more: k >= 1 (Tondu and Lopez 2000), as written times
    # what is found.
    forms = [closed_form(rig.muscle(name)) for name in joint.muscles]
    written_ends = max(form[1] if form is not None else 1.0 for form in forms)
    return {
        "valve_dead_zone": {"overlap": _Sizes(0.0, 0.4, 0.05, (0.05, 0.02, 0.12))},
        "valve_null_offset": {"offset": _Sizes(-0.25, 0.25, 0.03, (0.02, -0.02))},
        "valve_lag": {"extra_time_constant": _Sizes(0.0, 0.15, 0.01, (0.01, 0.03))},
        "exhaust_restriction": {"ratio": _Sizes(0.1, 1.9, 0.2, (0.75,))},
        "supply_droop": {
            "conductance": _Sizes(1e-3 * flow, 20.0 * flow, 1.0, (0.1 * flow, 0.5 * flow), True),
            "volume": _Sizes(0.05 * volume, 300.0 * volume, 1.0, (3.0 * volume, 20 * volume), True),
        },
        "tube_restriction": {
            "conductance": _Sizes(0.03 * flow, 3.0 * flow, 0.7, (0.5 * flow, 1.5 * flow), True),
            "volume": _Sizes(0.02 * volume, volume, 0.7, (0.05 * volume, 0.15 * volume), True),
        },
        "command_delay": {"delay": _Sizes(0.0, 0.15, 0.01, (0.01, 0.03))},
        "leakage": {"conductance": _Sizes(0.0, 0.5 * flow, 0.01 * flow, (0.01 * flow,))},
        "dead_volume": {
            "extra_volume": _Sizes(-0.2 * volume, 5 * volume, 0.2 * volume, (0.2 * volume,))
        },
        "thermal": {"conductance": _Sizes(1e-4, 100.0, 1.0, (0.1, 1.0), True)},
        "hysteresis": {
            "amplitude": _Sizes(0.0, 0.45, 0.03, (0.03,)),
            "presliding_length": _Sizes(2e-5, 1.5e-2, 0.7, (5e-4, 3e-3), True),
        },
        "creep": {
            "ratio": _Sizes(0.0, 0.45, 0.05, (0.08,)),
            "time_constant": _Sizes(0.15, 300.0, 0.7, (1.5, 10.0), True),
        },
        "bladder_elasticity": {
            "linear": _Sizes(
                0.0, 40.0 * force / stroke, force / stroke * 0.2, (0.2 * force / stroke,)
            ),
            "cubic": _Sizes(
                -20.0 * force / stroke**3,
                100.0 * force / stroke**3,
                0.3 * force / stroke**3,
                (0.0,),
            ),
        },
        "end_caps": {"factor": _Sizes(1.0 / written_ends, 1.5, 0.1, (1.07,))},
        "braid_extensibility": {
            "compliance": _Sizes(0.0, 0.2 / reach, 0.01 / reach, (0.01 / reach,))
        },
        "cable_compliance": {
            "compliance": _Sizes(0.0, stroke / force, 0.1 * stroke / force, (0.1 * stroke / force,))
        },
        "coulomb_friction": {
            "torque": _Sizes(0.0, 5.0 * torque, 0.05 * torque, (0.03 * torque, 0.15 * torque)),
            "presliding_angle": _Sizes(1e-4, 3e-2, 0.7, (1e-3,), True),
        },
        "stribeck_friction": {
            "static_torque": _Sizes(0.0, 5.0 * torque, 0.05 * torque, (0.06 * torque,)),
            "torque": _Sizes(0.0, 5.0 * torque, 0.05 * torque, (0.04 * torque,)),
            "speed": _Sizes(5e-3, 3.0, 0.7, RISING_SPEEDS, True),
            "presliding_angle": _Sizes(1e-4, 3e-2, 0.7, (1e-3,), True),
        },
        "viscous_friction": {
            "extra": _Sizes(
                -joint.viscous_friction,
                10.0,
                0.5 * joint.viscous_friction + 0.05,
                (joint.viscous_friction * 0.5 + 0.05,),
            )
        },
        "payload": {
            "mass": _Sizes(1e-3, 30.0, 0.5, (0.3,), True),
            "distance": _Sizes(0.02, 1.5, 0.5, (0.3,), True),
        },
        "pulley_radius": {"scale": _Sizes(0.5, 2.0, 0.05, (1.05, 0.95))},
        "position_offset": {"offset": _Sizes(-0.9, 0.9, 0.03, (0.03, -0.03))},
        "position_delay": {"delay": _Sizes(0.0, 0.15, 0.01, (0.01, 0.03))},
        "pressure_gain": {"gain": _Sizes(0.6, 1.6, 0.05, (1.04, 0.96))},
        "pressure_bias": {"bias": _Sizes(-9e4, 9e4, 5e3, (5e3, -5e3))},
        "pressure_lag": {"time_constant": _Sizes(0.0, 0.3, 0.01, (0.01, 0.03))},
    }


def _candidate(effect: Effect, sizes: Mapping[str, _Sizes], side: str) -> Candidate:
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
    """Where to begin a richer law of the same effect, given where the simple one ended.

    Stribeck friction from Coulomb friction: the same torque and presliding, a little more at rest,
    over either a low or a high speed.

    Parameters
    ----------
    rich, simple : Candidate
        Of one pair of `selection.NESTED`.
    values : ndarray
        Of the simple one, in the order of its `free`.
    """
    known = {p.name: float(v) for p, v in zip(simple.free, values, strict=True)}
    return tuple(
        np.array(
            [
                {"static_torque": 1.4 * known["torque"], "torque": 0.9 * known["torque"],
                 "speed": speed}.get(p.name, known.get(p.name, start))
                for p, start in zip(rich.free, starts, strict=True)
            ]
        )
        for speed, starts in zip(RISING_SPEEDS, rich.starts, strict=True)
    )  # fmt: skip


def candidates_for(rig: Rig, joint: Joint) -> tuple[Candidate, ...]:
    """Every effect of the table as a candidate for one joint of a rig.

    Effects that the rig file already states are candidates too: what is fitted replaces them.
    """
    sizes = _sizes(rig, joint)
    found: list[Candidate] = []
    for effect in EFFECTS.values():
        if effect.name not in sizes:
            continue
        for side in SIDES if effect.name in ONE_SIDED else ("",):
            found.append(_candidate(effect, sizes[effect.name], side))
    return tuple(found)


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
    stage = EFFECTS[effect].stage
    if shut and stage == "valve":
        return effect in ("leakage", "dead_volume", "thermal")
    if stage == "valve" or effect == "pressure_lag":
        return commands
    if stage == "muscle":
        return position or pulls
    return position or effect in ("pressure_gain", "pressure_bias")


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


def nuisances_for(rig: Rig, joint: Joint) -> tuple[Nuisance, ...]:
    """The nominal parameters that may be off within the rig's tolerance; none for 0."""
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
                1.0 - 1.05 * tolerance,
                1.0 + 1.05 * tolerance,
                0.3 * tolerance,
                prior=tolerance / math.sqrt(3.0),
                centre=1.0,
            ),
            (name,),
            is_factor=True,
        )
        for name in names
    )


def transport_time(sample_time: float, written: float) -> Nuisance:
    """What stamps of messages leave open: on its way a command is for part of a sample.

    Commands are stamped when they are sent, measurements when they arrive.

    Parameters
    ----------
    sample_time : float
        Of the recording [s].
    written : float
        Delay of commands that the rig file has already [s].
    """
    free = FreeParameter(
        "transport time",
        written,
        written + sample_time,
        0.3 * sample_time,
        prior=sample_time / math.sqrt(3.0),
        centre=written,
    )
    return Nuisance(free, tuple(f"{side}.command_delay.delay" for side in SIDES), is_factor=False)
