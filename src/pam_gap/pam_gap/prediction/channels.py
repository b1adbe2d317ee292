"""The channels of one joint: their names, and their values taken from one recording."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pam_gap.prediction.channel_order import BOTH_PRESSURES, N_CHANNELS, POSITION
from pam_gap.prediction.fit import Array
from pam_gap.recordings.noise_floor import ChannelNoise, noise_floor
from pam_gap.recordings.parts import part_of
from pam_gap.recordings.recording import (
    COMMANDS,
    JOINTS,
    LOCKED,
    MUSCLES,
    PRESSURES,
    SHUT,
    Recording,
    RecordingError,
)
from pam_gap.recordings.still_channels import finest_deviations
from pam_gap.rules import DEFAULT, Rules
from pam_model.plant.uneven_pulley import ROUND, UnevenPulley
from pam_model.rig import Rig
from pam_model.robot import compose
from pam_model.views.air_drawn import air_drawn


@dataclass(frozen=True, slots=True)
class Channels:
    """One recording in the form that the observer expects."""

    recording: Recording  # the recording from which the arrays were taken
    commands: Array  # shape (N, 2): valve commands; 0 where the recording has none
    # measured, known: shape (N, N_CHANNELS): pressures, position and forces, and whether each value
    # is a true sample
    measured: Array
    known: npt.NDArray[np.bool_]
    # shape (N_CHANNELS,): standard deviation of the white noise in the channel's unit; NaN if not
    # recorded
    deviation: Array
    # shape (N_CHANNELS,): Standard deviation of the mean of a block. Quantisation errors are not
    # averaged out, because they are constant while the joint is at rest.
    block_deviation: Array
    # whether valve commands were recorded, or are known since the valves were shut
    has_commands: bool
    # shape (N_CHANNELS,): Whether a channel is compared with its prediction. The position of a
    # locked joint and the `silent` channels of a recording are known but not compared.
    votes: npt.NDArray[np.bool_]
    block: int  # number of samples that are averaged into one row of errors
    # shape (N,): external torque on the joint [N m]; None if it was not recorded
    external: Array | None = None
    # shape (N, 2): what the muscles of other joints draw from the supply that all share, see
    # `pam_model.views.air_drawn`; None if nothing is known of it
    drawn: Array | None = None
    # lever arm of the pulley; by default that of a round one with the stated radius
    arm: UnevenPulley = ROUND

    @property
    def row_time(self) -> float:
        """Time of one row of errors [s]."""
        return self.block * self.recording.sample_time

    def rows(self, values: Array) -> Array:
        """Means of the samples of each row of errors, shape (rows, ...); a remainder is dropped."""
        count = len(values) // self.block
        whole = values[: count * self.block]
        means: Array = whole.reshape(count, self.block, *values.shape[1:]).mean(axis=1)
        return means


def channel_names(rig: Rig, joint: int) -> tuple[str, ...]:
    """Contract names of the N_CHANNELS channels of one joint, in the order of the arrays."""
    entry = rig.joints[joint]
    return (
        *(f"{PRESSURES}{m}" for m in entry.muscles),
        f"{JOINTS}{entry.name}.position",
        *(f"{MUSCLES}{m}.effort" for m in entry.muscles),
    )


def joint_channels(recording: Recording, rig: Rig, joint: int, rules: Rules = DEFAULT) -> Channels:
    """Take the channels of one joint from a recording.

    Raises
    ------
    RecordingError
        When the pressures are missing.
    """
    names = channel_names(rig, joint)
    missing = [name for name in names[BOTH_PRESSURES] if not recording.has(name)]
    if missing:
        raise RecordingError(
            f"{recording.source}: no channel {', '.join(missing)} [Pa gauge]; a diagnosis needs "
            "both pressures"
        )
    count = recording.time.size
    measured = np.zeros((count, N_CHANNELS))
    known = np.zeros((count, N_CHANNELS), dtype=np.bool_)
    noise: dict[str, ChannelNoise] = dict(noise_floor(recording, rules.recording))
    finest = finest_deviations(rig, joint, rules.recording)
    block = max(1, round(rules.prediction.block_time / recording.sample_time))
    votes = np.ones(N_CHANNELS, dtype=np.bool_)
    deviation = np.full(N_CHANNELS, np.nan)
    block_deviation = np.full(N_CHANNELS, np.nan)
    for i, name in enumerate(names):
        if recording.has(name):
            measured[:, i] = recording.values[name]
            known[:, i] = recording.valid[name]
            found = noise[name].at_least(float(finest[i]))
            deviation[i] = found.deviation
            block_deviation[i] = np.sqrt(found.deviation**2 / block + found.resolution**2 / 12.0)
            votes[i] = name not in recording.silent
    votes[POSITION] &= recording.mounting != LOCKED
    commands = np.zeros((count, 2))
    command_names = [f"{COMMANDS}{m}" for m in rig.joints[joint].muscles]
    torque = recording.values.get(f"{JOINTS}{rig.joints[joint].name}.effort")
    is_shut = recording.mounting == SHUT
    has_commands = is_shut or all(recording.has(name) for name in command_names)
    if has_commands and not is_shut:
        for i, name in enumerate(command_names):
            commands[:, i] = recording.values[name]
    return Channels(
        recording,
        commands,
        measured,
        known,
        deviation,
        block_deviation,
        has_commands,
        votes,
        block,
        torque,
        drawn_by_others(recording, rig, joint),
    )


def beginning_of(data: Channels, seconds: float) -> Channels:
    """The first seconds of a recording, with the noise that was found in all of it."""
    count = min(round(seconds / data.recording.sample_time), len(data.measured))
    return replace(
        data,
        recording=part_of(data.recording, 0, count),
        commands=data.commands[:count],
        measured=data.measured[:count],
        known=data.known[:count],
        external=None if data.external is None else data.external[:count],
        drawn=None if data.drawn is None else data.drawn[:count],
    )


def drawn_by_others(recording: Recording, rig: Rig, joint: int) -> Array | None:
    """What the muscles of the other joints draw, as in `Channels.drawn`."""
    own = rig.joints[joint].muscles
    others = [name for one in rig.joints for name in one.muscles if name not in own]
    others = [
        name
        for name in others
        if recording.has(f"{COMMANDS}{name}") and recording.has(f"{PRESSURES}{name}")
    ]
    if not others or recording.mounting == SHUT:
        return None
    robot = compose(rig)
    rows = [
        air_drawn(
            robot,
            robot.muscle(name),
            recording.values[f"{COMMANDS}{name}"],
            recording.values[f"{PRESSURES}{name}"],
            recording.sample_time,
        )
        for name in others
    ]
    total: Array = np.sum(rows, axis=0)
    return total
