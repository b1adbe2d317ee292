"""Refuses recordings whose numbers cannot have the expected units, before any prediction.

Pressures in bar or a time in milliseconds cause no error in any formula, only a long search with a
meaningless result. Every channel is therefore compared with what the rig file makes possible: the
supply pressure, the lengths of the threads, the strongest force. Only sizes that no rig of this
file can have are refused.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pam_gap.recordings.encoder_reading import encoder_reading
from pam_gap.recordings.noise_floor import channel_noise
from pam_gap.recordings.recording import (
    COMMANDS,
    JOINTS,
    MUSCLES,
    PRESSURES,
    SHUT,
    SUPPLY,
    Array,
    Recording,
    RecordingError,
)
from pam_model.errors import Reasons
from pam_model.rig import Rig
from pam_model.robot import compose
from pam_model.unit_hints import conversion_hint
from pam_model.views.muscle_path import farthest_position

LONGEST_STEP = 0.25
"""A recording with fewer than four samples a second shows nothing of a joint [s]."""
SHORTEST_STEP = 2e-5
"""No valve board samples faster than 50 kHz [s]."""
LEAST_SHARE, USUAL_SHARE, LARGEST_SHARE = 0.02, 0.1, 2.0
"""Of the supply pressure: no joint works with less than the first; pressures usually reach the
second; shut muscles that are stretched do not exceed the third."""
ABOVE_SUPPLY = 1.05
"""Of the supply pressure: a gauge pressure above it, that never falls, is an absolute one."""
LARGEST_OPENING = 1.5
"""The command of a flow valve is from -1 to 1."""
LARGEST_PER_MILLE = 1500.0
"""A larger command of a flow valve is a pressure."""
SHUT_WITHIN = 0.03
"""Openings within this count as shut."""
SMOOTHED = 0.02
"""Time over which a change of a pressure is taken [s]."""
FALLS = 0.5
"""Of the largest pressure, that it must fall in all to say something of the valve."""
SMALLEST_PRESSURE = 1.0
"""If all commands are below this, they are spool openings and not set points [Pa]."""
FEWEST = 100
"""Samples below which the noise of a channel is not estimated."""
FARTHEST = 1.5
"""Positions beyond this many times the reach of the muscles are impossible."""
STRONGEST = 10.0
"""Forces beyond this many times the force at rest length and supply pressure are impossible."""
LENGTHS = (0.2, 3.0)
"""Range of a muscle's length relative to its rest length."""
CLEAR = 10.0
"""Of a channel's noise: a pressure that stays farther from 0 than this, and moves by more, is that
of a muscle that is never empty."""
NEAR_AMBIENT = 0.1
"""Relative distance from the ambient pressure at which an absolute pressure counts as ambient."""
STEADY = 0.02
"""Change of a pressure relative to the ambient one below which the muscle counts as empty."""
EXHAUSTING = 0.2
"""Opening beyond which an exhaust empties a muscle."""
EMPTIED_TIME = 0.5
"""Time that a muscle is exhausted without a change of its pressure, which then is ambient [s]."""


def refuse_other_units(rig: Rig, joint: int, recordings: Sequence[Recording]) -> None:
    """Refuse recordings with numbers that cannot have the units of the rig contract.

    Raises
    ------
    RecordingError
        The message has a line for each channel, with the recording, the value seen, the
        expectation and, where it can be recognised, the unit and how to convert it.
    """
    reasons = Reasons(RecordingError)
    for recording in recordings:
        with reasons.gathered():
            _check_muscles(rig, rig.joints[joint].muscles, recording)
        with reasons.gathered():
            _check_position(rig, joint, recording)
    reasons.refuse()


def refuse_other_units_on_bench(rig: Rig, muscle: str, recordings: Sequence[Recording]) -> None:
    """Refuse recordings of one muscle on a bench, as `refuse_other_units` does those of a joint."""
    reasons = Reasons(RecordingError)
    for recording in recordings:
        with reasons.gathered():
            _check_muscles(rig, (muscle,), recording)
    reasons.refuse()


