"""Estimates the noise of each channel from the recording alone.

Motion is smooth at the sampling rate and noise is not, so that high-order differences remove the
motion and keep the noise. Their mean square is computed over short segments. Single events do not
raise the median over the segments. The result is never below the quantisation noise.
Source: von Neumann, Kent, Bellinson and Hart (1941) on mean square successive differences, here
of third order; quantisation noise is one step over the square root of twelve.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pam_gap.recordings.recording import COMMANDS, Array, Mask, Recording
from pam_gap.rules import DEFAULT
from pam_gap.rules.recording_rules import RecordingRules

_THIRD = np.array([1.0, -3.0, 3.0, -1.0])
_FIFTH = np.array([1.0, -5.0, 10.0, -10.0, 5.0, -1.0])


@dataclass(frozen=True, slots=True)
class ChannelNoise:
    """White noise of one channel: standard deviation and quantisation step, in its unit."""

    deviation: float
    resolution: float
    is_smoothed: bool = False

    def at_least(self, deviation: float) -> ChannelNoise:
        """The same noise, but never below a deviation that no sensor falls below."""
        return replace(self, deviation=max(self.deviation, deviation))


def is_still(values: Array, noise: ChannelNoise, rules: RecordingRules = DEFAULT.recording) -> bool:
    """Whether a channel never changes by more than its noise and its quantisation.

    Parameters
    ----------
    values : ndarray, shape (N,)
        True samples of the channel, in its unit.
    noise : ChannelNoise
        Noise of the channel, in the same unit.
    rules : RecordingRules
        Constants of the judgement.
    """
    count = max(1, min(values.size // rules.stretch, values.size))
    means = [float(part.mean()) for part in np.array_split(values, count) if part.size]
    if not means:
        return True
    expected = np.hypot(noise.deviation / np.sqrt(rules.stretch), noise.resolution / np.sqrt(12.0))
    return max(means) - min(means) <= rules.still_span * float(expected)


def quantisation(values: Array, rules: RecordingRules = DEFAULT.recording) -> float:
    """The quantisation step, of which every change is a multiple; 0 if there is none."""
    if values.size < 2:
        return 0.0
    changes = np.abs(np.diff(values))
    steps = changes[changes > 1e-12 * (float(np.max(np.abs(values))) + 1e-300)]
    if steps.size < rules.fewest_steps:
        # Too few to compare with each other. A channel that repeats its value nearly always is
        # not resolved more finely than its smallest change.
        repeats = 0 < steps.size < rules.few_values * changes.size
        return float(np.min(steps)) if repeats else 0.0
    step = float(np.min(steps))
    few = np.unique(np.round(steps / step, 6)).size
    if few > rules.few_values * steps.size:
        return 0.0
    step = float(np.median(steps[steps < 1.5 * step]))
    near = steps[steps < 8.5 * step]
    whole = np.round(near / step)
    # A table with rounded decimals changes each value by up to half of its last digit.
    is_whole = np.abs(near / step - whole) < rules.whole_step
    if float(np.mean(is_whole)) < rules.whole_step_share:
        return 0.0
    return float(np.sum(near) / np.sum(whole))


def channel_noise(
    values: Array, valid: Mask | None = None, rules: RecordingRules = DEFAULT.recording
) -> ChannelNoise:
    """White noise of one channel.

    Parameters
    ----------
    values : ndarray, shape (N,)
        Values of the channel, in any unit.
    valid : ndarray of bool, shape (N,), optional
        Whether a value is a true sample; differences that include others are not used.
    rules : RecordingRules
        Constants of the estimate.
    """
    resolution = quantisation(values if valid is None else values[valid], rules)
    series = values if valid is None or valid.mean() > rules.valid_share else values[valid]
    difference = np.convolve(series, _THIRD, mode="valid") / np.sqrt(float(_THIRD @ _THIRD))
    higher = np.convolve(series, _FIFTH, mode="valid") / np.sqrt(float(_FIFTH @ _FIFTH))
    if valid is not None and valid.mean() > rules.valid_share:
        whole = np.convolve(valid.astype(np.float64), np.ones(4), mode="valid") > 3.5
        difference = difference[whole]
    count = difference.size // rules.stretch
    if count >= 4:
        stretches = difference[: count * rules.stretch].reshape(count, rules.stretch)
        deviation = float(np.sqrt(np.median(np.mean(stretches**2, axis=1))))
    else:
        deviation = float(np.sqrt(np.mean(difference**2))) if difference.size else 0.0
    floor = resolution / np.sqrt(12.0)
    scale = 1e-9 * (float(np.ptp(series)) if series.size else 0.0)
    lower, upper = float(np.median(np.abs(difference))), float(np.median(np.abs(higher)))
    span = float(np.subtract(*np.percentile(series, [95, 5]))) if series.size else 0.0
    # White noise gives equal normalised differences of any order; a filter reduces higher orders.
    is_coarse = resolution >= rules.visible_resolution * deviation
    is_filtered = not is_coarse and upper < rules.smoothed_ratio * lower
    if is_filtered or deviation < rules.cleanest_share * span:
        deviation = max(deviation, rules.smoothed_share * span, scale)
        return ChannelNoise(deviation, resolution, True)
    return ChannelNoise(max(deviation, floor, scale, 1e-12), resolution)


def noise_floor(
    recording: Recording, rules: RecordingRules = DEFAULT.recording
) -> Mapping[str, ChannelNoise]:
    """Noise of every measured channel of a recording; commands have no noise."""
    samples = recording.samples
    return {
        name: channel_noise(samples[name], rules=rules)
        if name in samples
        else channel_noise(values, recording.valid[name], rules)
        for name, values in recording.values.items()
        if not name.startswith(COMMANDS)
    }
