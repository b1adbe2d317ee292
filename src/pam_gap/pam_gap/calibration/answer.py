"""What a calibration says: for people, for machines, and behind each number of the rig file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from pam_gap.answer.user_units import interval_digits, plain, told
from pam_gap.calibration.calibration import (
    DETERMINED,
    KEPT,
    NARROWED,
    NO_COMMANDS,
    RELATIVE,
    CalibratedNumber,
    Calibration,
)

MORE: Mapping[str, str] = {
    "pulley_radius": "measured forces (muscle_states.<muscle>.effort), or a calliper",
    "thread_length": "measured forces (muscle_states.<muscle>.effort), or a tape measure",
    "turns": "measured forces (muscle_states.<muscle>.effort), or counting the threads",
    "neutral_length": "motion to both ends of the range, or a tape measure",
    "inertia": "faster motion: steps, or a chirp to 2 Hz and more; and measured forces",
    "viscous_friction": "faster motion that overshoots; and measured forces",
    "gravity_torque": "large angles on both sides of the vertical, or the joint turned over",
    "gravity_angle": "large angles on both sides of the vertical, or the joint turned over",
    "dead_volume": "fast filling at both ends of the range of motion",
    "sonic_conductance": "fast filling and emptying, with the valve fully open at times",
    "critical_ratio": "filling until the pressure is near the supply, emptying until near ambient",
    "time_constant": "steps of the commands, recorded at 500 Hz or more",
    "damping": "small steps of the commands, 1 or 2 % of the supply pressure, recorded at 500 Hz: "
    "larger ones are limited by the flow of air",
    "supply_pressure": "a pressure gauge at the supply, or filling until the pressure stands still",
    "gain": "a reference gauge at the sensor",
    "bias": "a rest with vented muscles",
}
"""What would determine a number that a log leaves open, by the last part of its key."""
STATUS = {
    DETERMINED: "determined",
    RELATIVE: "determined relative to the torque per pressure",
    NARROWED: "narrowed",
    KEPT: "kept as written: this log does not determine it",
}


def what_would_help(number: CalibratedNumber) -> str:
    """The motion or measurement that would determine a number."""
    if number.stage == NO_COMMANDS:
        return "the commands of both valves (valve_commands.<muscle>)"
    return MORE.get(number.key.rpartition(".")[2], "")


def interval_words(low: float, high: float) -> str:
    """The ends of an interval, as `0.0498 to 0.0531`."""
    digits = interval_digits(low, high)
    return f"{plain(low, digits)} to {plain(high, digits)}"


def written_value(number: CalibratedNumber) -> str:
    """The number as the rig file has it: a range, a value, or that it is missing."""
    if number.stated is not None:
        return interval_words(*number.stated)
    return "missing" if number.written is None else plain(number.written, 4)


def status_words(number: CalibratedNumber) -> str:
    """What the data say of a number, and what would determine it."""
    more = "" if number.status == DETERMINED else f"; would help: {what_would_help(number)}"
    return STATUS[number.status] + more


def comment_of(number: CalibratedNumber, *, is_range: bool = False) -> str:
    """The comment behind a number in a rig file, where `is_range` says that it is still one."""
    if number.status == KEPT:
        was = "as written" if ".effects." not in number.key else "assumed, as for a good sensor"
        if number.stated is not None and not is_range:
            was = f"the middle of {written_value(number)}"
        elif number.written is None:
            was = "a guess, because it was missing"
        return f"{was}; this log does not determine it ({what_would_help(number)})"
    was = "it was missing" if number.written is None else f"was {written_value(number)}"
    text = f"90 %: {interval_words(number.low, number.high)}, by the stage {number.stage}; {was}"
    if number.relative is not None:
        text += f"; if the torque per pressure is right: {interval_words(*number.relative)}"
    return text


def comments(calibration: Calibration, *, are_ranges: bool = False) -> dict[str, str]:
    """The comments behind all numbers of a joint, by key.

    `are_ranges` says that a range that was not narrowed is still one.
    """
    return {one.key: comment_of(one, is_range=are_ranges) for one in calibration.numbers}


def sentence(calibration: Calibration) -> str:
    """What was found, in one line."""
    if calibration.refused:
        return f"no rig file. {' '.join(calibration.refused)}"
    count = Counter(one.status for one in calibration.numbers)
    parts = [
        f"{count[status]} {word}"
        for status, word in (
            (DETERMINED, "numbers determined"),
            (RELATIVE, "relative to the torque per pressure"),
            (NARROWED, "narrowed"),
            (KEPT, "kept as written"),
        )
        if count[status]
    ]
    return ", ".join(parts)


def withheld_lines(calibration: Calibration, words: str) -> list[str]:
    """How well the rig file predicts what was not fitted, for a terminal.

    Parameters
    ----------
    calibration : Calibration
        Of one joint or muscle.
    words : str
        What was not fitted.
    """
    shown = [one for one in calibration.withheld if one.horizon == "free run"]
    return [
        f"  {one.channel} in a free run of {words}: {told(one.before, one.unit)} RMS as written, "
        f"{told(one.after, one.unit)} calibrated"
        for one in shown
    ]


def table_lines(calibration: Calibration) -> list[str]:
    """One line for each number, for a terminal."""
    lines = []
    for one in calibration.numbers:
        value = f"{plain(one.value, 4)} {one.unit}".removesuffix(" -")
        if one.status == KEPT:
            said = "assumed" if ".effects." in one.key else "as written"
            was = "missing" if one.written is None else f"{written_value(one)} {one.unit}, {said}"
            was = was.replace(" -,", ",")
            lines.append(f"  {one.key}: {was}; would help: {what_would_help(one)}")
        else:
            lines.append(f"  {one.key}: {value} ({comment_of(one)})")
    return lines


def to_json(calibration: Calibration) -> dict[str, Any]:
    """The content of calibration.json for one joint."""
    return {
        "joint": calibration.joint,
        "refused": list(calibration.refused),
        "wiring": list(calibration.wiring),
        "notes": list(calibration.notes),
        "numbers": [
            asdict(one) | {"would_help": what_would_help(one) if one.status != DETERMINED else ""}
            for one in calibration.numbers
        ],
        "small_effects": calibration.small,
        "stages": {
            name: {"before": before, "after": after, "unit": "RMS over noise"}
            for name, (before, after) in calibration.stage_errors.items()
        },
        "withheld": [asdict(one) for one in calibration.withheld],
    }