def _check_muscles(rig: Rig, muscles: Sequence[str], recording: Recording) -> None:
    reasons = Reasons(RecordingError)
    with reasons.gathered():
        _check_time(recording)
    with reasons.gathered():
        _check_pressures(rig, muscles, recording)
    is_scaled = not reasons.lines
    with reasons.gathered():
        _check_supply(rig, recording)
    for muscle in muscles:
        with reasons.gathered():
            _check_command(rig, muscle, recording)
            # what follows compares the command with the pressure
            if is_scaled and recording.has(f"{PRESSURES}{muscle}"):
                _check_shut(rig, muscle, recording)
                _check_absolute(rig, muscle, recording)
        with reasons.gathered():
            _check_force_and_length(rig, muscle, recording)
    reasons.refuse()


def _refuse(recording: Recording, channel: str, seen: str, expected: str, hint: str = "") -> None:
    raise RecordingError(f"{recording.source}: {channel} {seen}; expected {expected}{hint}")


def _largest(recording: Recording, channel: str) -> float:
    """Largest amount but for one sample in a thousand, which may be wrong on its own."""
    return float(np.quantile(np.abs(recording.values[channel]), 0.999))


def _check_time(recording: Recording) -> None:
    step = recording.sample_time
    if SHORTEST_STEP <= step <= LONGEST_STEP:
        return
    hint = conversion_hint(step, "s", SHORTEST_STEP, LONGEST_STEP)
    _refuse(recording, "time", f"advances by {step:.4g} per sample", "seconds", hint)


def _check_pressures(rig: Rig, muscles: Sequence[str], recording: Recording) -> None:
    supply = rig.supply_pressure - rig.gas.ambient_pressure
    channels = [f"{PRESSURES}{m}" for m in muscles if recording.has(f"{PRESSURES}{m}")]
    if not channels:
        return
    sizes = [_largest(recording, channel) for channel in channels]
    largest = max(sizes)
    ambient = rig.gas.ambient_pressure
    lowest = min(float(recording.values[channel].min()) for channel in channels)
    expected = f"Pa gauge, up to {supply:.3g} by supply_pressure in the rig file"
    reasons = Reasons(RecordingError)
    if (
        ABOVE_SUPPLY * supply < largest < ABOVE_SUPPLY * (supply + ambient)
        and lowest > (1.0 - NEAR_AMBIENT) * ambient
        and recording.mounting != SHUT
    ):
        hint = f"; looks like Pa absolute (subtract {ambient:.6g})"
        for channel, size in zip(channels, sizes, strict=True):
            with reasons.gathered():
                seen = f"reaches {size:.4g} and never falls below {lowest:.4g}"
                _refuse(recording, channel, seen, expected, hint)
    elif LEAST_SHARE * supply <= largest <= LARGEST_SHARE * supply:
        for channel in channels:
            with reasons.gathered():
                _check_one_pressure(recording, channel, supply)
    else:
        for channel, size in zip(channels, sizes, strict=True):
            hint = conversion_hint(size, "Pa gauge", USUAL_SHARE * supply, 1.1 * supply)
            if not hint and size < largest:
                continue  # of an empty muscle, or in the unit of the contract
            if largest < supply and lowest < -0.5 * largest:
                hint = "; this is noise about zero: record while the muscles hold pressure"
            seen = f"never exceeds {size:.4g}" if size < supply else f"reaches {size:.4g}"
            with reasons.gathered():
                _refuse(recording, channel, seen, expected, hint)
    reasons.refuse()


def _check_one_pressure(recording: Recording, channel: str, supply: float) -> None:
    """Refuse one of two pressures that has another unit than the other, or the wrong sign.

    A muscle can be empty in a whole recording. Its pressure is then near 0.
    """
    values = recording.values[channel][recording.valid[channel]]
    if values.size < FEWEST:
        return
    low, high = (float(q) for q in np.quantile(values, [0.001, 0.999]))
    expected = f"Pa gauge, up to {supply:.3g} by supply_pressure in the rig file"
    if high < 0.0 and -low > LEAST_SHARE * supply:
        seen = f"is never above {high:.4g} and reaches {low:.4g}"
        _refuse(recording, channel, seen, expected, "; looks like a reversed sign")
    clear = CLEAR * channel_noise(values).deviation
    if not (clear < low and clear < high - low and high < LEAST_SHARE * supply):
        return
    hint = conversion_hint(high, "Pa gauge", USUAL_SHARE * supply, 1.1 * supply)
    if hint and "mbar" not in hint:  # which cannot be told from the zero error of a sensor
        seen = f"stays between {low:.4g} and {high:.4g}, unlike the other pressure"
        _refuse(recording, channel, seen, expected, hint)


