"""The resampling of a log onto one uniform time grid.

Nothing is low-pass filtered here, because a filtered channel would look like a lag of the rig. A
command is held until the next one, as a valve holds it, and each step of the grid gets the mean
command during the step. Measurements are interpolated linearly to the grid. They are valid only
near true samples and outside gaps. Every repair is noted in words.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from pam_gap.recordings.recording import (
    COMMANDS,
    GAP_PERIODS,
    Array,
    Mask,
    RawChannel,
    RawRecording,
    Recording,
    RecordingError,
    runs,
)

LONGEST_PAUSE = 5.0
"""Of a longer pause of all channels, only this is kept [s]: nothing is known of the rig in it."""
MOST_ROWS = 1e7
"""Rows of the grid; more than five hours at 500 Hz."""
SPIKE = 25.0  # a sample this many noise widths from both neighbours is an error of the log
SAME_TIME = 1e-3
"""Share of a step: a stamp this close to a grid point counts as on the grid point."""
FAR = 3.0
"""Of the range of all other values: a value that is farther from them, and is repeated exactly, is
no measurement but what a device writes in place of one, such as -999."""
OFTEN = 0.1  # share of the samples up to which a value may be such a mark
RESTARTED = 0.02
"""Share of the samples, stamped before an earlier one, above which the clock was started anew."""
SET_BACK = 20
"""Successive samples, stamped before an earlier one, that are no late messages: the clock was set
back."""


def _refuse_one_stamp(raw: RawRecording) -> None:
    """Refuse rows that have few different times, as where a time was written with few digits."""
    for name, channel in raw.channels.items():
        stamps = np.unique(channel.time[np.isfinite(channel.time)])
        if channel.value.size >= 8 > stamps.size:
            raise RecordingError(
                f"{raw.source}: {name}: the time has only {stamps.size} different values in "
                f"{channel.value.size} rows; expected one for each (was it written with too few "
                "digits?)"
            )


def _clean(name: str, raw: RawChannel, repairs: list[str]) -> RawChannel:
    """Remove what is no measurement and repeated stamps, and sort stamps that run backwards."""
    time, value = raw.time, raw.value
    finite = np.isfinite(time) & np.isfinite(value)
    if not finite.all():
        repairs.append(f"{name}: {int((~finite).sum())} missing samples were removed")
        time, value = time[finite], value[finite]
    if time.size == 0:
        return RawChannel(time, value)
    if np.any(np.diff(time) < 0.0):
        _refuse_restart(name, time)
        count = int((np.diff(time) < 0.0).sum())
        repairs.append(
            f"{name}: stamps ran backwards {count} times; the samples were sorted by stamp"
        )
        order = np.argsort(time, kind="stable")
        time, value = time[order], value[order]
    repeated = np.concatenate(([False], np.diff(time) <= 0.0))
    if repeated.any():
        repairs.append(
            f"{name}: {int(repeated.sum())} repeated stamps; the first value of each was kept"
        )
        time, value = time[~repeated], value[~repeated]
    if name.startswith(COMMANDS) or value.size < 16:
        return RawChannel(time, value)
    before = np.diff(value)[:-1]
    after = np.diff(value)[1:]
    width = max(float(np.median(np.abs(before - after))), float(np.ptp(value)) * 1e-4) + 1e-300
    spike = (np.minimum(np.abs(before), np.abs(after)) > SPIKE * width) & (before * after < 0.0)
    if spike.any():
        repairs.append(f"{name}: {int(spike.sum())} single spikes were removed")
        keep = np.concatenate(([True], ~spike, [True]))
        time, value = time[keep], value[keep]
    return _without_marks(name, RawChannel(time, value), repairs)


def _without_marks(name: str, raw: RawChannel, repairs: list[str]) -> RawChannel:
    """A measurement without the value that marks an error of its sensor, or both such values."""
    for end in (np.min, np.max):
        mark = float(end(raw.value))
        marked = raw.value == mark
        count, others = int(marked.sum()), raw.value[~marked]
        width = float(np.ptp(others)) if others.size else 0.0
        if not (2 <= count <= OFTEN * raw.value.size and width > 0.0):
            continue
        if float(np.abs(others - mark).min()) > FAR * width:
            repairs.append(
                f"{name}: {count} samples of {mark:.6g} were removed: all others are far from it, "
                "as where a device writes an error in place of a measurement"
            )
            raw = RawChannel(raw.time[~marked], raw.value[~marked])
    return raw


def _shortened(channels: dict[str, RawChannel], repairs: list[str]) -> dict[str, RawChannel]:
    """The channels without the time in which none of them has a sample, but for a few seconds.

    A clock that is set while it is recorded, and recordings joined to one, leave pauses of hours.
    """
    stamps = np.unique(np.concatenate([raw.time for raw in channels.values()]))
    pauses = np.diff(stamps)
    long = pauses > LONGEST_PAUSE
    if not long.any():
        return channels
    begins = stamps[:-1][long]
    removed = np.concatenate(([0.0], np.cumsum(pauses[long] - LONGEST_PAUSE)))
    repairs.append(
        f"all channels: {begins.size} pauses of {float(pauses[long].sum()):.6g} s in total, the "
        f"first at {begins[0] - stamps[0]:.4g} s; {LONGEST_PAUSE:g} s of each are kept"
    )
    return {
        name: RawChannel(raw.time - removed[np.searchsorted(begins, raw.time)], raw.value)
        for name, raw in channels.items()
    }


def _refuse_restart(name: str, time: Array) -> None:
    """Refuse stamps that start anew: sorting them would mix two recordings."""
    late = time < np.maximum.accumulate(time)
    first, end = max(runs(late), key=lambda run: run[1] - run[0])
    count = end - first
    if float(late.mean()) <= RESTARTED and count < SET_BACK:
        return
    raise RecordingError(
        f"{name}: time goes back from {time[first - 1]:.6g} s to {time[first]:.6g} s at sample "
        f"{first + 1} and stays behind for {count} samples, {100.0 * late.mean():.2g} % of the "
        "recording in all; expected one recording with increasing time: cut it there, and give "
        "both parts as two recordings"
    )


def _lost(name: str, raw: RawChannel, period: float, repairs: list[str]) -> None:
    """Note measurements that are missing between others, up to the pauses noted as gaps."""
    if name.startswith(COMMANDS):
        return
    pauses = np.diff(raw.time) / period
    few = (pauses > 1.5) & (pauses <= GAP_PERIODS)
    if few.any():
        lost = int(np.round(pauses[few] - 1.0).sum())
        repairs.append(
            f"{name}: {lost} of {raw.time.size + lost} samples are missing one by one or a few at "
            "a time; the values between their neighbours were interpolated"
        )


def _for_all_channels(repairs: list[str], names: Collection[str]) -> list[str]:
    """Notes that are the same for every channel, as one note."""
    texts: dict[str, set[str]] = {}
    for note in repairs:
        name, _, text = note.partition(": ")
        texts.setdefault(text, set()).add(name)
    shared = {text for text, found in texts.items() if len(found) > 2 and found >= set(names)}
    kept: list[str] = []
    for note in repairs:
        text = note.partition(": ")[2]
        kept.append(f"all channels: {text}" if text in shared else note)
    return list(dict.fromkeys(kept))


def _periods(channels: Mapping[str, RawChannel]) -> dict[str, float]:
    return {name: float(np.median(np.diff(raw.time))) for name, raw in channels.items()}


def _mean_command(raw: RawChannel, grid: Array, step: float) -> Array:
    """Mean command from each grid point to the next.

    To take only the command at each grid point would delay commands by half a step on average.
    """
    place = (raw.time - grid[0]) / step
    near = np.round(place)
    place = np.where(np.abs(place - near) < SAME_TIME, near, place)
    area = np.concatenate(([0.0], np.cumsum(raw.value[:-1] * np.diff(place))))
    edges = np.arange(grid.size + 1, dtype=np.float64)
    last = np.clip(np.searchsorted(place, edges, side="right") - 1, 0, place.size - 1)
    held = raw.value[last]
    changes = last[1:] - last[:-1] - (place[last[1:]] == edges[1:]) > 0
    mean = np.diff(area[last] + held * (edges - place[last]))
    result: Array = np.where(changes, mean, held[:-1])
    return result


def _onto_grid(
    name: str, raw: RawChannel, grid: Array, step: float, period: float, repairs: list[str]
) -> tuple[Array, Mask]:
    after = np.searchsorted(raw.time, grid + 1e-9 * step, side="right")
    last = np.clip(after - 1, 0, raw.time.size - 1)
    following = np.clip(after, 0, raw.time.size - 1)
    age = grid - raw.time[last]
    if name.startswith(COMMANDS):
        held = _mean_command(raw, grid, step)
        valid = (age >= -0.5 * step) & (age < GAP_PERIODS * max(period, step))
        missing = int((~valid).sum())
        if missing:
            repairs.append(
                f"{name}: no command for {missing * step:.3g} s in total; the last one was held"
            )
        return held, valid
    width = raw.time[following] - raw.time[last]
    nearest = np.minimum(np.abs(age), np.abs(raw.time[following] - grid))
    value = np.interp(grid, raw.time, raw.value)
    bridged = width > GAP_PERIODS * max(period, step)
    near = (nearest <= 0.5 * step * (1.0 + 1e-6)) | (width <= 1.5 * step)
    valid = near & ~(bridged & (nearest > 0.05 * step))
    holes = np.diff(raw.time) > GAP_PERIODS * max(period, step)
    if holes.any():
        repairs.append(
            f"{name}: {int(holes.sum())} gaps of {float(np.diff(raw.time)[holes].sum()):.3g} s in "
            "total, which are excluded from every comparison"
        )
    return value, valid


def _is_on_grid(raw: RawChannel, start: float, step: float) -> bool:
    place = (raw.time - start) / step
    return bool(np.all(np.abs(place - np.round(place)) < SAME_TIME))


def resample(raw: RawRecording, step: float | None = None) -> Recording:
    """Resample a raw recording onto one uniform time grid.

    Parameters
    ----------
    raw : RawRecording
        Channels as logged.
    step : float, optional
        Step of the grid [s]; default is the shortest median period of a channel, rounded to 1 us.

    Returns
    -------
    Recording
        The recording from the first to the last instant at which every channel is known.

    Raises
    ------
    RecordingError
        When no channel has enough samples, the channels do not overlap in time, the time starts
        anew, or the recording is too long.
    """
    repairs = list(raw.remarks)
    channels: dict[str, RawChannel] = {}
    for name, channel in raw.channels.items():
        try:
            cleaned = _clean(name, channel, repairs)
        except RecordingError as error:
            raise RecordingError(f"{raw.source}: {error}") from None
        if cleaned.time.size < 8:
            repairs.append(
                f"{name}: the channel has only {cleaned.time.size} samples and is not used"
            )
        else:
            channels[name] = cleaned
    if not channels:
        _refuse_one_stamp(raw)
        counts = [f"{n} {int(np.isfinite(c.value).sum())}" for n, c in raw.channels.items()]
        raise RecordingError(
            f"{raw.source}: no channel with at least 8 samples; numbers per channel: "
            f"{', '.join(counts[:8]) or 'no column was mapped to a channel'}"
        )
    channels = _shortened(channels, repairs)
    periods = _periods(channels)
    chosen = step if step is not None else round(min(periods.values()), 6)
    if not chosen > 0.0:
        step = min(periods.values())
        raise RecordingError(
            f"{raw.source}: time advances by {step:.3g} s per sample; expected seconds that "
            "increase (of days, `scale: 86400` in the map makes seconds)"
        )
    for name, channel in channels.items():
        spread = float(np.percentile(np.abs(np.diff(channel.time) / periods[name] - 1.0), 99))
        if spread > 0.05:
            repairs.append(
                f"{name}: stamps jitter by {100 * spread:.0f} % of a period (99th percentile); the "
                "channel was resampled by stamp"
            )
    start = max(channel.time[0] for channel in channels.values())
    end = min(channel.time[-1] for channel in channels.values())
    if end - start < 100 * chosen:
        raise RecordingError(
            f"{raw.source}: the channels overlap for {end - start:.3g} s; "
            f"expected at least {100 * chosen:.3g} s"
        )
    if end - start > MOST_ROWS * chosen:
        raise RecordingError(
            f"{raw.source}: {end - start:.3g} s at a step of {chosen:.3g} s are "
            f"{(end - start) / chosen:.3g} rows, more than {MOST_ROWS:.0g}; cut the recording, or "
            "look for a stamp that is far off"
        )
    slow = sorted({f"{1 / p:.4g} Hz" for p in periods.values() if p > 1.5 * chosen})
    if slow:
        repairs.append(
            f"the grid has {1 / chosen:.4g} Hz; slower channels ({', '.join(slow)}) "
            "are compared only at their own samples"
        )
    grid = start + chosen * np.arange(int((end - start) / chosen + 1e-6) + 1, dtype=np.float64)
    values: dict[str, Array] = {}
    valid: dict[str, Mask] = {}
    for name, channel in channels.items():
        _lost(name, channel, periods[name], repairs)
        values[name], valid[name] = _onto_grid(name, channel, grid, chosen, periods[name], repairs)
    samples = {
        name: channel.value
        for name, channel in channels.items()
        if not name.startswith(COMMANDS) and not _is_on_grid(channel, start, chosen)
    }
    return Recording(
        raw.source, chosen, grid - start, values, valid,
        tuple(_for_all_channels(repairs, raw.channels)),
        samples=samples, one_clock=raw.one_clock,
    )  # fmt: skip
