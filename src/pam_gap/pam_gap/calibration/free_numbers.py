"""The numbers that a calibration may change, with what is known of each beforehand.

A number that is written is known within a tolerance, a range within its ends; of a missing one
nothing is known. Positive numbers are fitted by their logarithms.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from pam_gap.calibration.calibration_rules import CalibrationRules
from pam_gap.inference.candidates import Nuisance, ordinary_sizes, rig_scales
from pam_gap.prediction.fit import FreeParameter
from pam_model.effects import EFFECTS
from pam_model.plant.muscle_arms import SIDES
from pam_model.plant.parameters import RIG_PLACES, UNITS, bounds_of
from pam_model.rig import Joint, Rig
from pam_model.rig.partial import PartialRig

STATICS, GAS, BODY, SENSORS = "statics", "gas and valve", "body", "sensors"
ORDINARY_VALVE, ORDINARY_BODY = "small effects of the valve", "small effects of the body"
"""What every good rig has a little of; the rig file does not state it."""
JOINT = {"pulley_radius": STATICS, "inertia": BODY, "viscous_friction": BODY,
         "gravity_torque": BODY, "gravity_angle": BODY}  # fmt: skip
MUSCLE = {"thread_length": STATICS, "turns": STATICS, "neutral_length": STATICS,
          "dead_volume": GAS}  # fmt: skip
VALVE = {"sonic_conductance": GAS, "critical_ratio": GAS, "time_constant": GAS}
OF_REGULATOR = {"damping": GAS}
DAMPING = (0.3, 1.5)
"""Damping ratios of regulators, of which a data sheet says nothing; 0.65 was measured on one."""
OF_LENGTHS = ("pulley_radius", "thread_length", "turns", "neutral_length", "supply_pressure")
"""Numbers that a tape, a count or a gauge gives, which are known better than the others."""
ANGLES = ("gravity_angle",)
LINEAR = ("creep",)
"""Small effects that are no numbers but changes of the errors (`small_errors`)."""


@dataclass(frozen=True, slots=True)
class Said:
    """What is known of the numbers that are written plainly."""

    tolerance: float  # how far a number may be off, relative
    lengths: float  # the same for lengths, turns and the supply pressure


@dataclass(frozen=True, slots=True)
class FreeRigNumber:
    """One number that a calibration may change."""

    name: str  # name of the plant parameter
    key: str  # key in the rig file
    unit: str  # unit of its value
    stage: str  # the stage that finds it: statics, gas and valve, body, or sensors
    free: FreeParameter  # bounds, prior and scale of the fit
    written: float | None  # value in the rig file, the middle of a range; None if it is missing
    others: tuple[str, ...] = ()  # further plant parameters that it sets, those of the other muscle
    stated: tuple[float, float] | None = None  # the range in the rig file, if it is one

    @property
    def targets(self) -> tuple[str, ...]:
        """The plant parameters that it sets."""
        return (self.name, *self.others)

    def nuisance(self, rules: CalibrationRules) -> Nuisance:
        """The number as a fit of hypotheses takes it."""
        return Nuisance(rules.weighted(self.free), self.targets, is_factor=False)

    @property
    def is_ordinary(self) -> bool:
        """Whether it is the size of a small effect of a good rig."""
        return self.stage in (ORDINARY_VALVE, ORDINARY_BODY)

    @property
    def is_sensor(self) -> bool:
        """Whether it is a gain or zero of a sensor, which the rig file has no number for."""
        return self.stage == SENSORS


def key_in_file(name: str, joint: Joint) -> str:
    """Key of a plant parameter in the rig file, with dots."""
    place = RIG_PLACES[name]
    if place.section == "effect":
        scope = EFFECTS[place.effect].scope
        owner = {"joint": f"{joint.name}.", "rig": ""}.get(scope)
        if owner is None:
            owner = f"{joint.muscles[SIDES.index(place.side)]}."
        return f"{owner}effects.{place.effect}.{place.key}"
    if place.side:
        muscle = joint.muscles[SIDES.index(place.side)]
        return f"{muscle}.{'valve.' if place.section == 'valve' else ''}{place.key}"
    if place.section == "joint":
        return f"{joint.name}.{place.key}"
    return place.key if place.section == "rig" else f"{place.section}.{place.key}"


def names_of(rig: Rig, joint: Joint) -> dict[str, str]:
    """The plant parameters of one joint that a calibration may change, and the stage of each."""
    names = {f"joint.{key}": stage for key, stage in JOINT.items()}
    for side in SIDES:
        names |= {f"{side}.{key}": stage for key, stage in MUSCLE.items()}
        names |= {f"{side}.valve.{key}": stage for key, stage in VALVE.items()}
        if rig.muscle(joint.muscles[SIDES.index(side)]).valve.kind != "flow":
            names |= {f"{side}.valve.{key}": stage for key, stage in OF_REGULATOR.items()}
    return names | {"supply_pressure": GAS}


def free_numbers(
    partial: PartialRig,
    joint: Joint,
    start: Mapping[str, float],
    said: Said,
    rules: CalibrationRules,
    *,
    has_commands: bool,
) -> tuple[FreeRigNumber, ...]:
    """Every number of one joint that a calibration may change.

    Parameters
    ----------
    partial : PartialRig
        What the rig file says.
    joint : Joint
        The joint, of `partial.rig`.
    start : mapping of str to float
        By plant parameter: the value as written, or that of a first regression if it is missing.
    said : Said
        Tolerances of plain numbers.
    rules : CalibrationRules
        Tolerances of angles and sensors, and the reach of a fit.
    has_commands : bool
        Whether valve commands were recorded; without, nothing of the valves is free.
    """
    found = []
    for name, stage in names_of(partial.rig, joint).items():
        if stage == GAS and not has_commands:
            continue
        one = _number(name, stage, partial, joint, start, said, rules)
        if one is not None:
            found.append(one)
    if not any(one.key == f"{joint.name}.gravity_torque" for one in found):
        found = [one for one in found if one.key != f"{joint.name}.gravity_angle"]
    gauge = partial.rig.supply_gauge_pressure
    for side in SIDES:
        for effect, key, spread in (
            ("pressure_gain", "gain", rules.sensor_gain),
            ("pressure_bias", "bias", rules.sensor_zero * gauge),
        ):
            name = f"{side}.{effect}.{key}"
            centre = start[name]
            reach = rules.reach * math.sqrt(3.0) * spread
            free = FreeParameter(name, centre - reach, centre + reach, spread, spread, centre)
            found.append(
                FreeRigNumber(name, key_in_file(name, joint), UNITS[name], SENSORS, free, centre)
            )
    return (*found, *ordinary_numbers(partial.rig, joint, rules, has_commands=has_commands))


def ordinary_numbers(
    rig: Rig, joint: Joint, rules: CalibrationRules, *, has_commands: bool
) -> tuple[FreeRigNumber, ...]:
    """Sizes of the small effects that a good rig has, and the shapes of these effects.

    Parameters
    ----------
    rig : Rig
        The rig as written.
    rules : CalibrationRules
        How much of them is usual.
    has_commands : bool
        Whether valve commands were recorded.
    """
    found = []
    scales = rig_scales(rig, joint)
    for effect, paths, size in ordinary_sizes(rig, joint):
        if effect in LINEAR:
            continue
        stage = ORDINARY_VALVE if EFFECTS[effect].stage == "valve" else ORDINARY_BODY
        if stage == ORDINARY_VALVE and not has_commands:
            continue
        for path in paths:
            neutral = EFFECTS[effect].parameters[path.rpartition(".")[2]].neutral
            middle, spread = neutral + rules.usual * size, rules.usual_spread * abs(size)
            ends = sorted((neutral, neutral + rules.usual_most * size))
            free = FreeParameter(path, ends[0], ends[1], 0.5 * spread, spread, middle)
            free = _bounded(free, *bounds_of(path))
            found.append(
                FreeRigNumber(path, key_in_file(path, joint), UNITS[path], stage, free, middle)
            )
        for key, entry in EFFECTS[effect].parameters.items():
            reach = EFFECTS[effect].search.ranges(scales)[key]
            if not entry.is_shape or not reach.logarithmic:
                continue
            owners = [path.rpartition(".")[0] for path in paths]
            names = tuple(f"{owner}.{key}" for owner in owners)
            start = reach.starts[0]
            free = FreeParameter(
                names[0], reach.low, reach.high, 0.3, rules.usual_shape, start, True
            )
            found.append(
                FreeRigNumber(
                    names[0], key_in_file(names[0], joint), UNITS[names[0]], stage, free, start,
                    names[1:],
                )
            )  # fmt: skip
    return tuple(found)


def _number(
    name: str,
    stage: str,
    partial: PartialRig,
    joint: Joint,
    start: Mapping[str, float],
    said: Said,
    rules: CalibrationRules,
) -> FreeRigNumber | None:
    key, value = key_in_file(name, joint), start[name]
    low, high = bounds_of(name)
    last = RIG_PLACES[name].key
    written: float | None = value
    if key in partial.ranges:
        least, most = partial.ranges[key]
        free = _within(name, least, most)
    elif key in partial.missing:
        written = None
        free = _unknown(name, last, value, low, high, rules)
    elif last in OF_REGULATOR and _is_unstated(name, partial.rig, joint):
        written = None
        free = _within(name, *DAMPING)
    elif last in ANGLES:
        spread = rules.angle
        reach = rules.reach * spread
        free = FreeParameter(
            name, value - reach, value + reach, 0.3 * spread, spread / math.sqrt(3.0), value
        )
    elif value == 0.0:
        return None  # written as absent, such as gravity at a vertical axis
    else:
        tolerance = said.lengths if last in OF_LENGTHS else said.tolerance
        if not tolerance > 0.0:
            return None
        free = _about(name, value, tolerance, rules)
    return FreeRigNumber(
        name, key, UNITS[name], stage, _bounded(free, low, high), written,
        stated=partial.ranges.get(key),
    )  # fmt: skip


def _is_unstated(name: str, rig: Rig, joint: Joint) -> bool:
    """Whether the rig file leaves out the damping of this valve."""
    muscle = joint.muscles[SIDES.index(name.partition(".")[0])]
    return rig.muscle(muscle).valve.damping is None


def _about(name: str, value: float, tolerance: float, rules: CalibrationRules) -> FreeParameter:
    """A number that is off by up to a tolerance: what is written may be the true value times it."""
    reach = -math.log1p(-min(tolerance, 0.9))
    spread = reach / math.sqrt(3.0)
    if value < 0.0:
        size = abs(value) * reach
        return FreeParameter(
            name, value - rules.reach * size, value + rules.reach * size, 0.3 * size,
            size / math.sqrt(3.0), value,
        )  # fmt: skip
    factor = math.exp(rules.reach * reach)
    return FreeParameter(name, value / factor, value * factor, 0.3 * reach, spread, value, True)


def _within(name: str, low: float, high: float) -> FreeParameter:
    """A number in a range, uniform in its logarithm where it is positive."""
    if low > 0.0:
        width = math.log(high / low)
        middle = math.sqrt(low * high)
        return FreeParameter(name, low, high, 0.15 * width, width / math.sqrt(12.0), middle, True)
    width = high - low
    return FreeParameter(name, low, high, 0.15 * width, width / math.sqrt(12.0), 0.5 * (low + high))


def _unknown(
    name: str, key: str, value: float, low: float, high: float, rules: CalibrationRules
) -> FreeParameter:
    """A missing number: the first regression is only where the fit begins."""
    if key in ANGLES or (key == "gravity_torque" and not value > 0.0):
        size = max(abs(value), 0.1)
        return FreeParameter(name, low, high, 0.1 * size)
    if key == "critical_ratio":  # 0.2 to 0.5 for valves as they are (ISO 6358-1, annex)
        return FreeParameter(name, 0.05, 0.6, 0.05, 0.1, value)
    least = max(value, low) if value > 0.0 else max(low, 1e-12)
    return FreeParameter(
        name, least / rules.unknown_reach, least * rules.unknown_reach, 0.1, 0.0, least, True
    )


def _bounded(free: FreeParameter, low: float, high: float) -> FreeParameter:
    return replace(free, low=max(free.low, low), high=min(free.high, high))