def _check_supply(rig: Rig, recording: Recording) -> None:
    if not recording.has(SUPPLY):
        return
    largest, supply = _largest(recording, SUPPLY), rig.supply_pressure
    if LEAST_SHARE * supply <= largest <= LARGEST_SHARE * supply:
        return
    hint = conversion_hint(largest, "Pa absolute", 0.5 * supply, 1.5 * supply)
    expected = f"Pa absolute, near {supply:.3g} of the rig file"
    _refuse(recording, SUPPLY, f"reaches {largest:.4g}", expected, hint)


def _check_position(rig: Rig, joint: int, recording: Recording) -> None:
    entry = rig.joints[joint]
    channel = f"{JOINTS}{entry.name}.position"
    if not recording.has(channel):
        return
    robot = compose(rig)
    limit = FARTHEST * max(
        farthest_position(robot, robot.joints[joint]), *(abs(q) for q in entry.position_limits)
    )
    largest = _largest(recording, channel)
    reading = encoder_reading(rig, joint, recording)
    if largest <= limit:
        if reading is not None and reading.unit == "rad" and reading.right_angles:
            seen = f"is about {reading.offset:.2g} rad from where the pressures hold the joint"
            _refuse(recording, channel, seen, "rad", f"; looks like {reading.words()}")
        return
    told = "" if reading is None else reading.words()
    hint = f"; looks like {told}" if told else conversion_hint(largest, "rad", 0.0, limit)
    jumps = np.abs(np.diff(recording.values[channel]))
    if 0.5 < float(jumps.max()) / (2.0 * np.pi) < 1.0 and largest < 2.1 * np.pi:
        hint = "; looks like an angle that jumps by 2 pi where a turn begins: unwrap it"
    expected = f"rad, at most {limit:.3g} with the muscles and the pulley of the rig file"
    _refuse(recording, channel, f"reaches {largest:.4g}", expected, hint)


def _check_command(rig: Rig, muscle: str, recording: Recording) -> None:
    channel = f"{COMMANDS}{muscle}"
    if not recording.has(channel):
        return
    kind = rig.muscle(muscle).valve.kind
    supply = rig.supply_pressure - rig.gas.ambient_pressure
    see = f" (see {muscle}.valve.kind)"
    # A single wrong value among the openings must not make them pressures.
    share = 0.99 if kind == "flow" else 1.0
    largest = float(np.quantile(np.abs(recording.values[channel]), share))
    if kind == "flow" and largest > LARGEST_OPENING:
        hint = conversion_hint(largest, "-", 0.1, 1.05)
        if largest > LARGEST_PER_MILLE:
            hint = "; looks like Pa of a pressure regulator"
        expected = f"an opening from -1 to 1, since the rig file has a flow valve{see}"
        _refuse(recording, channel, f"reaches {largest:.4g}", expected, hint)
    if kind == "pressure_regulator" and 0.0 < largest < LEAST_SHARE * supply:
        hint = conversion_hint(largest, "Pa gauge", USUAL_SHARE * supply, 1.1 * supply)
        if largest <= SMALLEST_PRESSURE:
            hint = "; looks like a spool opening"
        expected = f"Pa gauge, since the rig file has a regulator{see}"
        _refuse(recording, channel, f"stays within {largest:.4g}", expected, hint)


