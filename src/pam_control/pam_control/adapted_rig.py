"""A rig file with the numbers that the controller has learnt of its rig, written on request.

What was learnt serves the controller as it is, whatever its cause. A rig file states causes, so
only those numbers are written that the measurements distinguish:

- of a joint, what the torques of its motion show about its load (inertia and gravity), viscous and
  dry friction, and about the dimensions of its muscles within the tolerance of the rig file, if
  these explain the torques (`rig_numbers`);
- of a flow valve, its null offset.

The rest is named and left to the diagnosis of a recording: whether a valve, its silencer, a tube or
the gas volume is the cause of a wrong flow cannot be seen from the flows alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from pam_control.adaptation.flow_adaptation import FlowAdaptation
from pam_control.adaptation.rig_numbers import DRY_FRICTION, LearntNumber, RigNumbers
from pam_control.cycle.joint_channel import JointChannel
from pam_model.effects import effect_value
from pam_model.errors import PamError
from pam_model.rig import Muscle, Rig, save_rig

LEAST_SECONDS: Final = 3.0  # s of motion
LEAST_OPENING: Final = 0.005  # of the full stroke
LARGE_SHARE: Final = 0.1  # of a flow; less is within what a valve's data promise
LONG_DELAY: Final = 5e-3  # s
NULL_OFFSET: Final = "valve_null_offset.offset"
ONLY_POSITIVE: Final = frozenset({"viscous_friction", "gravity_torque", DRY_FRICTION})


@dataclass(frozen=True, slots=True)
class AdaptedRig:
    """A rig with learnt numbers, and what a person should read about them."""

    rig: Rig  # as its file should be
    changes: tuple[str, ...]  # every changed number with its interval, one line each
    left: tuple[str, ...]  # what was learnt and is not written, and why

    @property
    def notes(self) -> list[str]:
        """Lines for the beginning of the file."""
        told = "intervals contain the true value in 90 % of cases"
        return [f"Learnt by the controller while it moved; {told}:", *self.changes, *self.left]


@dataclass(frozen=True, slots=True)
class LearntOfJoint:
    """What the controller knows of one joint at one moment."""

    joint: str  # its name
    numbers: RigNumbers  # of the joint and the dimensions of its muscles
    # by muscle with a flow valve, the change of its null offset [-] and half of its interval
    openings: Mapping[str, tuple[float, float]]
    left: tuple[str, ...]  # what is not written, and why


def learnt_of(channel: JointChannel) -> LearntOfJoint:
    """What was learnt of a joint until now; takes less than a millisecond.

    Raises
    ------
    PamError
        If its control law learns nothing.
    """
    law = channel.setup.law
    numbers = law.numbers(channel.law_state)
    if numbers is None:
        raise PamError(f"nothing is learnt by the law {law.name}")
    openings, left = {}, _of_sensors(channel)
    for muscle, loop in zip(channel.models.muscles, channel.loops, strict=True):
        if loop.adaptation is not None:
            openings[muscle.name] = loop.adaptation.opened
            left += _of_flow(muscle.name, loop.adaptation)
    return LearntOfJoint(channel.models.name, numbers, openings, tuple(left))


def adapted_rig(rig: Rig, learnt: Sequence[LearntOfJoint]) -> AdaptedRig:
    """The rig with what was learnt of its joints and valves.

    Parameters
    ----------
    rig : Rig
        As its file describes it.
    learnt : sequence of LearntOfJoint
        What is known.

    Raises
    ------
    PamError
        When nothing was learnt that can be written; the text says why.
    """
    changes: list[str] = []
    left: list[str] = []
    for each in learnt:
        reason = _against(each.numbers)
        if reason:
            left.append(f"{each.joint}: nothing is written, because {reason}")
        else:
            for number in each.numbers.numbers:
                rig, line = _with_number(rig, number)
                changes.append(line)
        for name, (opening, half) in each.openings.items():
            if abs(opening) >= max(half, LEAST_OPENING):
                rig, line = _with_opening(rig, rig.muscle(name), opening, half)
                changes.append(line)
        left += each.left
    if not changes:
        raise PamError(f"nothing was learnt that can be written: {'; '.join(left)}")
    return AdaptedRig(rig, tuple(changes), tuple(left))


def save_adapted_rig(made: AdaptedRig, path: Path) -> str:
    """Write a new rig file with what was learnt; return a line for the person who asked.

    Parameters
    ----------
    made : AdaptedRig
        From `adapted_rig`.
    path : Path
        It must not exist; its folder is made if needed.

    Raises
    ------
    PamError
        When it cannot be written.
    """
    try:
        if path.exists():
            raise PamError(
                f"{path}: exists, and is not overwritten; set another adaptation.rig_file"
            )
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:  # a name that is too long, a folder that may not be written
        raise PamError(f"{path}: cannot be written: {error.strerror or error}") from None
    save_rig(made.rig, path, made.notes)
    return f"written: {path}; {len(made.changes)} numbers, which are listed at its beginning"


def _against(found: RigNumbers) -> str:
    """Why the numbers of a joint are not to be written; empty if they are."""
    if found.seconds < LEAST_SECONDS:
        return (
            f"it moved for {found.seconds:.1f} s within the last 15 s of motion, and "
            f"{LEAST_SECONDS:g} s are needed"
        )
    if found.unexplained > found.limit:
        return (
            f"load, friction and dimensions leave {found.unexplained:.2g} N m of the torque "
            f"unexplained, and {found.limit:.2g} N m are permitted: record a motion and diagnose it"
        )
    if not found.certain:
        return "the rig file already explains its motion"
    return ""


def _with_number(rig: Rig, number: LearntNumber) -> tuple[Rig, str]:
    """The rig with one number changed, and the line about it."""
    value = max(number.value, 0.0) if number.key in ONLY_POSITIVE else number.value
    line = (
        f"{number.owner}.{number.key}: {number.written:.5g} -> {value:.5g} "
        f"({number.low:.5g} to {number.high:.5g})"
    )
    changed: dict[str, Any] = {number.key: value}
    if number.owner not in rig.joint_names:
        return rig.with_muscle(replace(rig.muscle(number.owner), **changed)), line
    joint = rig.joint(number.owner)
    if number.key != DRY_FRICTION:
        return rig.with_joint(replace(joint, **changed)), line
    if number.low <= number.written:
        return rig, line.replace(f"-> {value:.5g}", "kept")
    effects = _merged(joint.effects, number.key, value)
    return rig.with_joint(replace(joint, effects=effects)), line


def _merged(
    effects: Mapping[str, Mapping[str, float]], place: str, value: float
) -> dict[str, dict[str, float]]:
    effect, key = place.split(".")
    merged = {name: dict(values) for name, values in effects.items()}
    merged.setdefault(effect, {})[key] = value
    return merged


def _with_opening(rig: Rig, muscle: Muscle, opening: float, half: float) -> tuple[Rig, str]:
    """The rig with a null offset of a valve, and the line about it."""
    before = effect_value(muscle.effects, *NULL_OFFSET.split("."))
    value = before + opening
    muscle = replace(muscle, effects=_merged(muscle.effects, NULL_OFFSET, value))
    low, high = value - half, value + half
    line = f"{muscle.name}.{NULL_OFFSET}: {before:.3g} -> {value:.3g} ({low:.3g} to {high:.3g})"
    return rig.with_muscle(muscle), line


def _of_flow(name: str, flow: FlowAdaptation) -> list[str]:
    """What was learnt of a valve's flow and is not written."""
    supply, exhaust, _, _, overlap, _, leak, *_ = flow.weights
    causes = []
    for what, share in (("supply path", supply), ("exhaust path", exhaust)):
        if abs(share) > LARGE_SHARE:
            causes.append(f"{what} {share:+.0%} of its flow")
    if overlap < -LEAST_OPENING:
        causes.append(f"an overlap of about {-overlap:.1%} of the stroke")
    if leak > LEAST_OPENING:
        causes.append(f"a leak of about {leak:.1%} of the valve's flow")
    if flow.tube.share > 0.0:
        causes.append(f"a tube with {flow.tube.share**-0.5:.1f} times the valve's conductance")
    if flow.delay > LONG_DELAY:
        causes.append(f"commands {1e3 * flow.delay:.0f} ms late")
    return [f"{name}: not written, cause unclear: {', '.join(causes)}"] if causes else []


def _of_sensors(channel: JointChannel) -> list[str]:
    """What was learnt of the delays of a joint's sensors, which are not written."""
    causes = [
        f"{what} {1e3 * late:.0f} ms late"
        for what, late in (
            ("position", channel.late_position),
            ("pressures", channel.late_pressures),
        )
        if late > LONG_DELAY
    ]
    name = channel.models.name
    return [f"{name}: not written, cause unclear: {', '.join(causes)}"] if causes else []
