"""A rig file that is not complete yet: numbers may be missing, or given as a range.

An owner has a data sheet and a tape measure, and `calibrate` finds the rest from recordings. A
range is written `inertia: {between: [0.02, 0.1]}`. Every other tool needs numbers and refuses such
a file (`pam_model.rig.keys.Section`). Lengths, which no log determines alone, must be stated.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pam_model.errors import RigError
from pam_model.rig.arms import arms_of
from pam_model.rig.effects_as_numbers import effects_as_numbers, number_with_effects
from pam_model.rig.file import read_parameters
from pam_model.rig.keys import BETWEEN, Key, Problems, Section
from pam_model.rig.parser import parse_rig, unflatten
from pam_model.rig.types import NUMBERS, Rig

INERTIA_PER_TORQUE = 0.004
"""Guess of a missing inertia [kg m^2] for each N m of the agonist's torque, as in `size`."""
FRICTION_PER_TORQUE = 0.01
"""Guess of a missing viscous friction [N m s/rad] for each N m."""


@dataclass(frozen=True, slots=True)
class PartialRig:
    """What a rig file says before a calibration."""

    # A complete rig: as written, with the middle of each range and a guess where a number is
    # missing. Whether all muscles reach the position limits is not checked, because lengths may
    # still be wrong.
    rig: Rig
    # lowest and highest value of the numbers that are given as a range, by key
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    missing: frozenset[str] = frozenset()  # keys of the numbers that are not written
    # whether a tool that needs numbers refuses the file: there is a range, or a number without a
    # default is missing
    is_rough: bool = False


def load_partial_rig(path: str | Path) -> PartialRig:
    """Read a rig file in which numbers may be missing or given as a range.

    Parameters
    ----------
    path : str or Path
        A rig file; a complete one is read as well.

    Raises
    ------
    RigError
        With one line for every problem: file, key, value, unit, what was expected.
    """
    path = Path(path)
    try:
        tree = unflatten(read_parameters(path))
    except RigError as error:
        text = str(error)
        raise RigError(text if str(path) in text else f"{path}: {text}") from None
    problems = Problems(str(path))
    ranges: dict[str, tuple[float, float]] = {}
    missing: set[str] = set()
    is_rough = False
    filled = deepcopy(tree)
    for where, section in _sections(filled):
        keys = NUMBERS[section]
        guesses = {name: key.guess for name, key in keys.items() if key.guess is not None}
        branch = _branch(filled, where)
        if branch is None:
            continue
        reader = Section(branch, where, problems)
        for name in (name for name, key in keys.items() if key.may_be_range):
            if name not in branch:
                if name in guesses:
                    missing.add(reader.key(name))
                    is_rough |= keys[name].default is None
                    branch[name] = guesses[name]
            elif isinstance(branch[name], Mapping):
                found = _range(reader, name, keys[name])
                if found is not None:
                    ranges[reader.key(name)], is_rough = found, True
                    branch[name] = middle(*found)
    if problems.lines:
        raise RigError("\n".join(problems.lines))
    rig = parse_rig(filled, str(path), folders=(path.parent,), must_reach=False)
    written = _with_guesses(rig, missing)
    for key, (low, high) in ranges.items():
        ranges[key] = (
            number_with_effects(written, key, low),
            number_with_effects(written, key, high),
        )
    try:
        rig = effects_as_numbers(written)
    except RigError as error:
        raise RigError(f"{path}: {error}") from None
    return PartialRig(rig, ranges, frozenset(missing), is_rough)


def middle(low: float, high: float) -> float:
    """Geometric mean of a range above 0, else the mean."""
    return math.sqrt(low * high) if low > 0.0 else 0.5 * (low + high)


def _sections(tree: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Dotted place and kind of every section that may be incomplete."""
    yield "", ""
    joints = [name for name in _names(tree.get("joints")) if isinstance(tree.get(name), dict)]
    muscles = list(_names(tree.get("bench_muscles")))
    for joint in joints:
        yield joint, "joint"
        muscles += _names(tree[joint].get("muscles"))
    for muscle in muscles:
        if isinstance(tree.get(muscle), dict):
            yield muscle, "muscle"
            yield f"{muscle}.valve", "valve"


def _names(given: object) -> list[str]:
    if isinstance(given, str) or not isinstance(given, Sequence):
        return []
    return [name for name in given if isinstance(name, str)]


def _branch(tree: dict[str, Any], where: str) -> dict[str, Any] | None:
    branch: Any = tree
    for step in where.split(".") if where else ():
        branch = branch.get(step)
        if not isinstance(branch, dict):
            return None
    return branch if isinstance(branch, dict) else None


def _range(section: Section, name: str, key: Key) -> tuple[float, float] | None:
    """The range under a key; else None, and a problem is added."""
    given = section.tree[name]
    ends = given.get(BETWEEN)
    is_pair = isinstance(ends, Sequence) and not isinstance(ends, str) and len(ends) == 2
    if set(given) != {BETWEEN} or not is_pair:
        unit = "" if key.unit == "-" else f" in {key.unit}"
        text = f": must be a number{unit}, or a range as {{{BETWEEN}: [1.0, 2.0]}}"
        section.add(name, text)
        return None
    low, high = (section.check(name, end, key) for end in ends)
    if low is None or high is None:
        return None
    if not low < high:
        section.add(name, f" = between {low:g} and {high:g} {key.unit}: lower must be below upper")
        return None
    return low, high


def _with_guesses(rig: Rig, missing: set[str]) -> Rig:
    """The rig with guesses of inertia and friction that suit the torque of its muscles."""
    guesses = {"inertia": INERTIA_PER_TORQUE, "viscous_friction": FRICTION_PER_TORQUE}
    for arm in arms_of(rig):
        joint, muscle = rig.joints[arm.joint], rig.muscles[arm.muscle]
        if arm.length < 0.0:
            continue
        model = rig.force_model(muscle.name)
        torque = arm.length * model.force(muscle.max_pressure, muscle.neutral_length)
        changes: dict[str, Any] = {
            name: per_torque * float(torque)
            for name, per_torque in guesses.items()
            if f"{joint.name}.{name}" in missing and torque > 0.0
        }
        rig = rig.with_joint(replace(joint, **changes))
    return rig