def _check_shut(rig: Rig, muscle: str, recording: Recording) -> None:
    """Refuse openings that are never negative, where the pressure falls while they are positive.

    Many valves are shut at 5 V of 10 V, or at half of the range of a converter.
    """
    command, channel = f"{COMMANDS}{muscle}", f"{PRESSURES}{muscle}"
    if not recording.has(command) or rig.muscle(muscle).valve.kind != "flow":
        return
    commands, pressures = recording.values[command], recording.values[channel]
    if float(np.quantile(commands, 0.01)) < -SHUT_WITHIN:
        return
    count = max(round(SMOOTHED / recording.sample_time), 1)
    changes = np.diff(pressures[::count])
    lowest = np.minimum.reduceat(commands, np.arange(0, commands.size, count))[: changes.size]
    fallen = np.maximum(-changes, 0.0)
    total, against = float(fallen.sum()), float(fallen[lowest > SHUT_WITHIN].sum())
    if total > FALLS * _largest(recording, channel) and against > 0.5 * total:
        seen = f"is never below 0, and {channel} falls while it is above"
        expected = "an opening from -1 (exhaust) to 1 (supply), which is 0 where the valve is shut"
        hint = "; if it runs from 0 to 1 and the valve is shut at 0.5: `scale: 2, offset: -1`"
        _refuse(recording, command, seen, expected, hint)


def _check_absolute(rig: Rig, muscle: str, recording: Recording) -> None:
    """Refuse absolute pressures where the commands show that they are."""
    command, channel = f"{COMMANDS}{muscle}", f"{PRESSURES}{muscle}"
    if not recording.has(command) or recording.mounting == SHUT:
        return
    ambient = rig.gas.ambient_pressure
    pressures, commands = recording.values[channel], recording.values[command]
    if rig.muscle(muscle).valve.kind == "flow":
        empty = _emptied(pressures, commands, recording.sample_time, STEADY * ambient)
        if not empty.any():
            return
        above = float(np.median(pressures[empty]))
        seen = f"stays at {above:.4g} while the valve empties the muscle"
    else:
        off = pressures - commands
        low, above, high = (float(q) for q in np.quantile(off, [0.1, 0.5, 0.9]))
        if high - low > 2.0 * NEAR_AMBIENT * ambient:
            return
        seen = f"is {above:.4g} above its command throughout"
    if abs(above - ambient) <= NEAR_AMBIENT * ambient:
        hint = f"; looks like Pa absolute (subtract {ambient:.6g})"
        _refuse(recording, channel, seen, "Pa gauge, which is 0 in an empty muscle", hint)


def _emptied(
    pressures: Array, commands: Array, sample_time: float, change: float
) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Samples at the end of a long exhaust during which the pressure no longer changed."""
    length = max(2, round(EMPTIED_TIME / sample_time))
    empty = np.zeros(pressures.size, dtype=np.bool_)
    if pressures.size <= length:
        return empty
    shut_off = np.concatenate(([0], np.cumsum(commands > -EXHAUSTING)))
    open_all_the_time = shut_off[length:] == shut_off[:-length]
    steady = np.abs(pressures[length - 1 :] - pressures[: 1 - length]) < change
    empty[length - 1 :] = open_all_the_time & steady
    return empty


def _check_force_and_length(rig: Rig, muscle: str, recording: Recording) -> None:
    entry = rig.muscle(muscle)
    length = f"{MUSCLES}{muscle}.position"
    if recording.has(length):
        largest = _largest(recording, length)
        low, high = (share * entry.rest_length for share in LENGTHS)
        if not low <= largest <= high:
            hint = conversion_hint(largest, "m", low, high)
            if largest < low:
                hint = (
                    "; if this is how far it has moved, add the length at 0 to it: a map with "
                    "`offset` in m, and `sign: -1` if it grows as the muscle shortens"
                )
            expected = f"m, near the rest length {entry.rest_length:.3g} of the rig file"
            _refuse(recording, length, f"reaches {largest:.4g}", expected, hint)
    force = f"{MUSCLES}{muscle}.effort"
    if recording.has(force):
        area = abs(3.0 * entry.rest_length**2 - entry.thread_length**2)
        area = max(area / (4.0 * np.pi * entry.turns**2), 1e-4)
        limit = STRONGEST * area * (rig.supply_pressure - rig.gas.ambient_pressure)
        largest = _largest(recording, force)
        if largest > limit:
            hint = conversion_hint(largest, "N", 0.0, limit)
            expected = f"N, at most {limit:.3g} with the muscle and the supply of the rig file"
            _refuse(recording, force, f"reaches {largest:.4g}", expected, hint)
